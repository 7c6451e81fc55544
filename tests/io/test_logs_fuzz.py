"""Any bytes, in any format, are read or refused: never another error, never no end."""

import contextlib
import gzip
import random
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from swimbladder.errors import InputError
from swimbladder.io.log_format import COLUMNS, LogColumn, LogFormat, log_format
from swimbladder.io.log_formats import FORMATS
from swimbladder.io.logs import Log, header_names, read_log

# logs, with the columns and the options that they are meant to be read with
DRESSES: tuple[tuple[str, dict[str, str], dict[str, object]], ...] = (
    (
        "time_s,depth_m,piston_m\n0,1.0,0\n0.5,1.1,0\n1.0,1.2,0.001\n1.5,1.3,0.001\n2,1.4,0\n",
        {},
        {},
    ),
    (
        "# a remark\nlogger 3\nTime;Depth [cm];U (mV)\n0,0;100;5\n0,5;110,5;5\n1,0;120;7\n",
        {"time_s": "Time@s", "depth_m": "Depth [cm]", "voltage_V": "U (mV)"},
        {"decimal": ","},
    ),
    (
        "t\tP [dbar]\nms\tdbar\n65000\t10,1\n400\t10,2\n900\t10,3\n",
        {"time_s": "t", "pressure_Pa": "P [dbar]"},
        {
            "decimal": ",",
            "units_row": True,
            "counter_bits": 16,
            "water_density": 1000.0,
            "atmospheric_pressure": "first",
        },
    ),
    (
        '"when","z","note"\n"2024-02-29T23:59:59Z",1,"a\nb"\n"2024-03-01T00:00:00Z",2,"5"""\n',
        {"time_s": "when@iso", "depth_m": "z"},
        {},
    ),
    (
        "day clock z\n31.12.2023 23:59:58 1\n01.01.2024 00:00:01 2\n",
        {"time_s": "day+clock@%d.%m.%Y %H:%M:%S", "depth_m": "z"},
        {},
    ),
    (
        "Vehicle\r\x13\x01\xb7Time[ms],z\r0,1,7,8\r500,2,7,8\r1000,3,7,8\r",
        {"time_s": "Time[ms]", "depth_m": "z"},
        {"header_starts": "Time", "fields": 4},
    ),
    (
        "0|1|a\n1|2|a\n2|3|b\n3|4|b\n4|9|b\n5|6|b\n6|7|b\n",
        {"time_s": "t@tick", "depth_m": "z"},
        {"names": ["t", "z", "run"], "tick": "32768 Hz", "where": {"run": "b"}},
    ),
    ("t,depth_m\n23:59:59,1\n00:00:00,2\n00:00:01,3\n", {"time_s": "t@clock"}, {}),
)
NAMES = st.sampled_from(
    [
        "time_s",
        "depth_m",
        "Time",
        "t",
        "when",
        "day",
        "clock",
        "Depth [cm]",
        "z",
        "U (mV)",
        "P [dbar]",
        "Time[ms]",
        "piston_m",
        "note",
        "",
        "day+clock",
    ]
)
UNITS = st.sampled_from(
    [
        "s",
        "ms",
        "iso",
        "clock",
        "tick",
        "%d.%m.%Y",
        "%H:%M",
        "%",
        "%%",
        "%Y%",
        "cm",
        "dbar",
        "V",
        "kg",
        "km",
        "GPa",
        "d",
        "",
        "[",
        "1/s",
        "%d.%m.%Y %H:%M:%S",
    ]
)
column = st.one_of(
    NAMES,
    st.builds("{}@{}".format, NAMES, UNITS),
    st.builds(
        lambda name, unit, date: {"name": name, "unit": unit, "date": date},
        NAMES,
        st.none() | UNITS,
        st.none() | NAMES,
    ),
)
number = st.integers(-2, 70) | st.floats(width=32)
quantity = number | st.sampled_from(
    [
        "998 kg/m3",
        "1 kg/L",
        "30.5 us",
        "32768 Hz",
        "0 Hz",
        "gauge",
        "first",
        "first 10 s",
        "9.81",
        "1013 mbar",
        "5 mm",
        "1e308 m",
        "-1 cm3",
        "x",
        "",
    ]
)
GOOD: dict[str, st.SearchStrategy[object]] = {
    "encoding": st.sampled_from(["utf-8", "utf-16-le", "latin-1", "cp1252", "shift_jis"]),
    "delimiter": st.sampled_from([",", ";", "\t", "|", " "]),
    "decimal": st.sampled_from([".", ","]),
    "comment": st.sampled_from(["#", "%", "//", "0"]),
    "missing": st.lists(st.sampled_from(["-999", "x", "", "1.0"]), max_size=2),
    "header_starts": st.sampled_from(["Time", "t", "\x13", ","]),
    "names": st.lists(NAMES, min_size=1, max_size=4),
    "skip_lines": st.integers(0, 4),
    "units_row": st.booleans(),
    "skip_rows": st.integers(0, 3),
    "fields": st.integers(1, 5),
    "part": st.integers(1, 2),
    "bad_rows": st.sampled_from(["refuse", "drop"]),
    "rows": st.sampled_from(["ordered", "sort"]),
    "tick": st.sampled_from(["30.5 us", "32768 Hz", 1e-3]),
    "counter_bits": st.integers(8, 64),
    "gap": st.floats(1e-9, 1e9),
    "spikes": st.sampled_from(["report", "drop"]),
    "volume_zero": st.sampled_from(["first", "5 cm3", 1e15]),
    "piston_zero": st.sampled_from(["first", "5 mm", -1e15]),
    "piston_positive": st.sampled_from(["in", "out"]),
    "depth_positive": st.sampled_from(["up", "down"]),
    "water_density": st.floats(900.0, 1300.0),
    "gravity": st.floats(9.7, 9.9),
    "atmospheric_pressure": st.sampled_from(["gauge", "first", "first 10 s", "1 bar", -1e300]),
    "depth_offset": st.floats(-1e3, 1e3),
    "where": st.dictionaries(NAMES, number | st.sampled_from(["a", "b", "1", "nan"]), max_size=1),
}
BAD: dict[str, st.SearchStrategy[object]] = {
    **dict.fromkeys(("tick", "gap", "volume_zero", "piston_zero", "water_density"), quantity),
    **dict.fromkeys(("gravity", "atmospheric_pressure", "logger_density"), quantity),
    **dict.fromkeys(("skip_lines", "skip_rows", "fields", "part", "counter_bits"), number),
    **dict.fromkeys(("encoding", "delimiter", "decimal", "comment", "header_starts"), NAMES),
    "columns": st.dictionaries(st.sampled_from([*COLUMNS, "z"]), column, max_size=4),
    "where": st.dictionaries(NAMES, number | st.lists(number, max_size=1), max_size=2),
    "names": st.lists(NAMES, max_size=2) | NAMES,
}


