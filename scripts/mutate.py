"""Mutation testing: ``python scripts/mutate.py --number 300 --seed 1 --jobs 2``.

Changes one operator, constant or return value at a time, in a copy of the tree that is deleted, and
runs the tests that ``scripts/mutants.toml`` names for that file. What no test notices is listed.
Files are rewritten on disk, with a kernel cache of their own, since compiled code cannot be changed
otherwise. Results are appended to a file of JSON lines; what stands there is not tested again, and
what noticed a mutant before runs first. At the end all of that runs in the unchanged tree.
"""

import argparse
import ast
import concurrent.futures
import contextlib
import hashlib
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
KILLED, SURVIVED, TIMEOUT = "killed", "survived", "timeout"
LEFT_OUT = shutil.ignore_patterns(".*", "__pycache__", "node_modules")
MADE = {"build", "dist", "report"}  # at the top of the tree

COMPARISONS: dict[type[ast.cmpop], tuple[str, tuple[str, ...]]] = {
    ast.Lt: ("<", ("<=", ">=")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
}
OPERATORS: dict[type[ast.operator], tuple[str, tuple[str, ...]]] = {
    ast.Add: ("+", ("-",)),
    ast.Sub: ("-", ("+",)),
    ast.Mult: ("*", ("/",)),
    ast.Div: ("/", ("*",)),
    ast.Pow: ("**", ("*",)),
}
TWINS = {"min": "max", "max": "min", "floor": "ceil", "ceil": "floor", "sin": "cos", "cos": "sin"}
SKIPPED = (ast.Raise, ast.Assert, ast.JoinedStr, ast.ImportFrom, ast.Import)


class Mutant(NamedTuple):
    """A change of one place of a file."""

    path: str
    line: int
    before: str  # the line, stripped
    after: str
    text: str  # the whole file, changed

    def is_at(self, entry: dict[str, str]) -> bool:
        """Return whether an entry of the list of equivalent mutants names this one.

        One without `after` names every change of its line.
        """
        keys = {"path", "before", "after"} & entry.keys()
        return all(getattr(self, key) == entry[key] for key in keys)


def places(source: str) -> Iterator[tuple[int, int, str]]:
    """Yield (begin, end, new text) of every change, in characters of the source."""
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    lines = source.splitlines(keepends=True)

    def at(line: int, column: int) -> int:  # ast counts bytes
        return starts[line - 1] + len(lines[line - 1].encode()[:column].decode())

    def span(node: ast.expr) -> tuple[int, int]:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return at(node.lineno, node.col_offset), at(node.end_lineno, node.end_col_offset)

    def between(
        left: ast.expr, right: ast.expr, old: str, new: Sequence[str]
    ) -> Iterator[tuple[int, int, str]]:
        begin = source.index(old, span(left)[1], span(right)[0])
        yield from ((begin, begin + len(old), text) for text in new)

    def walk(node: ast.AST) -> Iterator[tuple[int, int, str]]:
        if isinstance(node, ast.Compare):
            for left, op, right in zip(
                [node.left, *node.comparators], node.ops, node.comparators, strict=False
            ):
                if type(op) in COMPARISONS:
                    yield from between(left, right, *COMPARISONS[type(op)])
        elif isinstance(node, ast.BinOp | ast.AugAssign) and type(node.op) in OPERATORS:
            left, right = (
                (node.left, node.right)
                if isinstance(node, ast.BinOp)
                else (node.target, node.value)
            )
            yield from between(left, right, *OPERATORS[type(node.op)])
        elif isinstance(node, ast.BoolOp):
            old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
            for left, right in zip(node.values, node.values[1:], strict=False):
                yield from between(left, right, old, (new,))
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
            begin = span(node)[0]
            end = begin + (1 if isinstance(node.op, ast.USub) else 3)
            yield begin, end + (source[end] == " "), ""
        elif isinstance(node, ast.Constant) and isinstance(node.value, bool | int | float):
            value = node.value
            if isinstance(value, bool):
                texts = [str(not value)]
            elif isinstance(value, int):
                texts = [str(value + 1), str(value - 1)]
            else:
                texts = [f"({2.0 * value!r})", f"({0.9 * value!r})"] if value else ["1.0"]
            yield from ((*span(node), text) for text in texts)
        elif isinstance(node, ast.Call):
            name = node.func
            if isinstance(name, ast.Name | ast.Attribute):
                old = name.id if isinstance(name, ast.Name) else name.attr
                if old in TWINS:
                    yield span(name)[1] - len(old), span(name)[1], TWINS[old]
        elif isinstance(node, ast.Return) and node.value is not None:
            sign = "-" if isinstance(node.value, ast.BinOp) else "not "
            if isinstance(node.value, ast.BinOp | ast.BoolOp | ast.Compare):
                begin, end = span(node.value)
                yield begin, end, f"{sign}({source[begin:end]})"
        for child in ast.iter_child_nodes(node):
            if isinstance(child, SKIPPED) or _is_not_run(node, child):
                continue
            yield from walk(child)

    yield from walk(ast.parse(source))


def _is_not_run(node: ast.AST, child: ast.AST) -> bool:
    """Return whether a child is an annotation or a decorator."""
    if isinstance(node, ast.AnnAssign | ast.arg):
        return child is node.annotation
    if isinstance(node, ast.FunctionDef):
        return child is node.returns or child in node.decorator_list
    return False


def mutants_of(path: str, source: str) -> list[Mutant]:
    """Return every mutant of a file, each once."""
    found: dict[str, Mutant] = {}
    for begin, end, new in places(source):
        text = source[:begin] + new + source[end:]
        line = source.count("\n", 0, begin)
        before, after = (t.splitlines()[line].strip() for t in (source, text))
        found.setdefault(text, Mutant(path, line + 1, before, after, text))
    return list(found.values())


def drawn(every: Sequence[Mutant], number: int, seed: int) -> list[Mutant]:
    """Return some mutants that are Python.

    Each has a lot of its own, and they come in the order of these: an edit elsewhere draws the
    others again, and a run that was stopped has tested a fair sample.
    """
    seen, lots = Counter[str](), dict[str, Mutant]()
    for mutant in every:
        own = f"{seed}\n{mutant.path}\n{mutant.before}\n{mutant.after}"
        seen[own] += 1  # the same change of the same line may stand more than once in a file
        lots[hashlib.sha256(f"{own}\n{seen[own]}".encode()).hexdigest()] = mutant
    chosen: list[Mutant] = []
    for lot in sorted(lots):
        with contextlib.suppress(SyntaxError):
            ast.parse(lots[lot].text)
            chosen.append(lots[lot])
        if len(chosen) == number:
            break
    return chosen


class Run:
    """Copies of a tree, one a job, in which mutants are tested."""

    def __init__(
        self, root: Path, tests: dict[str, list[str]], patience: float, interpreted: list[str]
    ) -> None:
        self.root, self.tests, self.patience, self.interpreted = root, tests, patience, interpreted
        self.folder = Path(tempfile.mkdtemp(prefix="mutants-"))
        self._of_thread = threading.local()
        self._copies = iter(range(10**6))
        self._lock = threading.Lock()
        self._running: set[subprocess.Popen[bytes]] = set()

    def close(self) -> None:
        """End what runs, and delete the copies."""
        for process in list(self._running):
            _end(process)
        shutil.rmtree(self.folder, ignore_errors=True)

    def copy(self) -> Path:
        """Return this thread's copy of the tree."""
        if not hasattr(self._of_thread, "copy"):
            with self._lock:
                made = self.folder / str(next(self._copies))
            shutil.copytree(self.root, made / "tree", ignore=self._left_out)
            (made / "cache").mkdir()
            self._of_thread.copy = made
        copy: Path = self._of_thread.copy
        return copy

    def _left_out(self, folder: str, names: list[str]) -> set[str]:
        top = MADE if Path(folder) == self.root else set[str]()
        return set(LEFT_OUT(folder, names)) | top & set(names)

    def environment(self) -> dict[str, str]:
        """Return what programs run with in this thread's copy."""
        copy = self.copy()
        return os.environ | {
            "PYTHONPATH": os.pathsep.join((str(copy / "tree" / "src"), str(copy / "tree"))),
            "SWIMBLADDER_CACHE_DIR": str(copy / "cache"),
            "PYTHONDONTWRITEBYTECODE": "1",
            "CI": "1",  # the same examples in every run
        }

    def kernels(self) -> Path:
        """Return the folder of the kernels of the tree as it is now."""
        ask = "import swimbladder.sim.engine.cache as c; print(c.cache_folder())"
        done = subprocess.run(
            [sys.executable, "-c", ask],
            env=self.environment(),
            cwd=self.copy() / "tree",
            capture_output=True,
            text=True,
            check=False,
        )
        return Path(done.stdout.strip())

    def pytest(self, arguments: str, limit: float | None) -> tuple[str, str, str]:
        """Return (killed, survived or timeout; the end of what was printed; the test that failed).

        Where no test could be run, which one failed is empty.
        """
        copy = self.copy()
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
        with (self.folder / f"{copy.name}.txt").open("w+") as printed:
            process = subprocess.Popen(
                [*command, *shlex.split(arguments)],
                cwd=copy / "tree",
                env=self.environment(),
                stdout=printed,
                stderr=subprocess.STDOUT,
                start_new_session=os.name != "nt",
            )
            self._running.add(process)
            try:
                code = process.wait(limit)
            except subprocess.TimeoutExpired:
                return TIMEOUT, "", arguments
            finally:
                self._running.discard(process)
                if process.poll() is None:
                    _end(process)
            printed.seek(0)
            said = printed.read()[-2000:]
        if code not in (0, 1, 2, 4):  # 4: not even the tests' own modules can be imported
            raise SystemExit(f"pytest {arguments} ended with {code}:\n{said}")
        failed = re.findall(r"^FAILED (.+?)(?: - .*)?$", said, re.MULTILINE)
        return SURVIVED if code == 0 else KILLED, said, failed[0] if failed else ""

    def unchanged(self, tests: Sequence[str]) -> None:
        """Raise SystemExit where one of these tests fails in the unchanged tree."""
        ended, said, _ = self.pytest(shlex.join(tests), None)
        if tests and ended != SURVIVED:
            raise SystemExit(f"fails without a change:\n{said}")

    def test(self, mutant: Mutant, first: str = "") -> tuple[str, str, float]:
        """Return (killed, survived or timeout; the test that noticed; the seconds that took).

        first: a test that noticed it before, or nothing.
        """
        copy, made = self.copy(), set[Path]()
        target, cache = copy / "tree" / mutant.path, copy / "cache"
        source, began = target.read_text("utf-8"), time.monotonic()
        shared = any(fnmatch(mutant.path, pattern) for pattern in self.interpreted)
        ended, by = SURVIVED, ""
        try:
            for arguments in [*[shlex.quote(first)] * bool(first), *self.tests[mutant.path]]:
                usual = self.kernels() if shared else copy
                if shared and not usual.is_dir():
                    self.pytest(arguments, None)
                before = set(cache.iterdir())
                target.write_text(mutant.text, "utf-8")
                if shared and (now := self.kernels()) != usual and usual.is_dir():
                    shutil.copytree(usual, now, dirs_exist_ok=True)
                ended, _, by = self.pytest(arguments, self.patience)
                target.write_text(source, "utf-8")
                made |= set(cache.iterdir()) - before
                if ended != SURVIVED and (by or arguments != shlex.quote(first)):
                    break
        finally:
            target.write_text(source, "utf-8")
            for folder in made:
                shutil.rmtree(folder, ignore_errors=True)
        return ended, by, time.monotonic() - began


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process and what it started."""
    if os.name == "nt":
        process.kill()
    else:
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def tests_for(path: str, listed: dict[str, dict[str, list[str]]]) -> list[str]:
    """Return the tests of the most specific pattern that a path fits, of each table."""
    found: list[str] = []
    for name in ("tests", "last"):
        table = listed.get(name, {})
        fits = [pattern for pattern in table if fnmatch(path, pattern)]
        found += table[max(fits, key=len)] if fits else []
    return found


def key_of(root: Path, mutant: Mutant, tests: list[str]) -> str:
    """Return what a result is kept under: the changed file, and the tests and their neighbours."""
    digest = hashlib.sha256(f"{mutant.path}\n{mutant.text}\n{tests}".encode())
    for word in shlex.split(" ".join(tests)):
        file = root / word.partition("::")[0]
        if file.is_file():
            for each in sorted(file.parent.glob("*.py")):  # with what the tests stand on
                digest.update(each.read_bytes())
    return digest.hexdigest()[:24]


def table(rows: list[tuple[Mutant, str, str]], write: Callable[[str], object]) -> float:
    """Write survivors and scores by file; return the share caught of those not equivalent.

    rows: mutant, how it ended, why it is equivalent or nothing.
    """
    for mutant, ended, reason in sorted(rows, key=lambda row: (row[0].path, row[0].line)):
        if ended == SURVIVED and not reason:
            write(f"{mutant.path}:{mutant.line}\n  - {mutant.before}\n  + {mutant.after}")
    count, caught = Counter[str](), Counter[str]()
    for mutant, ended, reason in rows:
        if not reason:
            for name in (mutant.path, "all"):
                count[name] += 1
                caught[name] += ended != SURVIVED
    for name in [*sorted(set(count) - {"all"}), "all"]:
        if count[name]:
            write(f"{caught[name]:4d} of {count[name]:4d} caught  {name}")
    write(
        f"{sum(bool(reason) for *_, reason in rows)} equivalent, each with its reason in the list"
    )
    return caught["all"] / count["all"] if count["all"] else 1.0


def stale(known: Sequence[dict[str, str]], every: Sequence[Mutant]) -> list[dict[str, str]]:
    """Return the entries of the list of equivalent mutants that name none of these."""
    by_path: dict[str, list[Mutant]] = defaultdict(list)
    for mutant in every:
        by_path[mutant.path].append(mutant)
    return [entry for entry in known if not any(m.is_at(entry) for m in by_path[entry["path"]])]


def main(words: Sequence[str] | None = None) -> int:
    """Test mutants; return 0 where enough are caught, 1 where not."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--number", type=int, default=300, help="mutants, drawn by the seed")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", default="*", help="pattern of the files to change")
    parser.add_argument("--root", type=Path, default=ROOT, help="the tree to copy")
    parser.add_argument("--patience", type=float, default=600.0, help="s a file of tests may take")
    parser.add_argument("--least", type=float, default=0.95, help="share that has to be caught")
    parser.add_argument("--record", type=Path, help="JSON lines; build/mutants.jsonl in the tree")
    given = parser.parse_args(words)
    root = given.root.resolve()
    listed = tomllib.loads((root / "scripts" / "mutants.toml").read_text("utf-8"))
    known = listed.get("equivalent", [])
    paths = sorted(
        {p.relative_to(root).as_posix() for glob in listed["tests"] for p in root.glob(glob)}
    )
    every = [m for path in paths for m in mutants_of(path, (root / path).read_text("utf-8"))]
    if dead := stale(known, every):
        sys.exit(f"scripts/mutants.toml lists as equivalent what is no mutant any more: {dead}")
    every = [m for m in every if fnmatch(m.path, given.only)]
    chosen = drawn(every, given.number, given.seed)
    reasons = [next((e["reason"] for e in known if m.is_at(e)), "") for m in chosen]
    record = given.record or root / "build" / "mutants.jsonl"
    record.parent.mkdir(parents=True, exist_ok=True)
    done: dict[str, tuple[str, str]] = {}
    noticed: dict[tuple[str, str, str], str] = {}
    if record.exists():
        for line in record.read_text("utf-8").splitlines():
            with contextlib.suppress(ValueError):  # a line that was being written
                row = json.loads(line)
                done[row["key"]] = row["ended"], row.get("by", "")
                noticed[row["path"], row["before"], row["after"]] = row.get("by", "")
    run = Run(
        root,
        {path: tests_for(path, listed) for path in paths},
        given.patience,
        listed.get("interpreted", []),
    )
    lock = threading.Lock()

    def one(mutant: Mutant) -> tuple[str, str]:
        key = key_of(root, mutant, run.tests[mutant.path])
        if key not in done:
            first = noticed.get((mutant.path, mutant.before, mutant.after), "")
            ended, by, seconds = run.test(mutant, first)
            row = {"key": key, "ended": ended, "by": by, "seconds": round(seconds, 1)}
            row |= {name: getattr(mutant, name) for name in ("path", "line", "before", "after")}
            with lock, record.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
                print(
                    f"{ended:8s} {seconds:4.0f} s  {mutant.path}:{mutant.line}  {mutant.after}",
                    flush=True,
                )
            done[key] = ended, by
        return done[key]

    pool = concurrent.futures.ThreadPoolExecutor(given.jobs)
    try:
        tested = [m for m, reason in zip(chosen, reasons, strict=True) if not reason]
        found = list(pool.map(one, tested))
        # with all parameters: a change of a value may have changed their names
        killers = {by.partition("[")[0] for ended, by in found if ended == KILLED and by}
        run.unchanged(sorted(killers))
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        run.close()
    ended = {m: how for m, (how, _) in zip(tested, found, strict=True)}
    rows = [(m, ended.get(m, SURVIVED), why) for m, why in zip(chosen, reasons, strict=True)]
    share = table(rows, print)
    print(f"{100.0 * share:.1f} % of {len(tested)} caught; asked for {100.0 * given.least:g} %")
    return 0 if share >= given.least else 1


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    sys.exit(main())
