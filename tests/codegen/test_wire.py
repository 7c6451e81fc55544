"""The frames of the serial line, byte by byte as `templates/hil.h.j2` says what one is.

The board is a peer written here, the clock one that only waiting moves.
"""

import math
import struct
from types import SimpleNamespace

import numpy as np
import pytest

from swimbladder.codegen import wire
from swimbladder.codegen.wire import FACTS, Said, Wire
from swimbladder.control.supervisor import Watched
from swimbladder.errors import InputError, NoAnswerError

DIGEST = bytes(range(8))
SEEN = Watched(3.5, 0.25, -2e-5, 11.5, True, 7, 0)


def crc(body):
    """CRC-16 of polynomial 0x1021 from 0xffff, bit by bit."""
    rest = 0xFFFF
    for byte in body:
        rest ^= byte << 8
        for _ in range(8):
            rest = (rest << 1) ^ (0x1021 if rest & 0x8000 else 0)
            rest &= 0xFFFF
    return rest


def frame(kind, sequence, payload=b""):
    body = bytes([len(payload), ord(kind), sequence]) + payload
    return b"\x7e" + body + struct.pack("<H", crc(body))


class Peer:
    """A serial port with a board at its end, that answers as `does` says: (kind, n) -> bytes."""

    def __init__(self, does=None):
        self.now, self.heard, self.waits, self.closed = 0.0, [], bytearray(), False
        self.does, self.asked = does or (lambda *given: given[-1]), 0
        self.answers = {
            "H": bytes([2]) + DIGEST,
            "B": b"",
            "A": b"",
            "S": struct.pack("<IH", 512, 3),
            "T": struct.pack("<2f2I2H4B", 1.5, 40.0, 2**32 - 5, 250, 6, 2, 3, 0, 0, 1),
        }

    @property
    def in_waiting(self):
        return len(self.waits)

    def write(self, sent):
        assert sent[:1] == b"\x7e"
        length, kind, sequence = sent[1], chr(sent[2]), sent[3]
        payload = sent[4 : 4 + length]
        assert sent == frame(kind, sequence, payload)
        self.heard.append((kind, sequence, payload))
        answer = frame(kind, sequence, self.answers[kind])
        self.waits += self.does(kind, self.asked, answer)
        self.asked += 1

    def read(self, most):
        assert most >= 1
        got = bytes(self.waits[:most])
        del self.waits[:most]
        if not got:
            self.now += 0.05  # what one read waits for
        return got

    def close(self):
        self.closed = True


@pytest.fixture
def opened(monkeypatch):
    """Return what opens a wire to a peer."""

    def at(peer):
        monkeypatch.setattr(wire, "_opened", lambda *_: (peer, OSError))
        monkeypatch.setattr(wire, "time", SimpleNamespace(monotonic=lambda: peer.now))
        return Wire("port", DIGEST)

    return at


def test_what_the_other_end_is_told_of_a_frame():
    """Six bytes around the payload, of which the largest is a tick's: out 25 bytes, in 28."""
    tick = struct.calcsize("<4fIfB"), struct.calcsize("<2f2I2H4B")
    assert (FACTS["around"], FACTS["start"]) == (len(frame("H", 0)), "0x7e")
    assert (FACTS["tick_bytes"], FACTS["payload"]) == (tick[0], max(tick))
    assert (FACTS["begin_bytes"], FACTS["version"], FACTS["baud"]) == (1, 2, 115_200)
    assert [FACTS[n] for n in ("hello", "begin", "arm", "tick", "status", "corrupt")] == [*"HBATSN"]


def test_each_call_is_a_frame_and_its_answer(opened):
    peer = Peer()
    with opened(peer) as board:
        board.begin(after_reset=False)
        board.begin(after_reset=True)
        board.arm()
        assert board.status() == (512, 3)
        peer.answers["S"] = struct.pack("<IH", 2**32 - 1, 0)
        assert board.status() == (None, 0)
        said, began, took = board.tick(SEEN, -4.5)
    assert peer.closed
    assert said == Said(True, 1.5, 40.0, 6, 2, 3, False, False)
    assert (began, took) == (2**32 - 5, 250)
    assert [heard[:2] for heard in peer.heard] == [*zip("HBBASST", range(7), strict=True)]
    assert [heard[2] for heard in peer.heard[:4]] == [b"", b"\0", b"\1", b""]
    sent = struct.unpack("<4fIfB", peer.heard[-1][2])
    assert sent == pytest.approx((3.5, 0.25, np.float32(-2e-5), 11.5, 7, -4.5, 1))
    assert board.frames == {"sent": 7, "lost": 0, "corrupt": 0}
    assert peer.now == 0.0


@pytest.mark.parametrize("name", ["release", "wide", "armed"])
def test_each_truth_has_a_byte_of_its_own(opened, name):
    peer = Peer()
    bits = [name == one for one in ("release", "wide", "armed")]
    peer.answers["T"] = struct.pack("<2f2I2H4B", math.nan, 0.0, 0, 0, 0, 0, 0, *bits)
    with opened(peer) as board:
        said, _, _ = board.tick(SEEN._replace(leak=False), 0.0)
    assert [said.release, said.wide, said.armed] == bits
    assert math.isnan(said.command)
    assert peer.heard[-1][2][-1] == 0  # no leak


