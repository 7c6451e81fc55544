"""The serial line to a board: frames that are numbered and checked, asked again where one is lost.

`templates/hil.h.j2` is the other end, and says what a frame is.
"""

from __future__ import annotations

import os
import struct
import time
from binascii import crc_hqx
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple

from swimbladder.control.supervisor import Watched
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.vehicle.plugins import optional

VERSION = 2
BAUD = 115_200
_START, _AROUND = 0x7E, 6  # of a frame; bytes that are not payload
_HELLO, _BEGIN, _ARM, _TICK, _STATUS, _CORRUPT = b"HBATSN"
_TICK_OUT, _TICK_IN = struct.Struct("<4fIfB"), struct.Struct("<2f2I2H4B")
_BEGIN_OUT, _STATUS_IN = struct.Struct("<B"), struct.Struct("<IH")
FACTS = {
    "version": VERSION,
    "baud": BAUD,
    "start": f"0x{_START:02x}",
    "payload": max(_TICK_OUT.size, _TICK_IN.size),
    "around": _AROUND,
    "begin_bytes": _BEGIN_OUT.size,
    "tick_bytes": _TICK_OUT.size,
    **dict(zip(("hello", "begin", "arm", "tick", "status", "corrupt"), "HBATSN", strict=True)),
}
"""What the board's end has to know, for its template."""

_GREETING, _ANSWER = 5.0, 1.0  # s until a board has begun (opening its port resets it), and answers
_AGAIN = 0.5  # s between greetings
_TRIES = 5
_READ = 0.05  # s that one read waits for
_SKETCH = "examples/HardwareInTheLoop of the library that `swimbladder firmware` writes"


class Said(NamedTuple):
    """What a board, or its twin, makes of a tick; command and allowed as float32."""

    armed: bool  # law and supervisor command
    command: float  # V, m3, or s of pump and valve
    allowed: float  # m, the deepest that the law is asked for
    reasons: int  # bit n - 1 of reason n
    missed: int  # calls in a row in which the law had no command
    reason: int  # the first one; 0: none
    release: bool  # of the weight
    wide: bool  # a command below 0 is for the bypass


