"""Whether the numbers of a cast can be in the units they are said to be in, by the physics.

Depth shows the unit of pressure, as do density in situ, and conductivity where salinity is beside
it; the deepest trench, and what sea water can be, bound the rest. A cast in the wrong unit is
refused with the unit that fits: it would otherwise sink a vehicle that its maker thinks afloat.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from swimbladder.errors import column_as
from swimbladder.io.cast_columns import RawCast
from swimbladder.physics.arrays import Array
from swimbladder.units import unit_factor

DEEPEST = 11_500.0  # dbar: Challenger Deep has 11 250
_HOT = 32.5  # degC, and a salinity
COLDEST, WARMEST = -3.0, 45.0  # degC; freezing at 34 and 1000 dbar is -2.6
_DEEP, _WARM = 300.0, 25.0  # dbar, degC: below it no sea is as warm; the Red Sea has 22
# (dbar, degC) too: the Red Sea ends at 3000 m, the Mediterranean has 15 down to 5270 m, the Sulu
# Sea 11 to 5600 m, the Cayman Trough 5 at 7700 m, and other trenches less
_ABYSS = ((5800.0, 5.5), (3200.0, 16.0))
MOST_SALT = 42.0  # practical salinity: where PSS-78 ends, above the northern Red Sea's 41
_PRESSURES = ("bar", "mbar", "kPa", "MPa", "Pa", "psi")
_FITS = 0.05  # of the pressure: fresh, salt and gauge with one density differ by less
_ATMOSPHERE = (9.6, 10.7)  # dbar, with weather
_IN_AIR = ("mbar", "kPa", "Pa")  # units in which loggers count from vacuum
_SHARES = 0.05  # salinity: the largest of a sea is that as a share of mass, and a soft lake's
_SALT_FITS, _SALT_WRONG = 0.02, 0.1
_SEAS = (1.0, 7.5)  # S/m: a brackish sea in winter, and the Red Sea in summer at depth
_DENSITY_FITS, _DENSITY_WRONG = 0.05, 0.2  # kg/m3; EOS-80 and TEOS-10 differ by up to 0.02
_ABOVE = 0.2  # of the greatest depth: a sensor in air before a cast in shallow water is less
_HIGHEST = 5.0  # m above the surface: a sensor on deck; TEOS-10's routines take no more either
_ROWS = 3  # at least, for how warm the deep is
_SURE = 10.0  # m or dbar that a cast has to go over, for its unit to be known


def by_depth(raw: RawCast) -> bool:
    """Say whether depths beside determine the unit of the pressures."""
    return raw.pressure is not None and raw.depth is not None and bool(np.ptp(raw.depth) > _SURE)


def check_units(raw: RawCast) -> RawCast:
    """Return the cast; where its pressures hold the atmosphere too, without that.

    Raises LogError where numbers cannot be in their units, with the one that fits.
    """
    _temperature(raw)
    raw = _pressure(_downward(raw))
    _abyss(raw)
    _salt(raw)
    return raw


def _temperature(raw: RawCast) -> None:
    middle = float(np.median(raw.temperature))
    salt = np.inf if raw.salinity is None else float(np.median(raw.salinity))
    if _HOT < middle <= WARMEST and COLDEST <= salt < _HOT:  # where it is as hot, it is saltier
        what = f"water of {middle:.4g} degC and a salinity of {salt:.4g} is in no sea"
        remedy = "Their columns may have changed places: map each with its own name"
        raise raw.refused(what, remedy, "temperature_degC", value=round(middle, 3))
    what = f"a temperature of {middle:.4g} degC is none that water has in the sea"
    if COLDEST <= middle <= WARMEST:
        deep = raw.temperature[np.abs(raw.down) > _DEEP]
        if len(deep) < _ROWS or not np.median(deep) > _WARM:
            return
        middle = float(np.median(deep))
        what = f"{middle:.4g} degC below {_DEEP:g} dbar is warmer than any sea"
    remedy = "Check which column is the temperature"
    if COLDEST <= middle - 273.15 <= WARMEST:
        remedy = f"Taken as kelvin it is {middle - 273.15:.4g} degC: subtract 273.15 in the file"
    elif COLDEST <= (middle - 32.0) / 1.8 <= WARMEST:
        remedy = f"As Fahrenheit it is {(middle - 32.0) / 1.8:.4g} degC: convert it in the file"
    raise raw.refused(what, remedy, "temperature_degC", value=round(middle, 3))


def _abyss(raw: RawCast) -> None:
    """Hold temperatures against those of the deepest seas: a cast in kPa is ten times as deep."""
    if raw.pressure is None:
        return
    for limit, warm in _ABYSS:
        deep = raw.temperature[raw.pressure > limit]
        if len(deep) >= _ROWS and np.median(deep) > warm:
            what = f"{np.median(deep):.4g} degC below {limit:g} dbar is warmer than any sea as deep"
            likely = f"Is it in kPa or mbar? Then map it with {_map(raw, 'kPa')} (or @mbar)"
            remedy = f"{likely}; if not, check which column is the temperature"
            raise raw.refused(what, remedy, "pressure_dbar", value=float(np.max(raw.pressure)))


def _downward(raw: RawCast) -> RawCast:
    """Return the cast with depths that count downward, whichever way they do in the file."""
    depth = raw.depth
    if depth is None or not np.min(depth) < 0.0:
        return raw
    if np.max(depth) <= 0.0:
        raw.report.append("the depths are negative in the file: they are taken as metres downward")
        return replace(raw, depth=-depth)
    k = int(np.argmin(depth))
    if depth[k] < -min(_ABOVE * float(np.max(np.abs(depth))), _HIGHEST):
        ends = f"from {depth[k]:.6g} m to {np.max(depth):.6g} m"
        what = f"the depths go {ends}: they count neither downward nor upward"
        remedy = "Make them all positive, downward, or all negative; or leave the bad row out"
        raise raw.refused(what, remedy, "depth_m", value=float(depth[k]), k=k)
    return raw


def _pressure(raw: RawCast) -> RawCast:
    p = raw.pressure
    if p is None:
        deepest = float(np.max(raw.down))
        if deepest > DEEPEST:
            remedy = "Check the unit: a depth in cm is mapped as NAME@cm"
            raise raw.refused("deeper than any sea", remedy, "depth_m", value=deepest)
        return raw
    if by_depth(raw):
        assert raw.depth is not None
        return _by_depth(raw, p, raw.depth)
    _by_air(raw, float(np.min(p)))
    if raw.density is not None and raw.salinity is not None:
        _by_density(raw, p, raw.density, raw.salinity)
    if raw.conductivity is not None and raw.salinity is not None:
        _by_salt(raw, p, raw.conductivity, raw.salinity)
    most = float(np.max(p))
    if most > DEEPEST:
        sizes = {unit: most * unit_factor(unit, "dbar") for unit in _PRESSURES}
        fitting = [f"{u} ({v:.5g} dbar)" for u, v in sizes.items() if _SURE <= v <= DEEPEST]
        what = f"{most:.6g} dbar is deeper than any sea"
        units = " or ".join(fitting) or "no unit of pressure"
        remedy = f"It may be in {units}: say so with {_map(raw, 'UNIT')}"
        raise raw.refused(what, remedy, "pressure_dbar", value=most, k=int(np.argmax(p)))
    return raw


def _by_air(raw: RawCast, least: float) -> None:
    """Hold the least pressure [dbar] against the atmosphere's: a logger in air shows that."""
    if raw.unit_stated or raw.unit_named is not None:
        if _ATMOSPHERE[0] <= least <= _ATMOSPHERE[1]:
            counts = "as those of a sensor in air that counts from vacuum"
            remedy = "if it does, subtract 10.13 dbar in the file"
            raw.report.append(f"the pressures begin at {least:.2f} dbar, {counts}: {remedy}")
        return
    for unit in _IN_AIR:
        in_unit = least * unit_factor(unit, "dbar")
        if _ATMOSPHERE[0] <= in_unit <= _ATMOSPHERE[1]:
            meant = f"in {unit} that is the atmosphere, in dbar a cast that begins deep"
            what = f"the pressures begin at {least:.6g}: {meant}"
            air = f"{10.1325 / unit_factor(unit, 'dbar'):g} {unit} of air"
            inside = f"{_map(raw, unit)}, with {air} subtracted in the file before"
            remedy = f"Say which: {inside}; or {_map(raw, 'dbar')}"
            raise raw.refused(what, remedy, "pressure_dbar", value=least, unit="")


