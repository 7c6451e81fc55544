"""What `stability` found, as tables."""

from __future__ import annotations

import math
from collections.abc import Sequence

from swimbladder.design.stability.result import Confirmed, length
from swimbladder.design.stability.robust import Stood


def cycle_rows(cycles: Sequence[Confirmed]) -> list[tuple[str, ...]]:
    """Return the table of limit cycles: foretold beside simulated."""
    rows: list[tuple[str, ...]] = []
    for c in cycles:
        p, s = c.predicted, c.seen
        kind, foretold = "none", ("", "")
        if p.cycle is not None:
            kind = "stable" if p.cycle.stable else "edge"
            if p.bound:
                kind = "at most"
            elif not p.cycle.believed:
                kind += ", not relied on"
            every = p.cycle.period
            foretold = (length(p.depth_amplitude), "" if every != every else f"{every:.3g} s")
        seen = ("none", "")
        if s is not None and s.cycles:
            seen = (length(s.amplitude), f"{s.period:.3g} s")
        a, t = c.errors
        error = "" if math.isnan(a) or p.bound else f"{100 * a:+.0f} %, {100 * t:+.0f} %"
        rows.append((p.source, kind, *foretold, *seen, error))
    return rows


def robustness_rows(stood: Sequence[Stood]) -> list[tuple[str, ...]]:
    """Return the table of robustness: law, delay, then what share settled with each gain."""
    gains = sorted({s.gain for s in stood})
    rows: list[tuple[str, ...]] = []
    for law, delay in dict.fromkeys((s.law, s.delay) for s in stood):
        own = {s.gain: s for s in stood if (s.law, s.delay) == (law, delay)}
        cells = [
            f"{100 * own[g].settled:.0f}{'!' if own[g].radius >= 1.0 else ''} "
            f"({100 * own[g].overshoot_95:.1f})"
            if g in own
            else ""
            for g in gains
        ]
        rows.append((law, f"{delay:g} s", *cells))
    return rows
