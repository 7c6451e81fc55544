"""Runs `swimbladder` commands in forks of one process that has imported all of the package.

``python warm.py SOCKET`` serves until its standard input ends. `CLIENT` is the program to put on
the path: it hands its arguments, folder, environment and streams over, and exits with the code that
comes back. A command so begun differs from a process of its own in what is imported already, no
more; the examples of the README, and `tests/cli`, begin processes.

No command ends with `CRASHED`, what is no answer but a traceback, of the command or of the fork
before it; nor with `DIED`, a fork or a server that is gone. It is for Linux: macOS has no such
sockets, and its frameworks do not survive a fork.
"""

import contextlib
import gc
import json
import os
import select
import socket
import sys
import tempfile
import traceback
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import NoReturn

CLIENT = """#!{python} -SI
import json, os, socket, sys
call = json.dumps([sys.argv[1:], os.getcwd(), dict(os.environ)]).encode()
answer = b""
try:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as server:
        server.connect({address!r})
        socket.send_fds(server, [call], [0, 1, 2])
        answer = server.recv(1)
except OSError as error:
    print(error, file=sys.stderr)
if not answer:
    print("the server of the examples, or its fork, died", file=sys.stderr)
sys.exit(answer[0] if answer else {died})
"""
CRASHED, DIED = 70, 71  # 70 is EX_SOFTWARE of sysexits.h; commands end with 0, 1, 2 or 130
_MOST = 1 << 17  # bytes of a call


def client(address: str) -> str:
    """Return the program that has its command run by the server at an address."""
    return CLIENT.format(python=sys.executable, address=address, died=DIED)


def main(address: str) -> None:
    """Serve at a socket's path; says so on standard output when it is ready."""
    _warm()
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(address)
        listener.listen()
        print("ready", flush=True)
        while sys.stdin not in select.select([listener, sys.stdin], [], [])[0]:
            with contextlib.suppress(ChildProcessError):
                while os.waitpid(-1, os.WNOHANG)[0]:
                    pass
            connection, _ = listener.accept()
            if os.fork() == 0:
                _serve(connection)
            connection.close()


def _warm() -> None:
    """Import every module, and load the kernel that most commands need."""
    import swimbladder
    from swimbladder.cli import main as command

    for found in walk_packages(swimbladder.__path__, "swimbladder."):
        if not found.name.endswith("__main__"):
            import_module(found.name)
    with tempfile.TemporaryDirectory() as folder, Path(os.devnull).open("w") as nothing:
        call = ["simulate", "feup-em", "--duration", "30", "--plot", "--netcdf", "--out", folder]
        with contextlib.redirect_stdout(nothing), contextlib.redirect_stderr(nothing):
            code = command(call)
    assert code == 0
    gc.freeze()  # a fork's collector need not look at, and so copy, any of this


def _serve(connection: socket.socket) -> NoReturn:
    """Run the call of a connection, in a child, and end it."""
    from swimbladder.cli import main as command

    code = CRASHED
    try:
        call, streams, _, _ = socket.recv_fds(connection, _MOST, 3)
        arguments, folder, environment = json.loads(call)
        for number, stream in enumerate(streams):
            os.dup2(stream, number)
            os.close(stream)
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(environment)
        sys.argv = ["swimbladder", *arguments]
        code = command()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(OSError):
            sys.stdout.flush()
            sys.stderr.flush()
        connection.send(bytes([code & 0xFF]))
        os._exit(code & 0xFF)


if __name__ == "__main__":
    main(sys.argv[1])
