"""The curves of the report."""

from typing import Any

import numpy as np

from swimbladder.io.answers import attributes
from swimbladder.paper.evidence import Evidence
from swimbladder.sim.pool import Fit, PoolRun, response

_CURVES = (
    "time_s reference_depth_m=reference depth_m speed_m_s volume_m3 "
    "reference_volume_m3=volume_reference voltage_V"
)


def trajectories(e: Evidence) -> dict[str, dict[str, Any]]:
    """Return every curve of the report: file name -> columns, SI."""
    by_speed, by_depth = e.table2
    found: dict[str, dict[str, Any]] = {
        "figure-12.csv": _run(e.runs[0]),
        **{f"pool-run-{i}.csv": _run(run) for i, run in enumerate(e.runs[1:], start=2)},
    }
    for i, x in enumerate(e.experiments, start=1):
        r = x.record
        found[f"experiment-{i}.csv"] = {
            **attributes(r, "time_s volume_above_neutral_m3=volume depth_seen_m=depth"),
            "depth_by_eq27_m": r.start + _response(r, by_depth)[0],
            "speed_by_eq26_m_s": _response(r, by_speed)[1],
        }
    found["figure-16.csv"] = attributes(e.steps, _CURVES)
    found["figure-17.csv"] = attributes(e.long_step, _CURVES)
    found["figure-psi.csv"] = {
        "volume_change_m3": [dV for dV, _ in e.still_curve],
        "K2_1_m2_s": [fit.K2 for _, fit in e.still_curve],
        "T2_s": [fit.T2 for _, fit in e.still_curve],
    }
    return found


def _response(record: Any, fit: Fit) -> Any:
    return response(record.time, record.volume, K2=fit.K2, T2=fit.T2)


def _run(run: PoolRun) -> dict[str, Any]:
    """Return one run of the pool procedure; step 1 to 4 are (a) to (d), 0 is after them."""
    s = run.solution
    times = [time for time, _, _ in run.phases]
    letters = [step for _, step, _ in run.phases]
    index = np.searchsorted(times, s.time + 1e-9) - 1
    numbers = np.array([" abcd".index(letter) if letter else 0 for letter in letters])
    return {
        "time_s": s.time,
        "step": numbers[index],
        "depth_m": s.depth,
        "depth_seen_m": run.seen_depth,
        **attributes(s, "speed_m_s volume_m3"),
        "volume_seen_m3": run.seen_volume,
        "voltage_V": s.voltage,
    }
