"""What `simulate` writes and says: the files, the steps' numbers, the JSON object, the table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swimbladder.cli.common import labelled, progress, table

if TYPE_CHECKING:
    from swimbladder.io.mission import Mission
    from swimbladder.physics.seawater import Column
    from swimbladder.sim.closed_loop import Solution

_STEP = (
    "time_s", "start_depth_m", "target_depth_m", "overshoot_pct", "rise90_s", "settle2_s",
    "final_depth_m", "peak_volume_m3", "volume_range_m3", "actuator_travel_m3",
)  # fmt: skip


def write_files(
    s: Solution, task: Mission, column: Column | None, folder: Path, *, netcdf: bool, plot: bool
) -> list[Path]:
    """Write the files that were asked for and return their paths."""
    import numpy as np

    from swimbladder.io.tables import write_csv

    known = {
        "time_s": s.time,
        "depth_m": s.depth,
        "speed_m_s": s.speed,
        "volume_m3": s.volume,
        "voltage_V": s.voltage,
        "reference_volume_m3": s.volume_reference,
        "current_A": s.current,
        "power_W": s.power,
        "reference_depth_m": s.reference,
        "volume_change_m3": np.where(np.isnan(s.drive), np.nan, s.command),
        "volume_rate_m3_s": np.where(np.isnan(s.drive), np.nan, s.motor_rate),
        "drive": s.drive,
    }
    columns = {name: values for name, values in known.items() if not np.all(np.isnan(values))}
    with progress("writing trajectory.csv", len(s.time)) as advance:
        files = [write_csv(folder / "trajectory.csv", columns, advance=advance)]
    if netcdf:
        with progress("writing trajectory.nc"):
            from swimbladder.io.tables import write

            title = f"{s.vehicle.name}: {task.name or 'mission'}, simulated in closed loop"
            if column is not None:
                title += f" in the water of {column.source}"
            files.append(write(folder / "trajectory.nc", s.dataset(), title=title))
    if plot:
        with progress("drawing trajectory.png"):
            from swimbladder.show.plots import plot_solution

            files.append(folder / "trajectory.png")
            plot_solution(s, files[-1])
    return files


def steps_of(s: Solution, task: Mission) -> list[dict[str, Any]]:
    """Return what each set-point's step did, up to where the simulation came."""
    import numpy as np

    from swimbladder.sim.closed_loop import step_metrics

    steps = []
    ends = [point.time for point in task.setpoints[1:]] + [task.span]
    before = task.start_depth
    for point, end in zip(task.setpoints, ends, strict=True):
        first, last = np.searchsorted(s.time, [point.time, end], side="left")
        piece = slice(int(first), int(last) + 1)
        if s.time[piece].size < 2:
            break
        m = step_metrics(s.time[piece], s.depth[piece], start=before, target=point.depth)
        volume = s.volume[piece]
        events = [e for e in s.events if point.time <= e.time < end]
        steps.append(
            {
                "time_s": point.time,
                "start_depth_m": before,
                "target_depth_m": point.depth,
                "overshoot_pct": m.overshoot_pct,
                "rise90_s": m.rise90_s,
                "settle2_s": m.settle2_s,
                "final_depth_m": m.final_depth_m,
                "peak_volume_m3": float(np.max(np.abs(volume))),
                "volume_range_m3": [float(volume.min()), float(volume.max())],
                "actuator_travel_m3": float(np.sum(np.abs(np.diff(volume)))),
                "events": [{"time_s": e.time, "kind": e.kind} for e in events],
            }
        )
        before = point.depth
    return steps


def answer_of(
    s: Solution,
    task: Mission,
    steps: list[dict[str, Any]],
    column: Column | None,
    notes: Sequence[str],
) -> dict[str, Any]:
    """Return the JSON object: the last step's numbers, and all steps."""
    last = steps[-1] if steps else dict.fromkeys(_STEP)
    return {
        "vehicle": s.vehicle.name,
        "mission": task.name,
        **{key: value for key, value in last.items() if key != "events"},
        "duration_s": float(s.time[-1]),
        "samples": len(s.time),
        "completed": s.finished,
        "deepest_m": s.deepest,
        "within_depth_limit": s.within_depth_limit,
        "energy_J": s.books.energy["source"],
        "energy_basis": s.books.basis,
        "stop_reason": s.stop.value,
        "events": [{"time_s": e.time, "kind": e.kind} for e in s.events],
        "events_left_out": s.events_left_out,
        "steps": steps,
        "water": None if column is None else column.source,
        "notes": list(notes),
    }


def shown(answer: dict[str, Any]) -> Iterator[object]:
    """Give what is printed: the table of steps, the events, the notes."""

    def number(value: float | None, unit: str, digits: int = 1) -> str:
        return "never" if value is None else f"{value:.{digits}f} {unit}"

    headings = ("at", "step", "overshoot", "90 % rise", "2 % settling", "final", "peak", "travel")
    rows = []
    for step in answer["steps"]:
        moves = step["target_depth_m"] != step["start_depth_m"]
        took = (number(step[name], "s") for name in ("rise90_s", "settle2_s"))
        rows.append(
            (
                f"{step['time_s']:g} s",
                f"{step['start_depth_m']:g} to {step['target_depth_m']:g} m",
                number(step["overshoot_pct"], "%"),
                *(took if moves else ("no step", "no step")),
                number(step["final_depth_m"], "m", 3),
                number(step["peak_volume_m3"] * 1e6, "cm3"),
                number(step["actuator_travel_m3"] * 1e6, "cm3"),
            )
        )
    water = f" in the water of {answer['water']}" if answer["water"] else ""
    yield f"{answer['vehicle']}{water}, {answer['duration_s']:g} s in {answer['samples']} samples"
    yield table(headings, rows, left=())
    yield "peak: largest volume to either side of mid-stroke; travel: volume moved in all"
    kinds = [event["kind"] for event in answer["events"]]
    for kind in dict.fromkeys(kinds):
        at = next(e["time_s"] for e in answer["events"] if e["kind"] == kind)
        times = f"{kinds.count(kind)} times, first " if kinds.count(kind) > 1 else ""
        yield f"{kind} {times}at {at:.6g} s"
    if answer["energy_basis"].startswith("electrical"):
        yield f"energy: {answer['energy_J']:.4g} J, {answer['energy_basis']}"
    yield answer["stop_reason"]
    yield from labelled("note", answer["notes"])
