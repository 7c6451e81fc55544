"""Deep dives as they are shown: as measured and as predicted by the model, and the imbalance."""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from swimbladder.estimation.motion.deep import DeepIdentification
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.files import Gone
from swimbladder.show.identification import MARK, check_folder
from swimbladder.show.parts import Drawn, Labelled, Part, Shown, Table, labelled
from swimbladder.show.picture import Ink, Picture, grid_of
from swimbladder.units import shown_unit, unit_factor

_DIVES = (Ink.BLUE, Ink.ORANGE, Ink.GREEN, Ink.PURPLE, Ink.SKY, Ink.VERMILION)
_DBAR = 1e4  # Pa


def draw_deep(found: DeepIdentification) -> Picture:
    """Return pressure over time of every dive, and the imbalance of its volumes over pressure."""
    picture, (dives, imbalance) = grid_of((9.0, 7.0), 2, 1, letters=True)
    begin = 0.0
    for dive, color in zip(found.dives, cycle(_DIVES), strict=False):
        start, replay, pieces = dive.dive.time[0] - 3600.0 * begin, dive.replay, dive.dive.pieces
        hours = (dive.dive.time - start) / 3600.0
        dives.dots(hours, dive.dive.pressure / _DBAR, ".", color, "measured", size=3.0)
        again = (replay.time - start) / 3600.0, replay.pressure / _DBAR
        dives.line(*again, Ink.BLACK, "model from its first sample", width=0.9)
        name = dive.dive.name.rpartition("/")[2]
        off = pieces.pressure / _DBAR, 1e6 * dive.imbalance
        imbalance.dots(*off, ".", color, name, size=3.0)
        begin = float(hours[-1]) + 2.0
    dives.x, dives.y = "time [h], one dive after the other", "pressure [dbar]"
    limit = 1.1e6 * max(float(np.percentile(np.abs(t.imbalance), 99.5)) for t in found.dives)
    imbalance.rule("y", 0.0, Ink.BLACK)
    imbalance.ylim, imbalance.legend = (-limit, limit), "beside"
    imbalance.x, imbalance.y = "pressure [dbar]", "volume imbalance [cm³]"
    return picture


class DeepIdentificationShown(Shown[DeepIdentification]):
    """Parameters from deep dives; the vehicle of an earlier run goes where they are none.

    notes: of reading the logs.
    """

    name, kind = "deep", "deep dives"

    def __init__(self, found: DeepIdentification, *, notes: Sequence[str] = ()) -> None:
        super().__init__(found)
        self.notes = notes

    def before(self, out: Path) -> list[Path]:
        """Check that no other vehicle is written over."""
        check_folder(out, "")
        return []

    def parts(self) -> Iterator[Part]:
        """Give the answer first."""
        first, *others = self.found.sentences
        yield Labelled("no", first)
        yield from others
        yield from (self._parameters(), self._dives())
        yield Drawn("deep", partial(draw_deep, self.found))
        yield from (*labelled("assumed", self.found.assumptions), *labelled("note", self.notes))

    def _parameters(self) -> Table:
        words = {"data": "the dives", "prior": "its prior", "set": "set"}
        if self.found.inconsistent:
            words |= dict.fromkeys(("data", "prior"), "not identifiable")
        rows = []
        for name, e in self.found.parameters.items():
            shown = shown_unit(e.unit) if e.unit else ""
            factor = unit_factor(e.unit, shown) if e.unit else 1.0
            value, std, low, high = (factor * x for x in (e.value, e.std, *e.ci95))
            sure = (f"{std:.2g}", f"{low:.4g} to {high:.4g}")
            sure = ("-", "-") if self.found.inconsistent else sure
            rows.append((name, f"{value:.4g}", *sure, shown or "-", words[e.origin]))
        return Table(("", "value", "1 sigma", "95 % interval", "unit", "from"), rows)

    def _dives(self) -> Table:
        headings = ("dive", "samples", "deepest", "imbalance", "speed off by", "replay off by")
        rows = []
        for flown, numbers in zip(self.found.dives, self.found.to_dict()["dives"], strict=True):
            pressures = (numbers[name] / _DBAR for name in ("deepest_Pa", "replay_rms_Pa"))
            deepest, replay = (f"{pressure:.0f} dbar" for pressure in pressures)
            imbalance = f"{1e6 * numbers['imbalance_rms_m3']:.1f} mL"
            speed = f"{1e3 * numbers['speed_rms_m_s']:.1f} mm/s"
            samples = str(numbers["samples"])
            rows.append((flown.dive.name, samples, deepest, imbalance, speed, replay))
        return Table(headings, rows)

    def table(self) -> dict[str, Any]:
        """Return the columns of deep.csv: speeds and models of them, dive after dive."""
        parts = [(k, fits, fits.dive.pieces) for k, fits in enumerate(self.found.dives, start=1)]
        parted = {
            "dive": [np.full(len(p), float(k)) for k, _, p in parts],
            "time_s": [p.time for _, _, p in parts],
            "pressure_Pa": [p.pressure for _, _, p in parts],
            "speed_m_s": [p.speed for _, _, p in parts],
            "model_speed_m_s": [p.speed - fits.speed for _, fits, p in parts],
            "imbalance_m3": [fits.imbalance for _, fits, _ in parts],
        }
        return {name: np.concatenate(values) for name, values in parted.items()}

    def files(self) -> dict[str, object]:
        """Return deep.csv and, where identified, vehicle.toml."""
        files: dict[str, object] = {"deep.csv": self.table(), "vehicle.toml": Gone()}
        if self.found.identified:
            head = "\n".join([f"{MARK} from deep dives.", *self.found.sentences])
            files["vehicle.toml"] = vehicle_file(self.found.result_vehicle, head=head)
        return files
