"""A law's tree written as C99 in float32: no heap, no recursion, no double, no libm but sqrtf.

Counts are uint16_t, and helpers keep every sum and difference of them within it.
Each operation is one rounding in the order of the Python source. C may contract ``a * b + c`` into
one rounding where a processor can; the file forbids it and refuses to be compiled where the
arithmetic would not be that of float32.
"""

from __future__ import annotations

import re
import textwrap
from typing import NamedTuple

from swimbladder.codegen.c_expressions import ARITHMETIC, CALLED, HELPERS
from swimbladder.codegen.c_flow import calls_of, fields_read
from swimbladder.codegen.c_functions import FunctionText, shortened
from swimbladder.codegen.c_places import (
    Home,
    c_field,
    c_float,
    c_law,
    c_record,
    c_type,
    home_of,
    in_place,
    remarks,
)
from swimbladder.codegen.tree import BOOL, COUNT, Function, Program, Record


class CSource(NamedTuple):
    """The files of a law: a header and its source, beside ``swb_measurement.h``."""

    header_name: str
    header: str
    source_name: str
    source: str


def write_c99(program: Program, *, private: bool = False) -> CSource:
    """Return the C of a law.

    private: its functions are static, in a header for the one file that calls them.
    """
    stem = f"swb_{c_law(program.name)}"
    source_name = f"{stem}_step.h" if private else f"{stem}.c"
    return CSource(f"{stem}.h", _header(program, private), source_name, _source(program, private))


def _header(program: Program, private: bool) -> str:
    law = c_law(program.name)
    guard = f"SWB_{law.upper()}_H"
    parts = [
        _remark(
            f"The control law {program.name}: {shortened(program.words)}. Written by swimbladder "
            "from the law's Python source; all numbers are SI."
        ),
        f"#ifndef {guard}", f"#define {guard}", "", *_included(program), *_standard(program),
        "#ifdef __cplusplus", 'extern "C" {', "#endif", "", *_structs(program),
        *([] if private else _prototypes(program)),
        "#ifdef __cplusplus", "}", "#endif", "", "#endif", "",
    ]  # fmt: skip
    return "\n".join(parts)


def _prototypes(program: Program) -> list[str]:
    return [
        "/* The state to begin with. */",
        f"void {_initial(program)};", "",
        _remark(
            f"{shortened(program.step.words)}. Writes the new state, and to next_s the time to the "
            "next call [s]."
        ),
        f"float {_step(program)};", "",
    ]  # fmt: skip


def _remark(text: str) -> str:
    """Return a comment of lines that are short enough."""
    return "/* " + "\n * ".join(textwrap.wrap(text, 94)) + " */"


def _included(program: Program) -> list[str]:
    return ['#include "swb_measurement.h"', ""] if program.measurement.name == "measurement" else []


def _standard(program: Program) -> list[str]:
    """Return the headers of the types that the law's own records have."""
    kinds = {kind for record in program.own() for _, kind in record.fields}
    wanted = {BOOL: "#include <stdbool.h>", COUNT: "#include <stdint.h>"}
    found = [line for kind, line in wanted.items() if kind in kinds]
    return [*found, ""] if found else []


def _structs(program: Program) -> list[str]:
    """Return the law's own records, save what it sees where every law sees that."""
    return [
        _struct(program.name, record) for record in program.own() if record.name != "measurement"
    ]


def _initial(program: Program) -> str:
    law, seen = c_law(program.name), c_record(program.name, program.measurement)
    return (
        f"swb_{law}_initial(const swb_{law}_parameters *p, const {seen} *m,\n"
        f"                  float reference, swb_{law}_state *state)"
    )


def _step(program: Program) -> str:
    law, seen = c_law(program.name), c_record(program.name, program.measurement)
    return (
        f"swb_{law}_step(const swb_{law}_parameters *p, swb_{law}_state *state,\n"
        f"               const {seen} *m, float reference, float *next_s)"
    )


