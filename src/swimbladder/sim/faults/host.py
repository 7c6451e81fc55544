"""The vehicle's C compiled for this machine, and the addresses of its functions.

Needs gcc or clang: the code that is tested is the one that the board gets, not a translation of it.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType

from swimbladder.errors import InputError
from swimbladder.io.files import temporary_folder

_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC")


def compiler() -> str:
    """Return the path of a C compiler: that of CC, or cc, gcc, clang.

    Raises InputError where there is none.
    """
    asked = os.environ.get("CC", "").split()
    names = asked[:1] or ["cc", "gcc", "clang"]
    for name in names:
        found = shutil.which(name)
        if found:
            return found
    raise InputError(
        "the controller's C has to be compiled on this machine, and there is no C compiler",
        field="CC" if asked else None, value=asked[0] if asked else None,
        remedy="Install gcc or clang (Debian: apt install gcc; macOS: xcode-select --install; "
        "Windows: MSYS2), or name one with the environment variable CC",
    )  # fmt: skip


class Board:
    """C sources compiled into a library that is loaded; a context that takes it away again.

    files: text by name, those that end with ``.c`` compiled. The glue among them defines
    ``int NAME_size(void)``, ``void NAME_begin(void *memory, int after_reset)`` and
    ``float NAME_tick(void *memory, const float *seen, float *said)`` for each of `names`.
    """

    def __init__(self, files: Mapping[str, str], names: tuple[str, ...]) -> None:
        cc = compiler()
        self._folder = temporary_folder(Path(tempfile.gettempdir()))
        try:
            for name, text in files.items():
                (self._folder / name).write_text(text, encoding="utf-8")
            sources = [str(self._folder / name) for name in files if name.endswith(".c")]
            made = self._folder / ("board.dll" if os.name == "nt" else "board.so")
            done = subprocess.run(
                [cc, *_FLAGS, *sources, "-o", str(made), "-lm"], capture_output=True, text=True,
                check=False,
            )  # fmt: skip
            if done.returncode != 0:
                said = " ".join((done.stderr or done.stdout or "no message").split())
                raise InputError(
                    f"{Path(cc).name} did not compile the controller's C: {said[:300]}",
                    remedy="Name another C compiler with the environment variable CC",
                )
            self._library = ctypes.CDLL(str(made))
        except BaseException:
            self.__exit__(None, None, None)
            raise
        self.addresses = {name: (self._at(f"{name}_begin"), self._at(f"{name}_tick"))
                          for name in names}  # fmt: skip
        # bytes that it remembers
        self.size = max(int(self._library[f"{name}_size"]()) for name in names)

    def _at(self, name: str) -> int:
        address = ctypes.cast(self._library[name], ctypes.c_void_p).value
        assert address is not None
        return address

    def __enter__(self) -> Board:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        where: TracebackType | None,
    ) -> None:  # fmt: skip
        """Delete the files; the loaded library stays in memory where the system lets it."""
        shutil.rmtree(self._folder, ignore_errors=True)
