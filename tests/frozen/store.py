"""The stored snapshots: one gzipped JSON file a case, the same bytes for the same content."""

import gzip
import json
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent / "store"


def path_of(name: str) -> Path:
    return FOLDER / f"{name}.json.gz"


def load(name: str) -> dict[str, Any]:
    return json.loads(gzip.decompress(path_of(name).read_bytes()))


def save(name: str, snapshot: dict[str, Any]) -> None:
    text = json.dumps(snapshot, ensure_ascii=False, separators=(",", ":"))
    FOLDER.mkdir(exist_ok=True)
    path_of(name).write_bytes(gzip.compress(text.encode(), 9, mtime=0))
