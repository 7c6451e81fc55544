"""What a result is written as: texts, tables, numbers and pictures, in a folder that is whole."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from swimbladder.io.answers import json_text
from swimbladder.io.config import file_text
from swimbladder.io.files import make_folder, publish, write_atomically
from swimbladder.io.progress import Advance, silent
from swimbladder.io.tables import write_csv
from swimbladder.show.picture import Picture


def write_all(
    out: Path, contents: Mapping[str, object], *, advance: Advance = silent
) -> list[Path]:
    """Write files into the folder `out`, all of them or none, and return their paths.

    contents: by name, below the folder: a text; a figure; the columns of a name that ends with
    .csv; the answer of one that ends with .json; or what writes the file, called with its path; or
    `Gone`. advance: called with each file's share of the work. Raises InputError where the folder
    cannot be written.
    """
    made = {name: content for name, content in contents.items() if not isinstance(content, Gone)}

    def write(folder: Path) -> None:
        for name, content in made.items():
            make_folder((folder / name).parent)
            _write(folder / name, content)
            advance(1.0 / len(made))

    make_folder(out.parent)
    publish(out, write)
    for pattern, gone in contents.items():
        if isinstance(gone, Gone):
            stale = {*out.glob(pattern)} - {out / name for name in made}
            for path in stale:
                if not gone.head or written_by(path, gone.head):
                    path.unlink()
    return [out / name for name in made]


class Gone(NamedTuple):
    """No file: those that match are taken away, if they begin with a head, as a comment."""

    head: str = ""


def written_by(path: Path, head: str) -> bool:
    """Whether a file begins with this head, as a comment: it is not somebody else's."""
    return path.is_file() and file_text(path).startswith(f"# {head}")


def _write(path: Path, content: Any) -> None:
    if isinstance(content, Picture):
        from swimbladder.show.static import save

        save(content, path)
    elif isinstance(content, str | bytes):
        write_atomically(path, content)
    elif callable(content):
        content(path)
    elif path.suffix == ".json":
        write_atomically(path, json_text(content) + "\n")
    else:
        write_csv(path, content)
