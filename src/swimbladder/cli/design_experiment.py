"""``swimbladder design-experiment``: pool experiments, and the errors that they give."""

from pathlib import Path

from swimbladder.cli.common import working
from swimbladder.cli.options import Files, Options, Sought, VehicleName, grouped, loaded, valued
from swimbladder.cli.texts import Given, deviation
from swimbladder.errors import InputError
from swimbladder.units import quantity, unit_of, with_one_unit


def _against(text: str, option: str) -> tuple[float, ...] | None:
    """Return volume changes [m3] of a list with one unit; None: the paper's, where they fit."""
    if text.strip() == "paper":
        return None
    if text.strip() == "none":
        return ()
    parts = [part.strip() for part in text.split(",")]
    if not unit_of(parts[-1]):
        remedy = 'Write it as "20,-20,30,-30 cm3", or paper, or none'
        raise InputError("the unit is missing", field=option, value=text, unit="m3", remedy=remedy)
    return tuple(quantity(part, "m3", option) for part in with_one_unit(parts))


class Setting(Options):
    """The pool and the sensor."""

    bottom_depth: str = valued("DEPTH", "Depth of the bottom.", ...)
    depth_noise: Given = valued("DEPTH", "Depth noise, 1 sigma (the vehicle's).")
    depth_quantum: Given = valued("DEPTH", "Quantum of the depth sensor (the vehicle's).")
    sample_time: Given = valued("TIME", "Sample time (the controller's).")
    neutral_std: Given = valued(
        "VOLUME", "Prior of each log's neutral volume, 1 sigma (0.5 cm3).", read=deviation("m3")
    )
    drift_std: Given = valued("RATE", "Drift of each log's neutral volume, 1 sigma (0.1 cm3/min).")
    delay_std: str = valued("TIME", "Delay of the volumes' time stamps, 1 sigma.", "0.2 s")


class Experiments(Options):
    """The experiments, and what they are compared with."""

    pool_time: Given = valued("TIME", "Pool time, settling included (--against's; 60 min).")
    max_experiments: int | None = valued("N", "Largest number of experiments.", min=1)
    clearance: str = valued("LENGTH", "Distance from bottom and surface.", "0.75 m")
    settling: Given = valued("TIME", "Settling time before a release (simulated).")
    max_record_time: str = valued("TIME", "Longest record.", "240 s")
    max_moves: int = valued("N", "Largest number of volume changes in a record.", 4, min=1)
    max_volume_change: Given = valued("VOLUME", "Largest change of volume (the stroke's).")
    criterion: str = valued(
        "WHICH", "Criterion: largest error, D, A, or the largest of NAME,...", "largest"
    )
    uncertainty: Given = valued(
        "SHARE", "Uncertainty of the vehicle's file, 1 sigma (as identified; 30%)."
    )
    against: str = valued(
        "SET",
        'Compare with single steps, "20,-20,30,-30 cm3"; paper; none.',
        "paper",
        read=_against,
    )


@grouped(
    "bottom_depth pool_time max_experiments depth_noise free prior",
    out=Path("swimbladder-design-experiment"),
)
def design_experiment(
    vehicle: VehicleName, *, setting: Setting, sought: Sought, experiments: Experiments, to: Files
) -> None:
    """Design the most informative pool experiments, and predict the errors of their estimates.

    A plan to follow, a page to print and the errors to expect: of every parameter, after every
    experiment, and against single steps in the same time. Exit code 1: not all parameters are
    identifiable in this time.
    """
    v = loaded(vehicle, sampled=True)
    options = {**setting.given(), **sought.given(), **experiments.given()}
    with working("looking for the best experiments") as advance:
        from swimbladder.design.experiments import design_experiment as find

        found = find(v, **options, advance=advance)
    to.answer(found)