def some(of: dict[str, st.SearchStrategy[object]], most: int) -> st.SearchStrategy[dict]:
    """Return a few of these options."""
    return st.lists(st.sampled_from(sorted(of)), max_size=most, unique=True).flatmap(
        lambda names: st.fixed_dictionaries({name: of[name] for name in names})
    )


required = st.lists(st.sampled_from(list(COLUMNS)), max_size=3)


def check(path: Path, **given_options) -> bool:
    """Read a log; say whether that was possible. Anything but a refusal gets through."""
    try:
        log = read_log(path, **given_options)
    except InputError as error:
        brief = len(str(error)) < 5000
    else:
        _is_sound(log, given_options.get("required", ("depth_m",)))
        return True
    assert brief
    return False


def _is_sound(log: Log, needed: Sequence[str]) -> None:
    n = len(log)
    assert n >= 2
    for values in (log.time, log.depth, log.line, log.suspect):
        assert len(values) == n
    assert np.isfinite(log.time).all()
    assert (np.diff(log.time) > 0.0).all()
    if "depth_m" in needed:
        assert np.isfinite(log.depth).all()
    assert all(after > before for before, after in log.gaps)


def format_of(toml: Path) -> LogFormat | None:
    """Return the log format of a file, None where it is refused by the name of the file."""
    try:
        return log_format(toml)
    except InputError as error:
        named = error.file
    assert named == toml
    return None


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("fuzz") / "fuzz.csv"


@given(data=st.binary(max_size=300), form=st.sampled_from([None, *FORMATS.names()]))
@example(data=b"time_s,depth_m\n0,1\n\x00,2\n", form=None)
@example(data=b"time_s,depth_m\n0,1\n" + b"9" * 400 + b",2\n", form=None)
@example(data=b'time_s,depth_m\n"0,1\n1,2\n', form=None)
@example(data=b"time_s,depth_m\n0,1e308\n1,-1e308\n2,1e308\n", form=None)
@example(data=b"PAR1" + bytes(40) + b"PAR1", form=None)
def test_any_bytes(file: Path, data: bytes, form: str | None) -> None:
    for start in (b"", b"time_s,depth_m\n", b"time_s;depth_m\n0;1\n1;2\n", b"Time[ms],z\r0,1\r"):
        for content in (start + data, gzip.compress(start + data, 1, mtime=0)):
            file.write_bytes(content)
            check(file, log_format=form)
    file.write_bytes(b"\x1f\x8b\x08" + data)
    check(file)


