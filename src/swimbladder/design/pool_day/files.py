"""What a day at the pool leaves in a folder: a log for each experiment, and pool.json."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from swimbladder.design.pool_day.segments import FEWEST, Cut
from swimbladder.errors import InputError, Parameter
from swimbladder.io.answers import as_json
from swimbladder.io.files import write_atomically
from swimbladder.io.logs import Log, read_log
from swimbladder.io.tables import write_csv

STATE = "pool.json"
_MARK = "swimbladder pool"


@dataclass(frozen=True, eq=False)
class Kept:
    """An experiment on disk: its file, its log as `identify` reads it, and what was seen of it.

    set_aside: why it is left out; "" where it is not.
    """

    number: int
    path: Path
    log: Log
    source: str  # the log that it was cut out of
    released_s: float
    change_m3: float
    travel_m: float
    end: str
    rest_depth_m: float
    rest_speed_m_s: float
    remarks: tuple[str, ...]
    set_aside: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return it for pool.json."""
        return {"file": self.path.name, **as_json(self, " ".join(_FACTS)), "remarks": self.remarks}


_FACTS = [f.name for f in fields(Kept) if f.name not in ("path", "log", "remarks")]


def keep(folder: Path, number: int, cut: Cut, source: str, remarks: list[str]) -> Kept:
    """Write an experiment as a log and read it back, so that the fit sees what is on disk."""
    path = write_csv(folder / f"experiment-{number:03d}.csv", cut.columns())
    facts = (cut.released, cut.change, cut.travel, cut.end.value, cut.rest.depth, cut.rest.speed)
    return Kept(number, path, read_log(path), source, *facts, tuple(remarks))


def set_aside(kept: Kept, why: str) -> Kept:
    """Rename an experiment's file, so that it is not among those that count; say why."""
    path = kept.path.with_name(f"set-aside-{kept.number:03d}.csv")
    kept.path.replace(path)
    log = replace(kept.log, source=str(path))
    return replace(kept, path=path, log=log, set_aside=why)


def same_start(kept: Kept, cut: Cut, source: str) -> bool:
    """Say whether a cut is an experiment that is kept, if perhaps cut longer or shorter."""
    columns, log = cut.columns(), kept.log
    n = min(len(log), len(columns["time_s"]), FEWEST)
    begin = [columns[name][:n] for name in ("time_s", "depth_m")]
    return kept.source == source and np.array_equal([log.time[:n], log.depth[:n]], begin)


def write_state(folder: Path, state: Mapping[str, Any]) -> Path:
    """Write pool.json."""
    text = json.dumps({"made_by": _MARK, **state}, indent=2)
    return write_atomically(folder / STATE, f"{text}\n")


def read_state(folder: Path) -> dict[str, Any] | None:
    """Return what pool.json of an earlier run holds, None where there is none.

    Raises InputError where the file is no such thing.
    """
    path = folder / STATE
    if not path.is_file():
        return None
    try:
        state = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise _foreign(path, f"it cannot be read: {error}") from None
    if not isinstance(state, dict) or state.get("made_by") != _MARK:
        raise _foreign(path, "it was not written by `swimbladder pool`")
    return state


def earlier(folder: Path, state: Mapping[str, Any]) -> list[Kept]:
    """Return the experiments of an earlier run; raises InputError where they are not there."""
    found = []
    try:
        for entry in state["experiments"]:
            path, remarks = folder / Path(entry["file"]).name, tuple(entry["remarks"])
            facts = {name: entry[name] for name in _FACTS}
            found.append(Kept(path=path, log=read_log(path), remarks=remarks, **facts))
    except (KeyError, TypeError) as error:
        raise _foreign(folder / STATE, f"it is not whole: {error} is missing") from None
    return found


def _foreign(path: Path, what: str) -> InputError:
    return InputError(
        what, file=path, field=Parameter("out"), remedy="Choose another folder with `out=`"
    )
