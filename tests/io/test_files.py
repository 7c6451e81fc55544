"""Files appear whole or not at all."""

import os
import stat
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from swimbladder.errors import InputError
from swimbladder.io import files
from swimbladder.io.files import (
    check_place,
    make_folder,
    pipes_kept,
    publish,
    read_at_most,
    temporary_folder,
    write_atomically,
    write_through,
)


def test_text_and_bytes_are_written_and_nothing_else_is_left(tmp_path):
    write_atomically(tmp_path / "a.txt", "ψ = 4\n")
    write_atomically(tmp_path / "b.bin", b"\x00\xff")
    assert (tmp_path / "a.txt").read_bytes() == "ψ = 4\n".encode()
    assert (tmp_path / "b.bin").read_bytes() == b"\x00\xff"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.txt", "b.bin"]


def test_a_writer_that_fails_leaves_the_old_file_and_no_other(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def fail(temporary):
        temporary.write_text("half")
        raise RuntimeError("no")

    with pytest.raises(RuntimeError, match="no"):
        write_through(path, fail)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_writer_sees_the_suffix_it_was_asked_for(tmp_path):
    seen = []
    write_through(tmp_path / "a.png", lambda p: (seen.append(p), p.write_bytes(b"x")))
    assert seen[0].suffix == ".png"
    assert seen[0].parent == tmp_path


@pytest.mark.skipif(os.name != "posix", reason="permissions are POSIX's")
def test_a_file_is_as_readable_as_any_other(tmp_path):
    (tmp_path / "plain").write_text("x")
    write_atomically(tmp_path / "ours", "x")
    modes = [stat.S_IMODE((tmp_path / n).stat().st_mode) for n in ("plain", "ours")]
    assert modes[0] == modes[1]


def test_a_place_that_cannot_be_written_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match="cannot write the file") as caught:
        write_atomically(tmp_path / "none" / "a.txt", "x")
    assert caught.value.remedy
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="cannot make the folder"):
        make_folder(tmp_path / "file" / "folder")
    (tmp_path / "taken").mkdir()
    with pytest.raises(InputError, match="cannot write the file"):
        write_atomically(tmp_path / "taken", "x")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "taken"]


@pytest.mark.skipif(os.name != "posix", reason="pipes with names are POSIX's")
def test_no_file_takes_the_place_of_a_pipe_or_a_link_to_one(tmp_path):
    pipe, link = tmp_path / "b.txt", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    for path in (pipe, link):
        with pytest.raises(InputError, match="there is a device, a pipe or a socket") as caught:
            write_atomically(path, "x")
        assert caught.value.exit_code == 2

    def write(folder):
        for name in ("a.txt", "b.txt"):
            (folder / name).write_text("x")

    with pytest.raises(InputError, match="there is a device, a pipe or a socket"):
        publish(tmp_path, write)
    assert pipe.is_fifo()
    assert link.is_symlink()
    assert sorted(tmp_path.iterdir()) == [pipe, link]


def test_folders_are_made_with_those_above(tmp_path):
    assert make_folder(tmp_path / "a" / "b").is_dir()
    assert make_folder(tmp_path / "a" / "b").is_dir()


def dead_process():
    """The number of a process that has ended."""
    return subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()


@pytest.mark.skipif(os.name != "posix", reason="elsewhere a process cannot be asked for")
def test_what_a_killed_run_left_is_removed_and_what_is_being_written_stays(tmp_path):
    mine = temporary_folder(tmp_path)
    name = mine.name.replace(f"-{os.getpid()}-", f"-{dead_process()}-")
    left = [tmp_path / name, tmp_path / "out" / f"{name}.csv"]
    (left[0] / "figures").mkdir(parents=True)
    left[1].parent.mkdir()
    left[1].write_text("half")
    theirs = tmp_path / ".swimbladder-00000000-1-aaaaaaaa"  # of another machine
    theirs.mkdir()
    other = tmp_path / ".out-settings"
    other.mkdir()
    check_place(tmp_path / "out")
    publish(tmp_path / "out", lambda folder: (folder / "a.txt").write_text("a"))
    assert sorted(tmp_path.iterdir()) == sorted([mine, theirs, other, tmp_path / "out"])
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["a.txt"]
    os.utime(theirs, (0.0, 0.0))
    make_folder(tmp_path)
    assert not theirs.exists()
    assert mine.exists()


def test_a_file_is_read_to_a_limit(tmp_path):
    (tmp_path / "a").write_bytes(b"x" * 100)
    assert read_at_most(tmp_path / "a", 100) == b"x" * 100
    assert read_at_most(tmp_path / "a", 10) == b"x" * 11
    if os.name == "posix":
        assert read_at_most(Path("/dev/zero"), 1000) == bytes(1001)
        assert read_at_most(Path("/dev/null"), 1000) == b""


@pytest.mark.skipif(os.name != "posix", reason="pipes with names are POSIX's")
def test_a_pipe_gives_its_content_again_within_a_block_only(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)

    def written(content, path=pipe):
        writer = threading.Thread(target=path.write_bytes, args=(content,), daemon=True)
        writer.start()
        return writer

    with pipes_kept():
        writer = written(b"first")
        assert read_at_most(pipe, 100) == b"first"
        writer.join()
        with pipes_kept():
            assert read_at_most(pipe, 100) == b"first"
        assert read_at_most(pipe, 100) == b"first"
    # as in a notebook: what another writer writes next
    for content in (b"second", b"third"):
        writer = written(content)
        assert read_at_most(pipe, 100) == content
        writer.join()
    with pipes_kept():
        writer = written(b"fourth")
        assert read_at_most(pipe, 100) == b"fourth"
        writer.join()


@pytest.mark.skipif(os.name != "posix", reason="pipes with names are POSIX's")
def test_a_pipe_is_waited_for_until_somebody_has_come_to_write(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_PATIENCE", 0.3)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    begin = time.monotonic()
    for _ in range(2):
        with pipes_kept(), pytest.raises(TimeoutError, match="nothing was written into this pipe"):
            read_at_most(pipe, 100)
    assert 0.6 <= time.monotonic() - begin < 5.0
    # who has come may take longer than that to write
    writer = subprocess.Popen(["sh", "-c", f"(sleep 1; printf late; sleep 0.5; yes) > {pipe}"])
    assert read_at_most(pipe, 9) == b"latey\ny\ny\n"
    assert writer.wait(timeout=10) != 0


def test_a_name_that_no_folder_can_have_is_refused_before_anything_is_done(tmp_path):
    for name in ("x" * 244, "ψ" * 130, "x" * 300):
        with pytest.raises(InputError, match="longer than 243 bytes") as caught:
            check_place(tmp_path / name)
        assert caught.value.field == "out"
    check_place(tmp_path / ("x" * 243))


@pytest.mark.parametrize("name", ["tuned.toml", "depth.csv", "log.json"])
def test_the_name_of_a_file_is_no_folder_to_write_into(tmp_path, name):
    """A vehicle was then in tuned.toml/vehicle.toml, and tuned.toml no vehicle."""
    with pytest.raises(InputError, match="ends a file's name") as caught:
        check_place(tmp_path / name)
    assert caught.value.field == "out"
    assert not list(tmp_path.iterdir())
    (tmp_path / name).mkdir()  # it was so before
    check_place(tmp_path / name)
    check_place(tmp_path / "run.2026")