def form_of(given_options: dict[str, object]) -> LogFormat | None:
    try:
        return LogFormat(**given_options)
    except InputError:
        return None


@given(data=st.binary(max_size=60), few=some(GOOD, 3), needed=required)
def test_any_bytes_in_any_format(file: Path, data: bytes, few, needed) -> None:
    file.write_bytes(b"time_s,depth_m,P [dbar]\n0,1,2\n1,2,3\n2,3,4\n" + data)
    if (form := form_of(few)) is not None:
        check(file, log_format=form, required=needed)


@given(few=some(GOOD, 2), wrong=some(BAD, 2), column_of=st.sampled_from(list(COLUMNS)))
def test_any_options(file: Path, few, wrong, column_of) -> None:
    file.write_bytes(DRESSES[0][0].encode())
    if (form := form_of({**few, **wrong})) is not None:
        check(file, log_format=form, required=(column_of,))


edit = st.tuples(
    st.integers(0, 200),
    st.integers(0, 6),
    st.sampled_from(
        [
            b"",
            b",",
            b";",
            b'"',
            b"\n",
            b"\r",
            b"\0",
            b"-",
            b".",
            b"9" * 30,
            b"e99",
            b"\xff",
            b"#",
            b"nan",
            b"\t",
            b"time_s",
            b"_",
            b"\xe2\x88\x92",
            b" ",
        ]
    )
    | st.binary(max_size=4),
)


@given(
    dress=st.sampled_from(DRESSES),
    edits=st.lists(edit, max_size=3),
    few=some(GOOD, 2),
    others=st.dictionaries(st.sampled_from(list(COLUMNS)), column, max_size=1),
)
def test_logs_with_damage_in_any_format(file: Path, dress, edits, few, others) -> None:
    text, columns, given_options = dress
    data = text.encode("latin-1")
    for at, length, by in edits:
        data = data[:at] + by + data[at + length :]
    file.write_bytes(data)
    with contextlib.suppress(InputError):
        header_names(file)
    form = form_of({**given_options, **few})
    try:
        mapped = {k: LogColumn(**v) if isinstance(v, dict) else v for k, v in others.items()}
    except InputError:
        return
    if form is not None:
        check(file, log_format=form, columns={**columns, **mapped})


@pytest.mark.parametrize("dress", DRESSES)
def test_logs_without_damage_are_read(file: Path, dress) -> None:
    text, columns, given_options = dress
    file.write_bytes(text.encode("latin-1"))
    assert check(file, log_format=LogFormat(**given_options), columns=columns)


field = st.one_of(
    st.integers(-5, 5).map(str),
    st.floats(allow_nan=True).map(repr),
    st.sampled_from(["", "1,5", "x", "-", "1e999", "nan", "-999", "1e15", "1e-320"]),
)


@given(rows=st.lists(st.tuples(field, field, field), max_size=25))
def test_any_fields(file: Path, rows: list[tuple[str, ...]]) -> None:
    lines = "".join(f"{a};{b};{c}\n" for a, b, c in rows)
    file.write_text(f"time_s;depth_m;volume_m3\n{lines}", encoding="utf-8")
    tolerant = LogFormat(rows="sort", bad_rows="drop", spikes="drop", missing=("-999",))
    for form in (LogFormat(), tolerant):
        check(file, log_format=form, required=("depth_m",))
        check(file, log_format=form, required=())


texts = st.text(st.sampled_from('0123456789-:.,TZ+ 年Wd"'), max_size=25)


@given(
    times=st.lists(texts | st.datetimes().map(str), min_size=2, max_size=5),
    unit=st.sampled_from(["iso", "clock", "%d.%m.%Y %H:%M:%S", "%j %Y", "%I %p", "ms", "tick"]),
    bits=st.none() | st.sampled_from([8, 16, 64]),
)
def test_any_times(file: Path, times: list[str], unit: str, bits: int | None) -> None:
    file.write_text("t;depth_m\n" + "".join(f"{t};1\n" for t in times), encoding="utf-8")
    form = LogFormat(
        bad_rows="drop", rows="sort", counter_bits=bits, tick=1e-3 if unit == "tick" else None
    )
    check(file, columns={"time_s": f"t@{unit}"}, log_format=form)


