"""Where each key of a TOML text stands, which `tomllib` does not give."""

from __future__ import annotations

from bisect import bisect_right

from swimbladder.vehicle.schema import dotted

_Path = tuple[str | int, ...]


def key_lines(text: str) -> dict[str, int]:
    """Return {dotted place: line counted from 1} of every key, table and list element.

    The text has to be TOML that `tomllib` has read. Places are written as `dotted` writes them:
    ``hull.psi``, ``setpoints[0].depth``.
    """
    scanner = _Scanner(text)
    scanner.document()
    return scanner.lines


class _Scanner:
    """A cursor over a valid TOML text that notes where keys begin."""

    def __init__(self, text: str) -> None:
        self.text = text + "\n"
        self.position = 0
        self.starts = [0, *(i + 1 for i, c in enumerate(self.text) if c == "\n")]
        self.lines: dict[str, int] = {}
        self.tables: dict[_Path, int] = {}  # how many [[tables]] of this name so far

    def document(self) -> None:
        """Scan statements: headers, and keys with values."""
        prefix: _Path = ()
        while self.skip_blank():
            if self.text[self.position] == "[":
                prefix = self.header()
            else:
                self.key_and_value(prefix)

    def note(self, path: _Path, position: int) -> None:
        """Note where a place begins; the first mention wins."""
        self.lines.setdefault(dotted(path), bisect_right(self.starts, position))

    def skip_blank(self) -> bool:
        """Skip blanks, line ends and comments; return whether anything is left."""
        while self.position < len(self.text):
            character = self.text[self.position]
            if character == "#":
                self.position = self.text.index("\n", self.position)
            elif character not in " \t\r\n":
                return True
            else:
                self.position += 1
        return False

    def header(self) -> _Path:
        """Scan ``[table]`` or ``[[table]]`` and return its path."""
        start = self.position
        several = self.text.startswith("[[", start)
        self.position += 2 if several else 1
        *parents, last = self.key()
        self.position = self.text.index("]", self.position) + (2 if several else 1)
        path: _Path = ()
        for part in parents:
            path = self.newest((*path, part))
        path = (*path, last)
        if several:
            self.tables[path] = self.tables.get(path, 0) + 1
            self.note(path, start)
        path = self.newest(path)
        self.note(path, start)
        return path

    def newest(self, path: _Path) -> _Path:
        """Return `path`, within the newest table where it names a list of tables."""
        return (*path, self.tables[path] - 1) if path in self.tables else path

    def key_and_value(self, prefix: _Path) -> None:
        """Scan ``a.b = value``; each part of the key is a place."""
        start = self.position
        path = prefix
        for part in self.key():
            path = (*path, part)
            self.note(path, start)
        self.position = self.text.index("=", self.position) + 1
        self.skip_blank()
        self.value(path)

    def key(self) -> list[str]:
        """Scan a dotted key and return its parts."""
        parts = []
        while True:
            self.skip_blank()
            start = self.position
            if self.text[start] in "\"'":
                self.string()
                parts.append(_unquote(self.text[start : self.position]))
            else:
                while self.text[self.position] not in " \t.=]":
                    self.position += 1
                parts.append(self.text[start : self.position])
            while self.text[self.position] in " \t":
                self.position += 1
            if self.text[self.position] != ".":
                return parts
            self.position += 1

    def string(self) -> None:
        """Skip a string of any of the four kinds."""
        quote = self.text[self.position]
        long = self.text.startswith(quote * 3, self.position)
        end = quote * 3 if long else quote
        self.position += len(end)
        while not self.text.startswith(end, self.position):
            self.position += 2 if quote == '"' and self.text[self.position] == "\\" else 1
        self.position += len(end)
        while long and self.text[self.position] == quote:  # up to two quotes may end the content
            self.position += 1

    def value(self, path: _Path) -> None:
        """Scan a value and what is inside it."""
        character = self.text[self.position]
        if character in "\"'":
            self.string()
        elif character == "[":
            self.inside("]", path)
        elif character == "{":
            self.inside("}", path)
        else:
            while self.text[self.position] not in ",]}#\n":
                self.position += 1

    def inside(self, end: str, path: _Path) -> None:
        """Scan the elements of a list or of an inline table."""
        self.position += 1
        index = 0
        while self.skip_blank() and self.text[self.position] != end:
            if end == "]":
                self.note((*path, index), self.position)
                self.value((*path, index))
                index += 1
            else:
                self.key_and_value(path)
            self.skip_blank()
            if self.text[self.position] == ",":
                self.position += 1
        self.position += 1


def _unquote(text: str) -> str:
    """Return the content of a quoted key."""
    if text[0] == "'":
        return text[1:-1]
    import tomllib

    return next(iter(tomllib.loads(f"{text} = 0")))
