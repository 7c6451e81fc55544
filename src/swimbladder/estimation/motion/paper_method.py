"""The paper's way beside ours: K2 and T2 of eqs (26) and (27), each log by itself, then averaged.

It takes every log as neutral and at rest at its first sample, and leaves psi out.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from swimbladder.estimation.motion.result import ExperimentFit, Identification
from swimbladder.io.answers import as_json
from swimbladder.sim.pool import Fit, Record, average, fit_depth, fit_speed
from swimbladder.units import rounded

_UNEVEN = 0.05  # of the sample time, that samples may be off an even grid
_FEWEST = 20  # samples
_DIVERGED = 1e7  # 1/m2/s or s, from which a fit has found no number
_REST = 5e-3  # m/s, at the start


@dataclass(frozen=True, kw_only=True)
class PaperFit:
    """One log fitted alone: eq. (26) to centred differences of the depth, eq. (27) to the depth.

    step: largest change of volume since the first sample [m3]. why: what stands against a fit.
    """

    source: str
    step: float
    by_speed: Fit | None = None
    by_depth: Fit | None = None
    why: str = ""


@dataclass(frozen=True, kw_only=True)
class PaperFits:
    """Every log by itself, and the averages, as the paper's Table 2 has them."""

    each: tuple[PaperFit, ...]
    by_speed: Fit | None
    by_depth: Fit | None
    sentence: str

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        return {
            **_fits(self),
            "experiments": [
                as_json(fit, "log=source step_m3") | _fits(fit) | {"why": fit.why}
                for fit in self.each
            ],
            "sentence": self.sentence,
        }


def _fits(of: PaperFit | PaperFits) -> dict[str, Any]:
    return {
        "by_speed": of.by_speed and as_json(of.by_speed, "K2 T2 rms_m_s"),
        "by_depth": of.by_depth and as_json(of.by_depth, "K2 T2 rms_m"),
    }


def paper_fits(found: Identification) -> PaperFits:
    """Return what section 3.1 of the paper makes of the same logs, and how far off that is."""
    each = tuple(_one(e) for e in found.experiments)
    by_speed = [fit.by_speed for fit in each if fit.by_speed is not None]
    by_depth = [fit.by_depth for fit in each if fit.by_depth is not None]
    speed = average(by_speed) if by_speed else None
    depth = average(by_depth) if by_depth else None
    return PaperFits(
        each=each, by_speed=speed, by_depth=depth, sentence=_sentence(found, each, speed, depth)
    )


def _one(e: ExperimentFit) -> PaperFit:
    r = e.record
    if r.volume is None or r.drive != "volume":
        return PaperFit(source=e.source, step=math.nan, why="it has no volume")
    used = np.isfinite(e.residual)
    n = len(used) if used.all() else int(np.argmin(used))
    if n < _FEWEST:
        why = "it does not begin clear of surface and bottom"
        return PaperFit(source=e.source, step=math.nan, why=why)
    change = r.volume[:n] - r.volume[0]
    step = float(np.abs(change).max())
    spans = np.diff(r.time[:n])
    h = float(np.median(spans))
    even = r.time[0] + h * np.arange(n)
    speed = e.estimates["start_speed"]
    why = ""
    if float(np.abs(spans - h).max()) > _UNEVEN * h or abs(even[-1] - r.time[n - 1]) > h:
        why = "it is not sampled evenly"
    elif step == 0.0:
        why = "its volume does not change"
    elif abs(speed.value) > max(_REST, 3.0 * speed.std):
        why = "it does not begin at rest"
    if why:
        return PaperFit(source=e.source, step=step, why=why)
    first = max(3, int(np.argmax(np.abs(change) > 0.0)))
    record = Record(even - even[0], r.depth[:n], change, float(np.mean(r.depth[:first])))
    fits = [_kept(fit, record) for fit in (fit_speed, fit_depth)]
    why = "a fit of it diverges" if None in fits else ""
    return PaperFit(source=e.source, step=step, by_speed=fits[0], by_depth=fits[1], why=why)


def _kept(fit: Callable[[Record], Fit], record: Record) -> Fit | None:
    """Return a fit, None where it goes beyond all vehicles."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            found = fit(record)
    except (OverflowError, ValueError):  # of an exponential; of what is not finite
        return None
    far = max(found.K2, found.T2, 1.0 / found.K2, 1.0 / found.T2) > _DIVERGED
    return None if far else found


def _sentence(
    found: Identification, each: tuple[PaperFit, ...], speed: Fit | None, depth: Fit | None
) -> str:
    fit = depth or speed
    if fit is None:
        why = "; ".join(dict.fromkeys(one.why for one in each))
        return f"The paper's way has no log here that it can be used on. Of each: {why}."
    number = "27" if depth is not None else "26"
    text = (
        f"The paper's way (each log alone by eq. ({number}), averaged) gives K2 = "
        f"{rounded(fit.K2)} 1/m2/s and T2 = {rounded(fit.T2, 3)} s"
    )
    ours = {n: e for n in ("K2", "T2") if (e := found.parameters.get(n)) is not None}
    if len(ours) < 2 or not found.identified:
        return f"{text}."
    theirs = fit._asdict()
    off = {n: 100.0 * (theirs[n] / e.value - 1.0) for n, e in ours.items()}
    words = " and ".join(f"{share:+.0f} % in {name}" for name, share in off.items())
    if all(e.ci95[0] <= theirs[n] <= e.ci95[1] for n, e in ours.items()):
        return f"{text}, {words} from ours: inside our intervals."
    return (
        f"{text}, {words} from ours and outside our interval: it leaves psi out and takes each log "
        "as neutral at its first sample. That it leaves little over does not make it right."
    )