class Wire:
    """A board at the end of a serial line; a context that closes it.

    Opening it waits until the board answers. digest: of the C that the board is to have.
    Raises InputError where the port or the board at it is not the right one.
    """

    def __init__(self, port: str, digest: bytes, *, baud: int = BAUD) -> None:
        self.port, self.baud = port, baud
        self.frames = {"sent": 0, "lost": 0, "corrupt": 0}
        self._serial, self._failure = _opened(port, baud)
        self._sequence, self._got, self._heard = 0, bytearray(), 0
        try:
            self._greet(digest)
        except BaseException:
            self._serial.close()
            raise

    def __enter__(self) -> Wire:
        return self

    def __exit__(self, *_: object) -> None:
        self._serial.close()

    def begin(self, *, after_reset: bool) -> None:
        """Begin the vehicle anew: disarmed, as after switching on, or as after a reset."""
        self._ask(_BEGIN, _BEGIN_OUT.pack(after_reset))

    def arm(self) -> None:
        """Arm the vehicle, as the word on a sketch's serial line does."""
        self._ask(_ARM, b"")

    def tick(self, seen: Watched, reference: float) -> tuple[Said, int, int]:
        """Return what the board makes of what is seen and of the depth asked for [m].

        And when it began by its own clock [us, modulo 2^32], and how long it took [us].
        """
        numbers = (seen.depth, seen.depth_age, seen.volume, seen.battery, int(seen.lost))
        answer = self._ask(_TICK, _TICK_OUT.pack(*numbers, reference, seen.leak))
        command, allowed, began, took, reasons, missed, reason, *bits = _TICK_IN.unpack(answer)
        release, wide, armed = map(bool, bits)
        said = Said(armed, command, allowed, reasons, missed, reason, release, wide)
        return said, began, took

    def status(self) -> tuple[int | None, int]:
        """Return (bytes of stack never used, None: not known; corrupt frames that it received)."""
        stack, corrupt = _STATUS_IN.unpack(self._ask(_STATUS, b""))
        return None if stack == 0xFFFFFFFF else stack, corrupt

    def _greet(self, digest: bytes) -> None:
        """Wait for the board; raise InputError where none answers, or not the one for us."""
        until = time.monotonic() + _GREETING
        answer = None
        with self._mending():
            while answer is None and time.monotonic() < until:
                self._send(_HELLO, b"")
                answer = self._answer(_HELLO, _AGAIN)
        problem = partial(InputError, field="port", value=self.port)
        if answer is None and self._heard:
            what = f"what it sends at {self.baud} baud is no frame of this protocol"
            remedy = f"Give the `baud=` of the sketch ({BAUD} as written), and flash {_SKETCH}"
            raise problem(what, remedy=remedy)
        if answer is None:
            what = f"no board answers within {_GREETING:g} s"
            remedy = f"Flash {_SKETCH}, close the serial monitor, and check port and `baud=`"
            raise problem(what, remedy=remedy)
        version, theirs = answer[0], answer[1:]
        if version != VERSION:
            what = f"the board speaks version {version} of the protocol, and this program {VERSION}"
            raise problem(what, remedy=f"Flash {_SKETCH}, written by this version")
        if theirs != digest:
            what = f"the board has the C {theirs.hex()}, and this vehicle's is {digest.hex()}"
            remedy = f"Flash {_SKETCH}, for this vehicle, without a pool; or give its vehicle"
            raise problem(what, remedy=remedy)

    def _ask(self, kind: int, payload: bytes) -> bytes:
        """Return the payload of the answer; raise NoAnswerError where there is none any more."""
        self._sequence = self._sequence % 255 + 1
        with self._mending():
            for _ in range(_TRIES):
                self._send(kind, payload)
                if (answer := self._answer(kind, _ANSWER)) is not None:
                    return answer
                self.frames["lost"] += 1
        raise NoAnswerError(f"{self.port}: no whole answer in {_TRIES} tries")

    @contextmanager
    def _mending(self) -> Iterator[None]:
        """Raise NoAnswerError for what a port that has gone raises."""
        try:
            yield
        except (self._failure, OSError) as error:
            raise NoAnswerError(f"{self.port}: the port has gone") from error

    def _send(self, kind: int, payload: bytes) -> None:
        body = bytes([len(payload), kind, self._sequence]) + payload
        self._serial.write(bytes([_START]) + body + crc_hqx(body, 0xFFFF).to_bytes(2, "little"))
        self.frames["sent"] += 1

    def _answer(self, kind: int, wait: float) -> bytes | None:
        """Return the payload of the answer to what was sent last; None: none came in time [s]."""
        until, corrupt = time.monotonic() + wait, self.frames["corrupt"]
        while True:
            while (frame := self._frame()) is None:
                if self.frames["corrupt"] > corrupt and not self._got and kind != _HELLO:
                    return None
                if time.monotonic() > until:
                    self.frames["corrupt"] += bool(self._got)
                    self._got.clear()
                    return None
                got = self._serial.read(max(1, self._serial.in_waiting))
                self._heard += len(got)
                self._got += got
            if frame[:2] == (kind, self._sequence):
                return frame[2]
            if frame[0] == _CORRUPT and kind != _HELLO:  # ours was not whole
                return None

    def _frame(self) -> tuple[int, int, bytes] | None:
        """Take the first whole frame from what was received; None where there is none yet."""
        got = self._got
        while True:
            at = got.find(_START)
            del got[: len(got) if at < 0 else at]
            if len(got) < _AROUND or len(got) < _AROUND + got[1]:
                return None
            end = 4 + got[1]
            if crc_hqx(bytes(got[1:end]), 0xFFFF) == int.from_bytes(got[end : end + 2], "little"):
                frame = got[2], got[3], bytes(got[4:end])
                del got[: end + 2]
                return frame
            self.frames["corrupt"] += 1
            del got[:1]


def _opened(port: str, baud: int) -> tuple[Any, type[Exception]]:
    """Return an open port, and what its functions raise."""
    serial = optional("serial", "serial", "speaking to a board", field="port", value=port)
    failure: type[Exception] = serial.SerialException
    try:
        line = serial.Serial(port, baud, timeout=_READ, write_timeout=_ANSWER, exclusive=True)
    except (failure, OSError, ValueError) as error:
        number = getattr(error, "errno", None)
        why = os.strerror(number) if number else str(error)
        what, remedy = f"cannot open the port: {why}", "Plug the board in, and name its port"
        try:
            from serial.tools.list_ports import comports

            if found := ", ".join(sorted(one.device for one in comports())):
                remedy += f"; there are {found}"
        except (ImportError, OSError):
            pass
        raise InputError(what, field="port", value=port, remedy=remedy) from error
    return line, failure