def _struct(law: str, record: Record, read: dict[str, set[str]] | None = None) -> str:
    said = remarks(record.kind)
    lines = ["typedef struct {"]
    for name, kind in record.fields:
        if read is not None and name not in read[record.name]:
            continue
        comment = f" /* {said[name]} */" if said.get(name) else ""
        lines.append(f"    {c_type(law, kind)} {c_field(name)};{comment}")
    return "\n".join([*lines, f"}} {c_record(law, record)};", ""])


def _source(program: Program, private: bool) -> str:
    law = c_law(program.name)
    types = {c_record(program.name, r) for r in program.records}
    names = {f: _helper(f"swb_{law}_{f.name}", types) for f in program.helpers}
    fields = fields_read(program)
    placed = in_place(program)

    def text_of(f: Function, home: Home | None = None) -> FunctionText:
        return FunctionText(program.name, f, names, fields, home, placed)

    calls = calls_of(program)
    helpers = {
        names[f]: text_of(f, home_of(f, f.returns, placed) if f in placed else None).helper(
            names[f], calls[f]
        )
        for f in program.helpers
    }
    initial = text_of(program.initial)
    step = text_of(program.step, home_of(program.step, program.state, placed))
    linkage = "static " if private else ""
    entries = [
        initial.initial(f"{linkage}void {_initial(program)}"),
        step.step(f"{linkage}float {_step(program)}"),
    ]
    used = _used("\n".join(entries), helpers)
    functions = "\n".join([*(helpers[n] for n in helpers if n in used), *entries])
    own = {record.name for record in program.own()}
    structs = [
        _struct(program.name, r, fields)
        for r in program.records
        if r.name not in own and re.search(rf"\b{c_record(program.name, r)}\b", functions)
    ]
    constants = [
        f"static const float SWB_{c.name} = {c_float(c.value)};\n"
        for c in program.constants
        if re.search(rf"\bSWB_{c.name}\b", functions)
    ]
    wanted = _used(functions, HELPERS)
    arithmetic = [HELPERS[n] for n in HELPERS if n in wanted]
    text = "\n".join([*structs, *arithmetic, functions])
    includes = {
        "math.h": re.search(r"\b(sqrtf|INFINITY|NAN)\b", text + "".join(constants)),
        "stdbool.h": re.search(r"\bbool\b", text),
        "stdint.h": re.search(r"\buint(16|32)_t\b", text),
        "string.h": re.search(r"\bmem(cpy|set)\b", text),
    }
    parts = [
        f"/* The control law {program.name}, translated from its Python source by swimbladder.",
        " * float32 throughout: the float32 twin of the law gives the same bits. */",
        f'#include "swb_{law}.h"', "",
    ]  # fmt: skip
    listed = [f"#include <{name}>" for name, found in includes.items() if found]
    parts += [*listed, ""] if listed else []
    parts += [ARITHMETIC, *([CALLED] if "SWB_CALLED" in text else [])]
    parts += ["".join(constants)] if constants else []
    if private:
        guard = f"SWB_{law.upper()}_STEP_H"
        parts, text = [f"#ifndef {guard}", f"#define {guard}", "", *parts], f"{text}\n#endif\n"
    return "\n".join([*parts, text])


def _helper(name: str, types: set[str]) -> str:
    """Return the name of a helper that is neither a type's nor that of the law's own functions."""
    taken = name in types or name.rsplit("_", 1)[-1] in ("step", "initial")
    return f"{name}_value" if taken else name


def _used(text: str, helpers: dict[str, str]) -> set[str]:
    """Return the helpers that a text calls, and those that they call."""
    found: set[str] = set()
    texts = [text]
    while texts:
        now = texts.pop()
        for name, body in helpers.items():
            if name not in found and f"{name}(" in now:
                found.add(name)
                texts.append(body)
    return found