def _map(raw: RawCast, unit: str, column: str = "pressure_dbar") -> str:
    """Return what reads a column in another unit."""
    return column_as(column, f"{raw.names.get(column, 'NAME')}@{unit}")


def _by_depth(raw: RawCast, p: Array, depth: Array) -> RawCast:
    """Hold pressures against the depths beside them."""
    import gsw

    below = np.abs(depth) > _ABOVE * float(np.max(np.abs(depth)))
    due = np.asarray(gsw.p_from_z(-depth[below], raw.latitude or 45.0))
    offset = p[below] - due
    if _ATMOSPHERE[0] <= float(np.median(offset)) <= _ATMOSPHERE[1] and float(
        np.std(offset)
    ) < _FITS * float(np.max(due)):
        above = f"{np.median(offset):.2f} dbar above what the depths have"
        hold = "they hold the atmosphere, which is subtracted (10.1325 dbar)"
        raw.report.append(f"the pressures are {above}: {hold}")
        return replace(raw, pressure=p - 10.1325)
    ratio = float(np.median(due / np.where(p[below] == 0.0, np.nan, p[below])))
    if abs(ratio - 1.0) <= _FITS:
        return raw
    fitting = [u for u in _PRESSURES if abs(ratio / unit_factor(u, "dbar") - 1.0) <= _FITS]
    k = int(np.argmax(depth))
    what = f"{p[k]:.6g} dbar at a depth of {depth[k]:.6g} m, where about {due.max():.5g} are due"
    remedy = "No unit of pressure fits: check which columns are pressure and depth"
    if fitting:
        remedy = f"In {fitting[0]} it fits: map it with {_map(raw, fitting[0])}"
    raise raw.refused(what, remedy, "pressure_dbar", value=float(p[k]), k=k)


