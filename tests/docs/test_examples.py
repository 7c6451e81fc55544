"""Every example in README.md and docs/ runs as it stands, and prints what stands beside it.

The examples of a page run in order, in a folder of their own that holds a `my-float.toml`:

- `python` blocks share one namespace; a `text` block right below is what they print;
- `console` blocks: ``$ command``, then what it prints, stderr included; ``...`` is anything;
- `sh` blocks: commands that succeed;
- a `toml` block with a file's name beside `toml` is written to that file.

``<!-- exit 2 -->`` above a block: its last command ends so; ``<!-- not run: why -->``: it is not;
``<!-- as in docs/PAGE -->``: that page runs it, and prints what stands here too; ``<!-- long -->``:
`make prove` runs it, and other blocks use the same commands in every run.

The README's commands are processes of their own; those of the other pages are forks of one process
that has imported everything (`warm.py`).
"""

import contextlib
import io
import json
import os
import re
import socket
import subprocess
import sys
import threading
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.docs.warm import CRASHED, DIED, client

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
RUN = ("python", "console", "sh", "toml", "text")
_BLOCK = re.compile(
    r"(?:<!-- (?P<mark>exit \d+|long|not run: [^>]+|as in [^>]+) -->\n)?"
    r"^```(?P<language>\w*)(?: (?P<name>\S+))?\n(?P<body>.*?)^```$",
    re.DOTALL | re.MULTILINE,
)


class Block(NamedTuple):
    line: int
    language: str
    name: str
    body: str
    mark: str
    follows: str  # language of the block right above, "" where text stands between
    at: int = 0  # where the body begins in the page
    long: bool = False  # marked so, or below a block of Python that is

    @property
    def exit_code(self) -> int:
        return int(self.mark.removeprefix("exit ")) if self.mark.startswith("exit") else 0


def blocks_of(page: Path, mark: str = "") -> list[Block]:
    """Return the fenced blocks of a page that are run here, or those whose mark begins so."""
    text = page.read_text(encoding="utf-8")
    found, above, long = [], (0, ""), False
    for match in _BLOCK.finditer(text):
        follows = above[1] if not text[above[0] : match.start()].strip() else ""
        above = (match.end(), match["language"])
        long = match["mark"] == "long" or (
            long and (match["language"], follows) == ("text", "python")
        )
        found.append(
            Block(
                line=text[: match.start()].count("\n") + 1,
                language=match["language"],
                name=match["name"] or "",
                body=match["body"],
                mark=match["mark"] or "",
                follows=follows,
                at=match.start("body"),
                long=long,
            )
        )
    if mark:
        return [block for block in found if block.mark.startswith(mark)]
    return [block for block in found if not block.mark.startswith(("not run", "as in"))]


def commands_of(block: Block) -> list[tuple[str, str]]:
    """Return (command, what it prints) of a `console` block."""
    parts = re.split(r"^\$ ", block.body, flags=re.MULTILINE)
    assert not parts[0].strip(), f"line {block.line}: a console block begins with a command"
    pairs = []
    for part in parts[1:]:
        command, _, printed = part.partition("\n")
        while command.endswith("\\"):
            more, _, printed = printed.partition("\n")
            command = command[:-1] + more.removeprefix("> ").strip()
        pairs.append((command, printed))
    return pairs


def same(printed: str, promised: str) -> bool:
    """Say whether `printed` is what was promised; blanks at the ends of lines do not count."""

    def trimmed(text: str) -> str:
        return "\n".join(line.rstrip() for line in text.strip("\n").splitlines())

    pattern = re.escape(trimmed(promised)).replace(re.escape("..."), ".*")
    return re.fullmatch(pattern, trimmed(printed), re.DOTALL) is not None


def surroundings(*programs: Path) -> dict[str, str]:
    """Return the environment of a command; `programs`: folders that come first on the path."""
    path = os.pathsep.join([*map(str, programs), str(Path(sys.executable).parent)])
    return {
        **os.environ,
        "PATH": path + os.pathsep + os.environ["PATH"],
        "COLUMNS": "100",
        "NO_COLOR": "1",
        "MPLBACKEND": "Agg",
    }


def shell(command: str, folder: Path, *programs: Path) -> tuple[int, str]:
    """Run a command with the installed command line first on the path, or what is in `programs`."""
    done = subprocess.run(
        ["bash", "-ec", command],
        cwd=folder,
        env=surroundings(*programs),
        text=True,
        encoding="utf-8",
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=300,
        check=False,
    )
    # the first command that needs a kernel says that it compiles
    lines = [line for line in done.stdout.splitlines() if not line.startswith("compiling the ")]
    return done.returncode, "\n".join(lines)


