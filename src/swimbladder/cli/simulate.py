"""``swimbladder simulate``: depth steps or a mission in closed loop, to CSV, netCDF, pictures."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.common import compile_notice, console, emit_json, output, progress, quantity
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.closed_loop import Solution
    from swimbladder.io.mission import Mission

__all__ = ["simulate"]

_START, _TARGET, _DURATION = 1.5, 3.0, 400.0
_STEP = (
    "time_s", "start_depth_m", "target_depth_m", "overshoot_pct", "rise90_s", "settle2_s",
    "final_depth_m", "peak_volume_m3", "volume_range_m3", "actuator_travel_m3",
)  # fmt: skip
_OPTIONS = {
    "start_depth": "--start",
    "setpoints[0].depth": "--target",
    "duration": "--duration",
    "bottom_depth": "--bottom",
}


def simulate(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    mission: Annotated[
        Path | None,
        typer.Argument(metavar="MISSION", help="TOML file with set-points, start and duration."),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(metavar="DEPTH", help=f"Start, at rest and neutral ({_START} m)"),
    ] = None,
    target: Annotated[
        str | None, typer.Option(metavar="DEPTH", help=f"Set-point ({_TARGET} m)")
    ] = None,
    duration: Annotated[
        str | None, typer.Option(metavar="TIME", help=f"How long ({_DURATION:g} s)")
    ] = None,
    bottom: Annotated[
        str | None, typer.Option(metavar="DEPTH", help="Depth of the bottom (none)")
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(help="Seed of the sensors' noise (sensors without noise)", min=0),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "swimbladder-simulate"
    ),
    netcdf: Annotated[bool, typer.Option("--netcdf", help="Also write trajectory.nc.")] = False,
    plot: Annotated[bool, typer.Option("--plot", help="Also write trajectory.png.")] = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False,
) -> None:
    """Simulate depth steps or a mission in closed loop.

    Depths and times are in m and s, or carry a unit: --start "150 cm" --duration "5 min".
    Exit code 1 when the simulation stopped before its end; the files are written all the same.
    """
    from swimbladder.hull import mass_doubt
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import make_folder
    from swimbladder.io.mission import check_mission

    v = load_vehicle(vehicle, sampled=True)
    task = _mission(mission, start=start, target=target, duration=duration, bottom=bottom)
    if mission is None:
        check_mission(v, task, names=_OPTIONS)
    else:
        _check_file(v, task, mission)
    doubt = mass_doubt(v)
    if doubt:
        console.print(
            f"warning: {doubt}; it sinks and rises by trim_error, and the dry mass is its inertia",
            soft_wrap=True,
        )
    folder = make_folder(out)
    s = _run(v, task, seed)
    files = _write(s, task, folder, netcdf=netcdf, plot=plot)
    steps = _steps(s, task)
    answer = _answer(s, task, steps, files)
    if json:
        emit_json(answer)
    else:
        _print(answer)
    if not (answer["completed"] and answer["within_depth_limit"]):
        if not s.finished:
            console.print(f"stopped at {s.time[-1]:.6g} s: {s.stop.value}")
        if not s.within_depth_limit:
            console.print(
                f"the vehicle went down to {s.deepest:.1f} m, below its depth limit of "
                f"{v.hull.depth_limit:g} m: it would be lost",
                highlight=False,
            )
        raise typer.Exit(1)


def _mission(path: Path | None, **given: str | None) -> Mission:
    """Return the mission of a file, or one step from the options."""
    from swimbladder.io.config import load_mission
    from swimbladder.io.mission import Mission, Setpoint

    if path is not None:
        for option, text in given.items():
            if text is not None:
                raise InputError(
                    "the mission file says this already",
                    field=f"--{option}",
                    value=text,
                    remedy=f"Leave the option out, or the file {path}",
                )
        return load_mission(path)
    units = {"start": "m", "target": "m", "duration": "s", "bottom": "m"}
    numbers = {name: quantity(given[name], unit, f"--{name}") for name, unit in units.items()}
    start, target = numbers["start"], numbers["target"]
    duration, bottom = numbers["duration"], numbers["bottom"]
    for option, number, unit in (("duration", duration, "s"), ("bottom", bottom, "m")):
        if number is not None and number <= 0.0:
            raise InputError(
                "it must be above 0",
                field=f"--{option}",
                value=given[option],
                unit=unit,
                remedy="Check the number and its unit",
            )
    depth = _TARGET if target is None else target
    return Mission(
        name="step",
        start_depth=_START if start is None else start,
        bottom_depth=bottom,
        duration=_DURATION if duration is None else duration,
        setpoints=(Setpoint(time=0.0, depth=depth),),
    )


def _check_file(vehicle: Any, task: Mission, path: Path) -> None:
    from swimbladder.io.config import locate
    from swimbladder.io.mission import check_mission

    try:
        check_mission(vehicle, task)
    except InputError as error:
        raise (error if error.field == "controller" else locate(error, path)) from None


def _run(vehicle: Any, task: Mission, seed: int | None) -> Solution:
    """Simulate; say on stderr what is waited for."""
    with progress("loading the simulator"):
        from swimbladder.closed_loop import simulate as simulate_closed_loop

    samples = task.span / vehicle.controller.sample_time
    with compile_notice(), progress("simulating", samples) as advance, _no_search_for_blas():
        done = 0

        def report(samples_done: int) -> None:
            nonlocal done
            advance(samples_done - done)
            done = samples_done

        return simulate_closed_loop(
            vehicle,
            setpoints=task.pairs,
            duration=task.span,
            start_depth=task.start_depth,
            bottom_depth=task.bottom,
            seed=seed,
            progress=report,
        )


@contextlib.contextmanager
def _no_search_for_blas() -> Iterator[None]:
    """Keep numba from importing scipy.linalg with its first kernel: 0.1 s of a run's 0.8 s.

    Numba looks there for matrix products, of which our kernels have none.
    """
    absent = "scipy.linalg" not in sys.modules
    if absent:
        sys.modules["scipy.linalg"] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        if absent:
            del sys.modules["scipy.linalg"]


def _write(s: Solution, task: Mission, folder: Path, *, netcdf: bool, plot: bool) -> list[Path]:
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
    }
    columns = {name: values for name, values in known.items() if not np.all(np.isnan(values))}
    with progress("writing trajectory.csv", len(s.time)) as advance:
        files = [write_csv(folder / "trajectory.csv", columns, advance=advance)]
    if netcdf:
        with progress("writing trajectory.nc"):
            from swimbladder.io.netcdf import write

            title = f"{s.vehicle.name}: {task.name or 'mission'}, simulated in closed loop"
            files.append(write(folder / "trajectory.nc", s.dataset(), title=title))
    if plot:
        with progress("drawing trajectory.png"):
            from swimbladder.plots import plot_solution

            files.append(folder / "trajectory.png")
            plot_solution(s, files[-1])
    return files


def _steps(s: Solution, task: Mission) -> list[dict[str, Any]]:
    """Return what each set-point's step did, up to where the simulation came."""
    import numpy as np

    from swimbladder.closed_loop import step_metrics

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