def test_frames_are_numbered_from_1_to_255_and_again(opened):
    """0 is the greeting's."""
    peer = Peer()
    with opened(peer) as board:
        for _ in range(300):
            board.arm()
    numbers = [sequence for kind, sequence, _ in peer.heard if kind == "A"]
    assert numbers == [*range(1, 256), *range(1, 46)]


def on_arm(n, instead):
    """Answer the n-th frame that arms otherwise."""
    count = iter(range(10**6))

    def does(kind, _, answer):
        if kind != "A" or next(count) != n:
            return answer
        return instead(answer)

    return does


def garbled(answer):
    return answer[:-1] + bytes([answer[-1] ^ 1])


@pytest.mark.parametrize(
    ("instead", "counted", "wait"),
    [
        (lambda _: b"", {"lost": 1, "corrupt": 0}, 1.0),  # no answer in a second
        (garbled, {"lost": 1, "corrupt": 1}, 0.0),  # asked again at once
        (lambda answer: answer[:4], {"lost": 1, "corrupt": 1}, 1.0),  # the rest of it never comes
        (lambda answer: b"\x01\x02\x03" + answer, {"lost": 0, "corrupt": 0}, 0.0),
        (lambda answer: frame("A", 200) + answer, {"lost": 0, "corrupt": 0}, 0.0),  # an older one
        (lambda answer: frame("S", 2) + answer, {"lost": 0, "corrupt": 0}, 0.0),  # another kind
        (lambda answer: answer + answer, {"lost": 0, "corrupt": 0}, 0.0),
        (lambda _: frame("N", 0), {"lost": 1, "corrupt": 0}, 0.0),  # ours was not whole
        # a start byte that begins no frame, and says that none is to come
        (lambda answer: b"\x7e\x00\x01\x02\x03\x04" + answer, {"lost": 0, "corrupt": 1}, 0.0),
    ],
)
def test_what_is_lost_or_garbled_is_asked_for_again_and_counted(opened, instead, counted, wait):
    peer = Peer(on_arm(1, instead))
    with opened(peer) as board:
        for _ in range(3):
            board.arm()
    again = [sequence for kind, sequence, _ in peer.heard if kind == "A"]
    assert again == ([1, 2, 2, 3] if counted["lost"] else [1, 2, 3])
    assert board.frames == counted | {"sent": 1 + len(again)}
    assert wait <= peer.now <= wait + 0.11


def test_a_frame_may_come_in_pieces_and_two_at_once(opened):
    peer = Peer()
    with opened(peer) as board:
        whole = frame("A", 1) + frame("S", 2, struct.pack("<IH", 9, 1))
        pieces = [whole[:3], whole[3:4], b"", whole[4:9], whole[9:]]
        come = iter(pieces)
        peer.write = lambda sent: peer.heard.append(sent)
        peer.read = lambda _: next(come)
        board.arm()
        assert board.status() == (9, 1)
    assert board.frames == {"sent": 3, "lost": 0, "corrupt": 0}


def test_five_tries_and_no_more(opened):
    peer = Peer(lambda kind, _, answer: answer if kind == "H" else b"")
    with opened(peer) as board, pytest.raises(NoAnswerError, match="no whole answer in 5 tries"):
        board.arm()
    assert board.frames == {"sent": 6, "lost": 5, "corrupt": 0}
    assert 5.0 <= peer.now < 5.3  # a second each
    peer = Peer(lambda kind, n, answer: answer if kind == "H" or n == 5 else b"")
    with opened(peer) as board:
        board.arm()
    assert board.frames["lost"] == 4


def test_a_board_is_greeted_every_half_second_for_five(opened):
    """Opening the port resets it: it answers once it has begun."""
    late = Peer(lambda _, n, answer: answer if n == 4 else b"")
    opened(late)
    assert late.asked == 5
    assert late.now == pytest.approx(4 * 0.5, abs=0.45)
    silent = Peer(lambda *_: b"")
    with pytest.raises(InputError, match="no board answers within 5 s"):
        opened(silent)
    assert silent.closed
    assert [heard[:2] for heard in silent.heard] == [("H", 0)] * len(silent.heard)
    assert 9 <= len(silent.heard) <= 10
    assert silent.now == pytest.approx(5.0, abs=0.55)


def test_garbage_before_the_greeting_is_waited_out(opened):
    """What a boot loader says; nor does a board that heard half a greeting end it."""
    for noise in (b"\x7e\x00boot\r\n", garbled(frame("H", 0)), frame("N", 0)):
        peer = Peer(lambda _, n, answer, noise=noise: noise if n == 0 else answer)
        with opened(peer):
            assert peer.asked == 2
            assert peer.now == pytest.approx(0.5, abs=0.11)
    babbles = Peer(lambda *_: b"\x7e\x00\x01\x02\x03\x04")
    with pytest.raises(InputError, match="no frame of this protocol"):
        opened(babbles)


@pytest.mark.parametrize(
    ("payload", "said"),
    [
        (bytes([3]) + DIGEST, "speaks version 3 of the protocol, and this program 2"),
        (bytes([2]) + DIGEST[::-1], "has the C 0706050403020100, and this vehicle's is 0001"),
    ],
)
def test_another_board_is_refused(opened, payload, said):
    peer = Peer()
    peer.answers["H"] = payload
    with pytest.raises(InputError, match=said):
        opened(peer)
    assert peer.closed


def test_a_port_that_has_gone_is_said(opened):
    peer = Peer()
    with opened(peer) as board:

        def gone(_):
            raise OSError

        peer.write = gone
        with pytest.raises(NoAnswerError, match="the port has gone"):
            board.arm()
