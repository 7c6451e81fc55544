"""A design in plain words: what to do, in which order, and its predicted errors."""

from __future__ import annotations

from swimbladder.design.experiments import Design
from swimbladder.design.experiments.conditions import Release, Turn
from swimbladder.design.experiments.findings import percent


def volume(value: float, area: float | None) -> str:
    """Return a volume [m3] as text, with the travel of the piston where there is one."""
    text = f"{1e6 * value:+.3g} cm3" if value else "0 cm3"
    return text if area is None or not value else f"{text} ({1e3 * value / area:+.2g} mm)"


def moves(release: Release, area: float | None) -> str:
    """Return the changes of volume of a release, short."""
    return ", ".join(_move(move, area) for move in release.moves)


def _move(move: Turn, area: float | None) -> str:
    what = volume(move.volume, area)
    if move.when is None:
        return what
    return f"at {move.when.depth:g} m going {'up' if move.when.up else 'down'} {what}"


def instruction(design: Design, k: int) -> str:
    """Return what to do in experiment k, counted from 0, in sentences."""
    w, s, area = design.chosen, design.setting, design.piston_area
    release, flight = w.releases[k], w.flights[k]
    said = [f"Come to rest at {release.start:g} m."]
    for move in release.moves:
        where = "" if move.when is None else (
            f"When it passes {move.when.depth:g} m on its way {'up' if move.when.up else 'down'}: "
        )  # fmt: skip
        to = f"volume to {volume(move.volume, area)} against the one at rest."
        said.append(f"{where}{to if where else to.capitalize()}")
    end = {
        "shallowest": f"until it passes {s.shallowest:g} m",
        "deepest": f"until it passes {s.deepest:g} m",
        "longest": "to the end",
    }[flight.ended]
    said.append(f"Record {end}, {s.longest:g} s at most; about {flight.duration:.0f} s.")
    return " ".join(said)


def headlines(design: Design) -> list[str]:
    """Return how long it takes, and the predicted standard errors."""
    w = design.chosen
    count = len(w.releases)
    prediction = w.prediction
    errors = ", ".join(f"{name} {percent(share)}" for name, share in prediction.share.items())
    return [
        f"{count} experiment{'s' if count > 1 else ''} in {w.time / 60.0:.0f} min, "
        f"{design.setting.settling / 60.0:.1f} min of settling before each included.",
        f"Predicted standard errors: {errors} (a drift of the neutral volume included).",
    ]


def comparison(design: Design) -> list[str]:
    """Return how the set compares with the other, none where there is no other."""
    if design.against is None:
        return []
    other = design.against
    errors = ", ".join(
        f"{name} {percent(share)} ({design.gains[name]:.1f} times as much)"
        for name, share in other.prediction.share.items()
    )
    said = [f"Against {design.rival}, in {other.time / 60.0:.0f} min: {errors}."]
    if other.psi is not None and design.chosen.psi is not None:
        from swimbladder.design.experiments.findings import describe

        said.append(
            f"There, psi left out would shift {describe(other.psi.refit)}, at "
            f"{1e3 * other.psi.rms:.1f} mm rms; here at {1e3 * design.chosen.psi.rms:.1f} mm."
        )
    return said