@contextlib.contextmanager
def warm_programs(folder: Path) -> Iterator[Path]:
    """Give a folder with a `swimbladder` that is a fork of a process which has imported everything.

    Beside Linux it is the installed one: slower, and sure.
    """
    if sys.platform != "linux":
        yield Path(sys.executable).parent
        return
    program, address = folder / "swimbladder", str(folder / "socket")
    program.write_text(client(address), encoding="utf-8")
    program.chmod(0o755)
    with subprocess.Popen(
        [sys.executable, "-m", "tests.docs.warm", address],
        cwd=ROOT,
        env=surroundings(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as server:
        assert server.stdout.readline() == "ready\n"
        yield folder
        server.stdin.close()


class Ran(NamedTuple):
    """An example that was run: a command, or a block of Python with the text block below it."""

    block: Block  # what stands beside it
    number: int  # of the command in its block, from 0
    command: str
    code: int
    expected: int  # exit code
    printed: str
    promised: str | None  # None: it may print what it likes


def run_page(page: Path, folder: Path, *programs: Path, long: bool = True) -> Iterator[Ran]:
    """Run the examples of a page one after the other in `folder`, the current one.

    long: those that are marked so too.
    """
    blocks = [block for block in blocks_of(page) if block.language in RUN]
    blocks = blocks if long else [block for block in blocks if not block.long]
    if any("my-float.toml" in block.body for block in blocks):
        assert shell("swimbladder vehicle new my-float.toml", folder, *programs)[0] == 0
    names: dict[str, object] = {"__name__": "__main__"}
    printed = ""
    for block in blocks:
        if block.language == "python":
            printed = _python(block, names, f"{page.name}, line {block.line}")
        elif block.language == "text" and block.follows == "python":
            yield Ran(block, 0, "it", 0, 0, printed, block.body)
        elif block.language == "toml":
            _toml(block, folder, f"{page.name}, line {block.line}")
        elif block.language == "sh":
            code, output = shell(block.body, folder, *programs)
            yield Ran(block, 0, block.body, code, block.exit_code, output, None)
        elif block.language == "console":
            commands = commands_of(block)
            for number, (command, promised) in enumerate(commands):
                code, output = shell(command, folder, *programs)
                expected = block.exit_code if number == len(commands) - 1 else 0
                yield Ran(block, number, command, code, expected, output, promised)


def _long(page: Path) -> list[Block]:
    return [block for block in blocks_of(page) if block.long]


def needs_programs(page: Path) -> bool:
    """Say whether a page has commands that a fork may run: the README's are run as installed."""
    commands = [b.body for b in blocks_of(page) if b.language in ("sh", "console")]
    return page != PAGES[0] and any("swimbladder" in body for body in commands)


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    with warm_programs(tmp_path_factory.mktemp("warm")) as folder:
        yield folder


NAMED = {"argnames": "page", "ids": lambda page: str(page.relative_to(ROOT))}


@pytest.fixture
def run(tmp_path, monkeypatch, request):
    """Run the examples of a page in an empty folder, and compare what they print."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path.copy())  # an example may add to it

    def run(page, *, long):
        programs = [request.getfixturevalue("warm")] if needs_programs(page) else []
        for ran in run_page(page, tmp_path, *programs, long=long):
            place = f"{page.relative_to(ROOT)}, line {ran.block.line}: {ran.command}"
            assert ran.code == ran.expected, f"{place}: exit code {ran.code}\n{ran.printed}"
            if ran.promised is not None:
                remedy = "(scripts/refresh_docs.py writes what it prints)"
                assert same(ran.printed, ran.promised), f"{place} prints {remedy}\n{ran.printed}"

    return run


@pytest.mark.slow
@pytest.mark.parametrize(argvalues=PAGES, **NAMED)
def test_the_examples_of_a_page_run_and_print_what_stands_there(page, run):
    run(page, long=False)


@pytest.mark.prove
@pytest.mark.parametrize(argvalues=[page for page in PAGES if _long(page)], **NAMED)
def test_the_long_examples_of_a_page_too(page, run):
    run(page, long=True)


def test_what_a_long_example_uses_others_use_in_every_run():
    """Blocks of the pages that are not long, or examples of the gallery (`test_site.py`)."""
    calls = re.compile(r"swimbladder [a-z][a-z-]*|sb\.[a-z_]+(?=\()")
    used = {long: set() for long in (False, True)}
    for block in (block for page in PAGES for block in blocks_of(page) if block.language in RUN):
        used[block.long] |= set(calls.findall(block.body))
    for example in (ROOT / "docs" / "gallery").glob("*/plot_*.py"):
        used[False] |= set(calls.findall(example.read_text(encoding="utf-8")))
    assert "swimbladder campaign" in used[True]
    assert used[True] <= used[False]


def _python(block: Block, names: dict[str, object], place: str) -> str:
    printed = io.StringIO()
    code = compile("\n" * block.line + block.body, place, "exec")
    with contextlib.redirect_stdout(printed):
        exec(code, names)
    return printed.getvalue()


def _toml(block: Block, folder: Path, place: str) -> None:
    try:
        tomllib.loads(block.body)
    except tomllib.TOMLDecodeError as error:
        pytest.fail(f"{place}: not TOML: {error}")
    if block.name:
        (folder / block.name).write_text(block.body, encoding="utf-8")


def test_a_block_as_on_another_page_is_run_there_and_prints_the_same():
    found = [block for page in PAGES for block in blocks_of(page, "as in ")]
    assert found
    for block in found:
        there = [b for b in blocks_of(ROOT / block.mark.split()[-1]) if b.language == "console"]
        prints = dict(pair for other in there for pair in commands_of(other))
        for command, printed in commands_of(block):
            assert command in prints, f"{block.mark}: {command}"
            lines = [line for line in printed.splitlines() if line != "..."]
            assert set(lines) <= set(prints[command].splitlines()), command


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.M)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith(("https://", "mailto:")):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path) if path else page
        assert file.exists(), f"{page.relative_to(ROOT)} links to {target}"
        if anchor:
            headings = re.findall(r"^#+ (.+)$", file.read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor in {_anchor(heading) for heading in headings}, f"{target} in {page.name}"


@pytest.mark.skipif(sys.platform != "linux", reason="the fork helper is for Linux")
def test_a_fork_that_is_gone_is_no_answer_of_a_command(tmp_path):
    """Exit code 1 says no; what died, or never ran, has a code of its own and says so."""
    program = tmp_path / "swimbladder"
    program.write_text(client(str(tmp_path / "socket")), encoding="utf-8")
    program.chmod(0o755)
    code, said = shell("swimbladder vehicle list", tmp_path, tmp_path)
    assert (code, "No such file" in said, "or its fork, died" in said) == (DIED, True, True)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(str(tmp_path / "socket"))
        listener.listen()
        gone = threading.Thread(target=lambda: listener.accept()[0].close())
        gone.start()
        code, said = shell("swimbladder vehicle list", tmp_path, tmp_path)
        gone.join()
    assert code == DIED
    assert "or its fork, died" in said


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the fork helper is for Linux")
def test_a_traceback_in_a_fork_is_no_answer_of_a_command(warm, tmp_path):
    assert shell("swimbladder vehicle show no-such", tmp_path, warm)[0] == 2
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as server:
        server.connect(str(warm / "socket"))
        with (tmp_path / "said").open("w") as file:
            call = json.dumps([["vehicle", "list"], str(tmp_path / "gone"), {}]).encode()
            socket.send_fds(server, [call], [file.fileno()] * 3)
            assert server.recv(1) == bytes([CRASHED])
    assert "FileNotFoundError" in (tmp_path / "said").read_text()


@pytest.mark.slow
def test_the_picture_of_the_readme_is_what_the_command_below_it_draws(tmp_path):
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    picture, command = re.search(r"!\[[^]]+\]\((\S+)\)\n\n`([^`]+)` drew this", readme).groups()
    code, printed = shell(command, tmp_path)
    assert code == 0, printed

    from matplotlib.image import imread

    drawn = imread(tmp_path / "swimbladder-simulate" / "trajectory.png")
    shown = imread(ROOT / picture)
    assert drawn.shape == shown.shape
    assert float(((drawn - shown) ** 2).mean()) < 1e-4  # fonts may differ by a hair


def _anchor(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def test_every_page_can_be_reached_from_the_map():
    known = {ROOT / "docs" / "README.md"}
    text = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    known |= {(ROOT / "docs" / target).resolve() for target in re.findall(r"\]\(([^)#\s]+)", text)}
    assert {page for page in PAGES[1:] if page.resolve() not in known} == set()


@pytest.mark.parametrize(
    ("printed", "promised", "answer"),
    [
        ("a  \nb\n", "a\nb", True),
        ("a\nb\nc\n", "a\n...\nc", True),
        ("took 1.23 s", "took ... s", True),
        ("a\nb", "a", False),
        ("", "a", False),
        ("a.b", "a?b", False),
    ],
)
def test_the_comparison_itself(printed, promised, answer):
    assert same(printed, promised) is answer


def test_the_extraction_itself(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "```python\nprint(1)\n```\n\n```text\n1\n```\n\nwords\n\n<!-- exit 2 -->\n"
        "```console\n$ one \\\n>   two\nout\n$ three\n```\n\n<!-- not run: why -->\n```sh\nx\n```\n"
        "```toml file.toml\na = 1\n```\n\n<!-- as in docs/x.md -->\n```console\n$ four\n```\n",
        encoding="utf-8",
    )
    python, text, console, toml = blocks_of(page)
    assert (python.line, python.body, text.follows) == (1, "print(1)\n", "python")
    assert (console.exit_code, console.follows) == (2, "")
    assert commands_of(console) == [("one two", "out\n"), ("three", "")]
    assert (toml.language, toml.name) == ("toml", "file.toml")
    assert [block.body for block in blocks_of(page, "as in ")] == ["$ four\n"]
    page.write_text("<!-- long -->\n" + page.read_text(encoding="utf-8"), encoding="utf-8")
    assert [block.long for block in blocks_of(page)] == [True, True, False, False]
