"""What is kept of a campaign: a zarr store of floats and cycles, written chunk by chunk.

The store is shaped before anything is flown. Whoever flew a chunk of floats writes it: every
variable's part beside the store first, then into its place, and the part of `flown` last. That is
the marker: where it stands, all the others do, also after a loss of power. Nothing in the store
depends on when, where or in which order it was flown.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError, Parameter
from swimbladder.io.answers import plain
from swimbladder.io.files import make_folder, unfinished
from swimbladder.io.netcdf import described, meaning, of_type
from swimbladder.jobs import place_files, release
from swimbladder.physics.arrays import Array
from swimbladder.sim.engine.rodas.records import Stop

if TYPE_CHECKING:
    import zarr

MARKER = "flown"
_MOST_WIDE = 1024  # cycles in a chunk


_STOPS = " ".join(["not_flown", *(reason.name.lower() for reason in Stop if reason)])
# In the order of `run.Floats`; what was drawn stands in the first ones.
FLOATS = {
    "trim": meaning("m3", "neutral volume more than the vehicle file says"),
    "psi": meaning("m3 m-1", "hull compression more than the vehicle file says, volume per depth"),
    "drag_factor": meaning("1", "drag over that of the vehicle file"),
    "pump_factor": meaning("1", "delivery of the pump over that of the vehicle file"),
    "mass_factor": meaning("1", "accelerated mass over that of the vehicle file"),
    "cast": meaning("1", "index of the water, from 0"),
    "stop": meaning("", "why it ended", flag_meanings=_STOPS),
    "cycles": meaning("1", "cycles flown"),
    "phases_missed_in_all": meaning("1", "phases that ran out of time or were not held"),
    "arrival_mean": meaning("s", "mean time from the begin of a cycle to its first depth"),
    "deepest_of_all": meaning("m", "greatest depth", "depth", positive="down"),
    "duration": meaning("s", "time flown"),
    "drive_energy_in_all": meaning("J", "electrical energy of pump, valve and holding"),
    "battery_energy_in_all": meaning("J", "energy drawn from the battery"),
    "pump_runs_in_all": meaning("1", "runs of the pump"),
    "drive_energy_per_cycle": meaning("J", "drive_energy of a whole cycle, mean"),
    "battery_energy_per_cycle": meaning("J", "battery_energy of a whole cycle, mean"),
    "pump_runs_per_cycle": meaning("1", "runs of the pump in a whole cycle, mean"),
    "charge": meaning("J", "energy left in the battery"),
    "holding_error": meaning("m", "rms distance from the depths of parks and holds after arrival"),
    "stroke_margin_of_all": meaning("m3", "stroke that was never used, at the end with the least"),
    "battery_cycles": meaning("1", "cycles that one battery lasts, flown or extrapolated"),
    "grounded_in_all": meaning("1", "times that it took itself to lie on the bottom"),
    "ice_turns_in_all": meaning("1", "times that it turned back for ice"),
    "surfaced_under_ice_in_all": meaning(
        "1", "times that it came up although there may have been ice"
    ),
}
ROW = np.dtype([(name, np.float64) for name in FLOATS])
# In the order of `run._cycle`.
CYCLES = {
    "begin": meaning("s", "time since the start at which the cycle begins"),
    "end": meaning("s", "time since the start at which the cycle ends"),
    "arrival": meaning("s", "time from the begin of the cycle to its first depth"),
    "surfaced": meaning("s", "time since the start at which it was afloat again"),
    "deepest": meaning("m", "greatest depth of the cycle", "depth", positive="down"),
    "phases_missed": meaning("1", "phases that ran out of time or were not held"),
    "stroke_margin": meaning("m3", "stroke that was not used, at the end with the least"),
    "drive_energy": meaning("J", "electrical energy of pump, valve and holding"),
    "battery_energy": meaning("J", "energy drawn from the battery"),
    "pump_runs": meaning("1", "runs of the pump"),
    "grounded": meaning("1", "times that it took itself to lie on the bottom"),
    "ice_turns": meaning("1", "times that it turned back for ice"),
    "surfaced_under_ice": meaning("1", "times that it came up although there may have been ice"),
}


@dataclass(frozen=True, kw_only=True)
class Layout:
    """The shape of a campaign's store: `floats` by `cycles`, in chunks of `chunk` floats.

    about: what the store says of the campaign. hashes: of each thing that the results depend on.
    """

    folder: Path
    floats: int
    cycles: int
    chunk: int
    about: Mapping[str, Any]
    hashes: Mapping[str, str]

    @property
    def count(self) -> int:
        """How many chunks there are."""
        return -(-self.floats // self.chunk)

    def numbers(self, chunk: int) -> range:
        """Return the floats of a chunk."""
        return range(chunk * self.chunk, min((chunk + 1) * self.chunk, self.floats))

    def check(self) -> bool:
        """Return whether the store is there; raises InputError where it is another campaign's."""
        try:
            text = (self.folder / "zarr.json").read_text(encoding="utf-8")
            said = json.loads(text)["attributes"]
            found, campaign = (json.loads(said[name]) for name in ("hashes", "campaign"))
            casts = campaign.get("casts", 1) + self.about["casts"]
            differ = [key for key, value in self.hashes.items() if found.get(key) != value]
            if not casts and {"vehicle", "mission"} & set(differ):
                differ = [key for key in differ if key != "cast"]  # the vehicle's own water
        except FileNotFoundError:
            if self.folder.exists():
                raise self._refused("this is no store of a campaign") from None
            return False
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            raise self._refused("this is no store of a campaign") from None
        if differ:
            here = f" (this is swimbladder {release()})" if "version" in differ else ""
            what = f"this is the store of another campaign; what differs: {', '.join(differ)}"
            raise self._refused(what + here)
        return True

    def _refused(self, what: str) -> InputError:
        remedy = "Choose another folder with `out=`, or remove that one"
        return InputError(what, file=self.folder, field=Parameter("out"), remedy=remedy)

    def create(self) -> None:
        """Make the store where there is none yet; whole, whoever else makes it just now.

        Raises InputError where there is another campaign's.
        """
        if self.check():
            return
        make_folder(self.folder.parent)
        try:
            with tempfile.TemporaryDirectory(dir=self._aside()) as aside:
                made = Path(aside, "made")
                place_files(made, self._empty, aside=Path(aside))
                with contextlib.suppress(OSError):  # another was faster
                    made.rename(self.folder)
        except OSError as error:
            what = f"cannot make the store: {error.strerror or error}"
            remedy = "Choose another folder with `out=`"
            raise InputError(
                what, file=self.folder, field=Parameter("out"), remedy=remedy
            ) from error
        if not self.check():
            raise self._refused("the store cannot be made")

    def done(self) -> set[int]:
        """Return the chunks whose marker stands."""
        try:
            return {int(name) for name in os.listdir(self.folder / MARKER / "c") if name.isdigit()}
        except FileNotFoundError:
            return set()

    def write(self, chunk: int, values: Mapping[str, Array]) -> None:
        """Write what was flown of a chunk, its marker last."""
        import zarr
        from zarr.core.buffer import cpu
        from zarr.storage import MemoryStore

        held: dict[str, Any] = {
            key: cpu.Buffer.from_bytes(content)
            for key, content in self._empty.items()
            if key.endswith("zarr.json")
        }
        group = zarr.open_group(MemoryStore(held), mode="r+")
        numbers = self.numbers(chunk)
        rows = slice(numbers.start, numbers.stop)
        for name, found in values.items():
            _array(group, name)[rows] = found
        _array(group, MARKER)[rows] = 1
        files = {key: buffer.to_bytes() for key, buffer in held.items() if "/c/" in key}
        marker = f"{MARKER}/c/{chunk}"
        last = files.pop(marker)
        try:
            place_files(self.folder, files, aside=self._aside())
            place_files(self.folder, {marker: last}, aside=self._aside())
        except FileNotFoundError:
            if chunk not in self.done():  # else another has done it, and cleared up
                raise

    def tidy(self) -> None:
        """Remove what kills left beside the store."""
        shutil.rmtree(self._aside(), ignore_errors=True)

    def table(self) -> NDArray[np.void]:
        """Return the floats' variables, [floats] of ROW; nan where they are not flown."""
        import zarr

        group, found = zarr.open_group(self.folder, mode="r"), np.empty(self.floats, ROW)
        for name in FLOATS:
            found[name] = _array(group, name)[:]
        return found

    def _aside(self) -> Path:
        """Return the folder for what is not whole yet: on the same disk, outside the store."""
        return make_folder(unfinished(self.folder))

    @cached_property
    def _empty(self) -> dict[str, bytes]:
        """The store's files before anything is flown."""
        import zarr
        from zarr.codecs import ZstdCodec
        from zarr.storage import MemoryStore

        held: dict[str, Any] = {}
        group = zarr.create_group(MemoryStore(held), attributes=self._attributes())

        def create(name: str, data: Any, about: Mapping[str, Any]) -> None:
            axis = name in _AXES
            parts = (self.chunk, min(self.cycles, _MOST_WIDE))[: data.ndim]
            dimensions = (name,) if axis else _AXES[: data.ndim]
            made = group.create_array(
                name,
                shape=data.shape,
                dtype=data.dtype,
                chunks=data.shape if axis else parts,
                fill_value=np.nan if data.dtype.kind == "f" else 0,
                filters=None,
                compressors=[ZstdCodec(level=3, checksum=True)],
                dimension_names=dimensions,
                attributes=plain(of_type(about, data.dtype)),
            )
            if axis:
                made[:] = data

        for name, count in zip(_AXES, (self.floats, self.cycles), strict=True):
            numbers = np.arange(1, count + 1, dtype=np.int32)
            create(name, numbers, meaning("1", f"number of the {name}"))
        one = np.broadcast_to(np.float64(), (self.floats,))
        words = one.astype(np.int64)  # as zarr's attributes are: CF wants flags of one type
        for name, about in FLOATS.items():
            create(name, words if "flag_meanings" in about else one, about)
        for name, about in CYCLES.items():
            create(name, np.broadcast_to(np.float64(), (self.floats, self.cycles)), about)
        flown = meaning("", "whether the float was flown", flag_meanings="not_flown flown")
        create(MARKER, words, flown)
        with warnings.catch_warnings():  # that version 3 of the format does not know of it yet
            warnings.simplefilter("ignore")
            zarr.consolidate_metadata(group.store)
        return {key: buffer.to_bytes() for key, buffer in held.items()}

    def _attributes(self) -> dict[str, Any]:
        title = f"{self.about['vehicle']}, {self.floats} floats on a mission"
        held = {"campaign": dict(self.about), "hashes": dict(self.hashes)}
        return described(title, **{name: json.dumps(value) for name, value in held.items()})


_AXES = ("float", "cycle")


def _array(group: zarr.Group, name: str) -> Any:
    return group[name]
