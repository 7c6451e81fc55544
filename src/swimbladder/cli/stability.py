"""``swimbladder stability``: how stable a vehicle is under its law, and from where it recovers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.common import compile_notice, json_text, kept, output, progress
from swimbladder.cli.options import Files, Options, Read, grouped
from swimbladder.errors import NoAnswerError

if TYPE_CHECKING:
    from swimbladder.design.stability import Stability


@dataclass(frozen=True)
class Asked(Options):
    """What is looked at, as `design.stability.stability` has it."""

    depths: Annotated[
        str, typer.Option("--depth", metavar="LEAST:MOST", help="Depths it is for.")
    ] = "0:10 m"
    delay: Annotated[
        str, typer.Option(metavar="SHARE", help="From sample to command, of a sample.")
    ] = "10 %"
    within: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
            help="In which a disturbance is to be gone (600 s; of a float half as long again as "
            "the way, and an hour).",
        ),
    ] = None
    cells: Annotated[int, typer.Option(metavar="N", help="Of a map, to a side.")] = 21
    voltage_quantum: Annotated[
        str, typer.Option(metavar="VOLTAGE", help="Step of the motor's driver (none).")
    ] = "0 V"
    no_maps: Annotated[
        bool, typer.Option("--no-maps", help="Leave out from where it recovers.")
    ] = False
    with_robustness: Annotated[
        bool, typer.Option("--robustness", help="Try gains of 0.5 to 2 and half a sample late.")
    ] = False
    laws: Annotated[
        list[str] | None,
        typer.Option("--law", metavar="LAW", help="With --robustness: this law too, tuned first."),
        Read(lambda texts, _: tuple(texts)),
    ] = None
    draws: Annotated[int, typer.Option(metavar="N", help="Vehicles of each trial.")] = 200


@grouped(out=Path("swimbladder-stability"))
def stability(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    *,
    asked: Asked,
    to: Files,
) -> None:
    r"""Say how stable a vehicle is under its law: small motions, limit cycles, large motions.

    Eigenvalues and margins over all that is not known of the vehicle; limit cycles of dead zones,
    quanta and limits, foretold and simulated; maps of what it recovers from. Exit code 1 says
    that it is unstable, and with which parameters. A run that was killed goes on where it was.
    """
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import check_place, publish, unfinished, write_atomically

    v = load_vehicle(vehicle)
    options = asked.given()
    options["maps"] = not options.pop("no_maps")
    check_place(to.out)
    keep = unfinished(to.out)
    with progress("loading the simulator"):
        from swimbladder.design.stability import stability as find
        from swimbladder.jobs import Store
        from swimbladder.show.plots.stability import draw_recovery, draw_robustness
        from swimbladder.show.plots.style import save
    doing = "looking for what is unstable"
    with kept(keep), compile_notice(), progress(doing, 1.0) as advance:
        found = find(v, **options, keep=keep, advance=advance)
    answer = found.to_json()
    names = ["stability.json", "stability.txt"]

    def write(folder: Path) -> None:
        write_atomically(folder / "stability.json", json_text(answer) + "\n")
        write_atomically(folder / "stability.txt", "\n".join(found.sentences) + "\n")
        for one in found.maps:
            write_atomically(folder / f"map-{one.name}.csv", one.csv())
        if found.maps:
            save(draw_recovery(found), folder / "maps.png")
        if found.stood:
            save(draw_robustness(found), folder / "robustness.png")

    if found.maps:
        names += [*(f"map-{one.name}.csv" for one in found.maps), "maps.png"]
    if found.stood:
        names.append("robustness.png")
    with progress("writing the pictures"):
        publish(to.out, write)
    Store(keep).forget()
    to.answer(answer, [to.out / name for name in names], lambda: _print(found))
    if not found.stable:
        raise NoAnswerError("the loop is not stable over the range that was asked for")


def _print(found: Stability) -> None:
    from rich.table import Table

    from swimbladder.design.stability.run import cycle_rows, robustness_rows

    output.print(
        f"{found.vehicle}, law {found.law}, sampled every {found.sample_time:g} s", soft_wrap=True
    )
    output.print("")
    for sentence in found.sentences:
        output.print(sentence, soft_wrap=True)
    tables: list[tuple[tuple[str, ...], list[tuple[str, ...]]]] = []
    if found.cycles:
        headings: tuple[str, ...] = (
            "limit cycle from", "kind", "predicted", "every", "simulated", "every", "error",
        )  # fmt: skip
        tables.append((headings, cycle_rows(found.cycles)))
    if found.stood:
        gains = sorted({s.gain for s in found.stood})
        headings = ("settle (over) [%]", "late", *(f"gain {g:g}" for g in gains))
        tables.append((headings, robustness_rows(found.stood)))
    for headings, rows in tables:
        output.print("")
        table = Table(box=None, pad_edge=False, collapse_padding=True)
        for n, heading in enumerate(headings):
            table.add_column(heading, justify="left" if n < 2 else "right")
        for row in rows:
            table.add_row(*row)
        output.print(table)
    output.print("")
    for sentence in found.words:
        output.print(f"assumed: {sentence}", soft_wrap=True)