def _answer(
    s: Solution, task: Mission, steps: list[dict[str, Any]], files: list[Path]
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
        "files": [str(path) for path in files],
    }


def _print(answer: dict[str, Any]) -> None:
    """Print the table of steps, the events, and where the files are."""
    from rich.table import Table

    def number(value: float | None, unit: str, digits: int = 1) -> str:
        return "never" if value is None else f"{value:.{digits}f} {unit}"

    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for heading in (
        "at", "step", "overshoot", "90 % rise", "2 % settling", "final", "peak", "travel",
    ):  # fmt: skip
        table.add_column(heading, justify="right", no_wrap=True)
    for step in answer["steps"]:
        moves = step["target_depth_m"] != step["start_depth_m"]
        table.add_row(
            f"{step['time_s']:g} s",
            f"{step['start_depth_m']:g} to {step['target_depth_m']:g} m",
            number(step["overshoot_pct"], "%"),
            number(step["rise90_s"], "s") if moves else "no step",
            number(step["settle2_s"], "s") if moves else "no step",
            number(step["final_depth_m"], "m", 3),
            number(step["peak_volume_m3"] * 1e6, "cm3"),
            number(step["actuator_travel_m3"] * 1e6, "cm3"),
        )
    output.print(f"{answer['vehicle']}, {answer['duration_s']:g} s in {answer['samples']} samples")
    output.print(table)
    output.print("peak: largest volume to either side of mid-stroke; travel: volume moved in all")
    kinds = [event["kind"] for event in answer["events"]]
    for kind in dict.fromkeys(kinds):
        at = next(e["time_s"] for e in answer["events"] if e["kind"] == kind)
        times = f"{kinds.count(kind)} times, first " if kinds.count(kind) > 1 else ""
        output.print(f"{kind} {times}at {at:.6g} s")
    if answer["energy_basis"].startswith("electrical"):
        output.print(f"energy: {answer['energy_J']:.4g} J, {answer['energy_basis']}")
    output.print(answer["stop_reason"])
    for path in answer["files"]:
        output.print(f"wrote {path}", soft_wrap=True)