def _by_density(raw: RawCast, p: Array, density: Array, SP: Array) -> None:
    """Hold pressures against in-situ densities: 100 dbar make 0.45 kg/m3."""
    import gsw

    SA = gsw.SR_from_SP(SP)

    def miss(factor: float) -> float:
        deep = np.clip(p * factor, 0.0, DEEPEST)
        CT = gsw.CT_from_t(SA, raw.temperature, deep)
        return float(np.nanmedian(np.abs(gsw.rho(SA, CT, deep) - density)))

    off = miss(1.0)
    if not off > _DENSITY_WRONG:
        return
    if miss(0.0) > _DENSITY_WRONG:  # else it is potential density
        what = f"the density in situ would be {off:.2g} kg/m3 off the one beside it"
        _refuse_misfit(raw, p, miss, _DENSITY_FITS, what)
    other = "that of pressure, temperature and salinity: is it that in situ? It is not used"
    raw.report.append(f"the density beside is {off:.2g} kg/m3 off {other}")


def _by_salt(raw: RawCast, p: Array, C: Array, SP: Array) -> None:
    """Hold pressures against salinity and conductivity: in the deep the two differ by pressure."""
    import gsw

    def miss(factor: float) -> float:
        salt = gsw.SP_from_C(10.0 * C, raw.temperature, np.clip(p * factor, 0.0, DEEPEST))
        return float(np.nanmedian(np.abs(salt - SP)))

    off = miss(1.0)
    if off > _SALT_WRONG:
        what = f"the conductivity would mean a salinity {off:.2g} off the one beside it"
        _refuse_misfit(raw, p, miss, _SALT_FITS, what)


def _refuse_misfit(
    raw: RawCast, p: Array, miss: Callable[[float], float], fits: float, what: str
) -> None:
    """Raise LogError where pressures in another unit go with the column beside, by `miss`."""
    sizes = {unit: miss(unit_factor(unit, "dbar")) for unit in _PRESSURES}
    best = min(sizes, key=lambda unit: sizes[unit])
    if sizes[best] < fits:
        most, remedy = float(np.max(p)), f"In {best} they agree: map it with {_map(raw, best)}"
        raise raw.refused(f"at {most:.5g} dbar {what}", remedy, "pressure_dbar", value=most)


def _salt(raw: RawCast) -> None:
    if raw.salinity is not None:
        middle, most = float(np.median(raw.salinity)), float(np.max(raw.salinity))
        if 0.0 < most < _SHARES and middle >= 0.0:
            what = f"a salinity of {most:.4g} at most is next to none"
            share = f"As kg/kg or g/g it is {1e3 * most:.4g} g/kg"
            lake = f"for a lake as fresh as that give `salinity={most:.2g}`"
            remedy = f"{share}: multiply the column by 1000 in the file; {lake}"
            raise raw.refused(what, remedy, "salinity", value=round(most, 6))
        if 0.0 <= middle <= MOST_SALT:
            return
        what = f"a salinity of {middle:.4g} is that of no sea"
        remedy = "A conductivity is mapped as conductivity_S_m=NAME@mS/cm, in its unit"
        raise raw.refused(what, remedy, "salinity", value=round(middle, 4))
    elif raw.conductivity is not None:
        _refuse_salt(raw, raw.conductivity)


def _refuse_salt(raw: RawCast, C: Array) -> None:
    """Raise LogError where conductivities are those of no water, with the unit that fits."""
    import gsw

    p = np.zeros(len(raw)) if raw.pressure is None else raw.pressure

    def median_salt(factor: float) -> float:
        return float(np.nanmedian(gsw.SP_from_C(10.0 * factor * C, raw.temperature, p)))

    found = median_salt(1.0)
    if 0.0 < found <= MOST_SALT:
        return
    middle = float(np.median(C))
    units = {unit: unit_factor(unit, "S/m") for unit in ("mS/cm", "mS/m", "uS/cm")}
    signs = {
        u: (2.0 < median_salt(f) <= MOST_SALT) + (_SEAS[0] <= middle * f <= _SEAS[1])
        for u, f in units.items()
    }
    most = max(signs.values())
    fitting = [unit for unit, found in signs.items() if found == most > 0]
    what = f"a conductivity of {middle:.4g} S/m is that of no sea"
    remedy = "Check which column is the conductivity"
    if fitting:
        options = " or ".join(_map(raw, unit, "conductivity_S_m") for unit in fitting)
        remedy = f"In {' or '.join(fitting)} it fits: map it with {options}"
    raise raw.refused(what, remedy, "conductivity_S_m", value=middle)
