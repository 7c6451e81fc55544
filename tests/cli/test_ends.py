"""How a process of the command line ends: killed, terminated, with no room, with odd files."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from swimbladder.cli import main
from swimbladder.io import files
from swimbladder.io.presets import preset_text

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals, pipes and devices are POSIX's")

MISSION = """schema_version = 1
cycles = 5000
[[phases]]
kind = "descend"
depth = "200 m"
[[phases]]
kind = "surface"
duration = "10 min"
"""
SHORT = ["simulate", "feup-em", "--duration", "30"]


def command(*words):
    return [sys.executable, "-m", "swimbladder", *map(str, words)]


def flying(folder, out, parts):
    """A mission in a process of its own that has flown so many parts of its way.

    It hears Ctrl-C also where the tests do not, as in the background of a shell's script.
    """
    task = folder / "task.toml"
    task.write_text(MISSION)
    kept = folder / f".{out}-unfinished"
    process = subprocess.Popen(
        command("mission", "example-float", task, "--out", folder / out, "--json"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    while process.poll() is None and len(list(kept.rglob("part-*.npz"))) < parts:
        time.sleep(0.002)
    return process, kept


def test_a_process_that_is_terminated_ends_as_an_interrupted_one_and_goes_on_where_it_was(tmp_path):
    process, kept = flying(tmp_path, "flown", 3)
    process.send_signal(signal.SIGTERM)
    said, complaint = process.communicate(timeout=60)
    assert process.returncode == 143
    assert json.loads(said) == {
        "error": "terminated",
        "exit_code": 143,
        "file": None,
        "field": None,
    }
    assert "Traceback" not in complaint
    assert complaint.splitlines()[-1] == "terminated"
    assert "goes on there" in complaint
    assert sorted(p.name for p in tmp_path.iterdir()) == [kept.name, "task.toml"]
    parts = {path.name: path.read_bytes() for path in kept.rglob("part-*.npz")}
    assert len(parts) >= 3
    process, _ = flying(tmp_path, "flown", len(parts) + 3)
    for name, content in parts.items():
        assert next(kept.rglob(name)).read_bytes() == content
    process.send_signal(signal.SIGINT)
    said, complaint = process.communicate(timeout=60)
    assert process.returncode == 130, said + complaint


def test_stdout_that_takes_no_more_is_one_line(tmp_path):
    for words in (["vehicle", "list"], ["--help"], [*SHORT, "--out", tmp_path, "--json"]):
        with Path("/dev/full").open("w") as full:
            done = subprocess.run(
                command(*words), stdout=full, stderr=subprocess.PIPE, text=True, check=False
            )
        assert done.returncode == 2
        lines = [line for line in done.stderr.splitlines() if not line.startswith("compiling")]
        assert len(lines) == 1
        assert lines[0].startswith("error: stdout: cannot write the answer: No space left")


@pytest.mark.parametrize(
    "words",
    [
        ["simulate", "x" * 300],
        ["simulate", "x" * 300 + ".toml"],
        ["simulate", "feup-em", "x" * 300],
        ["mission", "example-float", "x" * 300],
        ["compare", "x" * 300, "--vehicle", "feup-em"],
        ["simulate", "feup-em", "--cast", "x" * 300],
        ["simulate", "feup-em", "--out", "x" * 300],
        ["ballast", "example-float", "--out", "x" * 300],
        ["analyse", "feup-em", "--out", "x" * 300],
        ["vehicle", "show", "x" * 300],
        ["vehicle", "new", "x" * 300 + ".toml"],
        ["vehicle", "new", "x" * 300, "--force"],
        ["simulate", "feup-em", "--cast", "x.csv", "--cast-format", "x" * 300],
    ],
)
def test_a_name_longer_than_any_file_s_is_one_line(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def endless(folder):
    """A pipe into which lines are written as long as it is read, and who writes."""
    pipe = folder / "endless"
    os.mkfifo(pipe)
    writer = subprocess.Popen(["sh", "-c", f"exec yes > {pipe}"], stderr=subprocess.DEVNULL)
    return pipe, writer


@pytest.mark.parametrize(
    ("words", "limit"),
    [
        (["simulate", "FILE"], "16 MiB"),
        (["simulate", "feup-em", "FILE"], "16 MiB"),
        (["mission", "example-float", "FILE"], "16 MiB"),
        (["compare", "FILE", "--vehicle", "feup-em"], "256 MiB"),
        (["simulate", "feup-em", "--cast", "FILE"], "256 MiB"),
    ],
)
@pytest.mark.parametrize(
    "kind", ["/dev/zero", "sparse", pytest.param("pipe", marks=pytest.mark.prove)]
)
def test_what_has_no_end_is_read_to_a_limit(words, limit, kind, tmp_path, capsys):
    writer, path = None, Path(kind)
    if kind == "pipe":
        path, writer = endless(tmp_path)
    elif kind == "sparse":
        path = tmp_path / "large.toml"
        with path.open("wb") as file:
            file.truncate(10 * 10**9)
    words = [str(path) if word == "FILE" else word for word in words]
    assert main([*words, "--out", str(tmp_path / "out")]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"larger than {limit}" in said
    if writer is not None:
        assert writer.wait(timeout=10) != 0  # its pipe was closed


def piped(folder, name, text):
    """A pipe that gives a text once."""
    pipe = folder / name
    os.mkfifo(pipe)
    (folder / f"{name}.txt").write_text(text)
    writer = subprocess.Popen(["sh", "-c", f"cat {folder / name}.txt > {pipe}"])
    return pipe, writer


def test_a_pipe_is_as_good_as_a_file(tmp_path, capsys):
    pipe, writer = piped(tmp_path, "vehicle", preset_text("feup-em"))
    words = ["--duration", "30", "--out", str(tmp_path / "out"), "--json"]
    assert main(["simulate", str(pipe), *words]) == 0
    assert writer.wait(timeout=10) == 0
    by_pipe = json.loads(capsys.readouterr().out)
    assert main(["simulate", "feup-em", *words]) == 0
    assert json.loads(capsys.readouterr().out) == by_pipe
    # a second command reads what is written then
    (tmp_path / "vehicle.txt").write_text("schema_version = 0")
    writer = subprocess.Popen(["sh", "-c", f"cat {pipe}.txt > {pipe}"])
    assert main(["simulate", str(pipe), *words]) == 2
    assert writer.wait(timeout=10) == 0


def test_an_error_in_a_pipe_has_its_line(tmp_path, capsys):
    text = MISSION.replace('"200 m"', '"-200 m"')
    pipe, writer = piped(tmp_path, "mission", text)
    assert main(["mission", "example-float", str(pipe)]) == 2
    assert writer.wait(timeout=10) == 0
    assert "line 5, phases[0].depth" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("words", [["vehicle", "new", "p", "--force"], [*SHORT, "--out", "p"]])
def test_a_pipe_is_not_written_over(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    os.mkfifo("p")
    assert main(words) == 2
    said = [line for line in capsys.readouterr().err.splitlines() if "compiling" not in line]
    assert len(said) == 1
    assert Path("p").is_fifo()
    assert not Path("p").is_file()
    assert [p.name for p in tmp_path.iterdir()] == ["p"]


@pytest.mark.parametrize(
    "words",
    [
        ["simulate", "./p"],
        ["simulate", "feup-em", "p"],
        ["simulate", "feup-em", "--cast", "p"],
        ["simulate", "feup-em", "--cast", "p", "--cast-format", "./p"],
        ["mission", "example-float", "p"],
        ["identify", "p", "--vehicle", "feup-em"],
        ["compare", "p", "--vehicle", "feup-em"],
    ],
)
def test_a_pipe_that_nobody_writes_into_is_refused(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(files, "_PATIENCE", 0.2)
    os.mkfifo("p")
    assert main(words) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "p, file: nothing was written into this pipe within 0.2 s" in said
    assert [p.name for p in tmp_path.iterdir()] == ["p"]
