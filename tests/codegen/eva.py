"""The generated C under Frama-C Eva, for any bits as what the sensors say.

Eva (abstract interpretation) follows proof/any_bits.c: a vehicle and its black box in memory that
held anything, switched on, their tick for ever, armed or begun anew at any of them. What it shows
holds for every run at once: nothing read that was not written, nothing outside its memory, no
shift, sum or conversion of a number that C leaves undefined, and a command that is finite and
within its limits. Infinities and NaN are numbers here, as in IEEE 754: the laws count on them.

One fact Eva cannot see for itself: that the bits which `swb_known` looks at say whether a number is
finite. It is given to it as a comment where the controller has asked, and proven for each of the
2^32 numbers by proof/every_number.c. What Eva leaves open stands in proof/open.toml, with reasons.
"""

import csv
import tomllib
from pathlib import Path
from typing import NamedTuple

from swimbladder.codegen.library import Library, write_library
from tests.codegen import fuzz
from tests.codegen.build import run

HERE = Path(__file__).parent / "proof"
CHIPS = {"8 bit": ("gcc_x86_16", "-msse2 -mfpmath=sse"), "64 bit": ("gcc_x86_64", "")}
"""Of Frama-C's machines those whose `int` is an AVR's, and a host's."""

_APART = {
    "swb_box_known": 20,
    "swb_box_begin": 20,
    "swb_box_save": 10,
    "swb_vehicle_switch_on": 10,
    "swb_vehicle_held": 10,
    "hold": 10,
    "tick_box": 10,
}
"""Functions in which so many states are kept apart: what they answer says something of the rest."""

_ANSWERS = ("swb_box_known", "swb_box_save", "swb_vehicle_held")

_ASKED = "    c->state = state;\n"  # in swb_controller.c, after the command was found to be finite
_FACT = "    /*@ admit known: \\is_finite(command); */\n"


class Property(NamedTuple):
    """What Eva was to show somewhere, and whether it did."""

    file: str
    function: str
    text: str
    status: str


def properties(
    made: Library, folder: Path, chip: str = "64 bit", *, precision: int = 0
) -> list[Property]:
    """Return what Eva says of a library's C and of the program that drives it."""
    write_library(made, folder / "library")
    src = folder / "library" / "src"
    controller = src / "swb_controller.c"
    text = controller.read_text()
    assert text.count(_ASKED) == 1
    controller.write_text(text.replace(_ASKED, _FACT + _ASKED))
    defines = fuzz.defines(made) + ["-DDRIVE"] * (src / "swb_drive.c").exists()
    machine, flags = CHIPS[chip]
    table = folder / "properties.csv"
    said = run(
        "frama-c",
        "-eva",
        f"-cpp-extra-args=-I{src} {' '.join(defines)} {flags}",
        *("-machdep", machine),
        *("-warn-special-float", "none"),
        *("-eva-precision", precision),
        *("-eva-slevel-function", ",".join(f"{name}:{n}" for name, n in _APART.items())),
        *("-eva-split-return-function", ",".join(f"{name}:full" for name in _ANSWERS)),
        HERE / "any_bits.c",
        *sorted(src.glob("*.c")),
        *("-then", "-report-csv", table),
        text=True,
    ).stdout
    assert "Values at end of function main:\n  NON TERMINATING FUNCTION" in said, said[-4000:]
    with table.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE))
    return [Property(r["file"], r["function"], r["property"], r["status"]) for r in rows]


def left_open(found: list[Property]) -> set[str]:
    """Return what was not shown, as "file: function: property".

    Frama-C's own models of the C library are considered valid; so is the fact given to it.
    """
    shown = ("Valid", "Considered valid", "Dead")
    return {f"{p.file}: {p.function}: {p.text}" for p in found if p.status not in shown}


def commands_shown(found: list[Property]) -> dict[str, str]:
    """Return what was shown of the command at every tick, by what it is."""
    return {p.text: p.status for p in found if (p.file, p.function) == ("any_bits.c", "main")}


def allowed(name: str) -> set[str]:
    """Return what a library's proof may leave open."""
    text = (HERE / "open.toml").read_text(encoding="utf-8")
    return {
        one["property"]
        for one in tomllib.loads(text)["open"]
        if name in one.get("libraries", [name])
    }