@given(
    lines=st.lists(
        st.sampled_from(
            [
                "[log]",
                "[log.columns]",
                "[log.where]",
                "[log.columns.time_s]",
                'delimiter = ";"',
                'decimal = ","',
                "names = []",
                'names = ["a"]',
                "units_row = 1",
                "part = true",
                'tick = "30 us"',
                "counter_bits = 1e3",
                'depth_m = "z"',
                "depth_m = { name = 3 }",
                "where = { a = [1] }",
                'columns = "x"',
                "missing = [1]",
                'name = "t"',
                "fields = 99",
                'water_density = "1 g/cm3"',
                "atmospheric_pressure = nan",
                "gap = inf",
                "x = 1",
                'comment = ""',
                "[[log]]",
                "depth_offset = 1979-05-27",
                'encoding = "rot13"',
            ]
        )
        | st.text(max_size=12),
        max_size=6,
    )
)
def test_any_log_table(file: Path, lines: list[str]) -> None:
    toml = file.with_name("form.toml")
    toml.write_text("\n".join(lines), encoding="utf-8", errors="replace")
    form = format_of(toml)
    if form is None:
        return
    file.write_text(DRESSES[0][0], encoding="ascii")
    check(file, log_format=form)


@given(at=st.integers(0, 800), length=st.integers(0, 8), by=st.binary(max_size=6))
def test_a_shipped_format_with_damage(file: Path, at: int, length: int, by: bytes) -> None:
    data = FORMATS["ntnu-bv-raw"].encode()
    toml = file.with_name("form.toml")
    toml.write_bytes(data[:at] + by + data[at + length :])
    format_of(toml)


HEAD = b"time_s,depth_m\n0,1\n1,2\n"
HUGE = {
    "a million delimiters": HEAD + b"," * 1_000_000,
    "a header of a million names": b"," * 1_000_000 + b"\n0,1\n",
    "a million names of the same": b"time_s," * 200_000 + b"depth_m\n0,1\n",
    "a field of a million digits": HEAD + b"2," + b"1" * 1_000_000 + b"\n",
    "a quoted field of a million digits": HEAD + b'2,"' + b"1" * 1_000_000 + b'"\n',
    "a million quotation marks": HEAD + b'"' * 1_000_001,
    "lines of stray quotation marks": HEAD + b'"1,2\n' * 20_000,
    "stray quotation marks in long lines": HEAD + (b'"' + b"1" * 20_000 + b"\n") * 40,
    "many blank lines": HEAD + b"\n" * 300_000 + b"2,3\n",
    "a million NULs": HEAD + b"\0" * 1_000_000,
    "NULs between line ends": HEAD + b"\0\n" * 300_000,
    "a remark of a million letters": b"#" * 1_000_000 + b"\n" + HEAD,
    "many remarks": b"# time_s depth_m\n# time_s,\n" * 20_000 + HEAD,
    "a name of a million letters": b"time_s,depth_m," + b"x" * 1_000_000 + b"\n0,1,2\n1,2,3\n",
    "a date of a million digits": b"time_s,depth_m\n" + b"2" * 1_000_000 + b"-01-01,2\n",
    "junk in gzip": gzip.compress(random.Random(1).randbytes(1_000_000), 1, mtime=0),
    "zeros in gzip": gzip.compress(bytes(20_000_000), 9, mtime=0),
    "gzip in gzip": gzip.compress(gzip.compress(HEAD, mtime=0), mtime=0),
    "a whole number of a million digits in exponents": HEAD + b"2,1e" + b"9" * 1_000_000 + b"\n",
}


@pytest.mark.parametrize(
    "content",
    [
        pytest.param(content, id=name, marks=[pytest.mark.prove] * ("million names" in name))
        for name, content in HUGE.items()
    ],
)
@pytest.mark.parametrize(
    "given_options",
    [
        {},
        {"columns": {"depth_m": "Depth"}, "log_format": LogFormat(delimiter=" ", decimal=",")},
    ],
    ids=["plain", "unknown column"],
)
def test_what_is_huge_comes_to_an_end(file: Path, content: bytes, given_options) -> None:
    file.write_bytes(content)
    check(file, **given_options)
