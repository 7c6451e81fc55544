"""A vehicle as shown: every number with its source, what follows from them, its reach."""

from collections.abc import Iterator, Mapping
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel

from swimbladder.control.registry import bind
from swimbladder.physics.actuator import reduced
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.physics.dynamics import body_plant, terminal_speed
from swimbladder.show.parts import Drawn, Part, Shown, Table
from swimbladder.show.picture import Ink, Panel, Picture, grid_of
from swimbladder.units import rounded, shown_unit, unit_factor
from swimbladder.vehicle import Positioner, PumpAndValve, Vehicle, field_unit
from swimbladder.vehicle.schema import dotted, meanings

_DEEP = 100.0  # m, drawn of a vehicle whose reach nothing limits
_DIGITS = 6
_RATES = {"m3/s": "cm3/s", "m3/s/V": "cm3/s/V"}  # of an actuator


class VehicleShown(Shown[Vehicle]):
    """What follows from its numbers, what it reaches, and every number with its source."""

    name = "vehicle"

    @property
    def title(self) -> str:
        """Its name."""
        return self.found.name

    def parts(self) -> Iterator[Part]:
        """Give what follows first."""
        v = self.found
        yield self.head
        yield self.follows
        yield Drawn("reach", partial(draw_reach, v))
        listed = [
            (one.place, *_shown(one.value, one.unit or ""), one.meaning, _source(v, one.place))
            for one in _numbers(v)
        ]
        headings = ("field", "value", "unit", "meaning", "source")
        title = "Its numbers, and where they come from"
        yield Table(headings, listed, left={*headings} - {"value"}, title=title, later=True)

    @property
    def head(self) -> str:
        """What it is, in a sentence."""
        return f"{self.found.name}, {self.found.actuator.kind}: {self.found.description}"

    @property
    def follows(self) -> Table:
        """What follows from its numbers."""
        rows = [
            (meaning, *(("", "") if value is None else _shown(value, unit)))
            for value, unit, meaning in derived(self.found).values()
        ]
        headings = (f"follows from the numbers of {self.found.name}", "", " ")
        return Table(headings, rows, left=(headings[0], " "))

    def table(self) -> Any:
        """Return speeds and volumes of the picture: the neutral volume over depth."""
        depth = _depths(self.found)
        neutral = [self.found.neutral_volume(z) for z in depth.tolist()]
        return {"depth_m": depth, "neutral_volume_m3": np.array(neutral)}

    def numbers(self) -> Mapping[str, Any]:
        """Return every number, and what follows."""
        v = self.found
        keys = ("value", "unit", "meaning")
        follows = {name: dict(zip(keys, row, strict=True)) for name, row in derived(v).items()}
        said = {"name": v.name, "kind": v.actuator.kind, "description": v.description}
        return {**said, "parameters": fields_of(v), "derived": follows, "provenance": v.provenance}


def _shown(value: Any, unit: str) -> tuple[str, str]:
    """Return a value as a person reads it, and its unit."""
    shown = _RATES.get(unit, shown_unit(unit))
    if isinstance(value, (tuple, list)):
        return ", ".join(_shown(one, unit)[0] for one in value), shown
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return str(value), unit
    return rounded(value * unit_factor(unit, shown), _DIGITS), shown


def _source(v: Vehicle, place: str) -> str:
    """Return where a number comes from: as the file says of it, or of the table it stands in."""
    while place:
        if place in v.provenance:
            return v.provenance[place]
        place = place.rpartition(".")[0]
    return ""


def _depths(v: Vehicle) -> Any:
    """Return the depths that are drawn [m]: to its rating, and a bit beyond its reach."""
    reach = derived(v)["neutral_depth_limit_m"][0] or 0.0
    known = [z for z in (v.hull.depth_limit, 1.1 * reach) if z and 0.0 < z < np.inf]
    return np.linspace(0.0, max(known[:1] or [_DEEP]), 201)


def draw_reach(v: Vehicle) -> Picture:
    """Return neutral volume and rate of the volume over depth, and the speed by volume."""
    picture, (neutral, speed, rate) = grid_of((11.0, 4.2), 3, 3, letters=True)
    z, stroke = _depths(v), v.stroke
    neutral.span("x", 1e6 * stroke.minimum, 1e6 * stroke.maximum, Ink.SKY, "stroke", alpha=0.2)
    neutral.line([1e6 * v.neutral_volume(depth) for depth in z.tolist()], z, label="neutral")
    limit = v.hull.depth_limit
    if limit is not None:
        neutral.rule("y", limit, Ink.VERMILION, "rated depth", dash="--", width=1.1)
    _speeds(v, speed)
    found = drive_map(v, v.water.specific_weight * z, power=False)
    rate.line(1e6 * found.rate_out, z, label="out")
    rate.line(1e6 * found.rate_in, z, Ink.VERMILION, "in", dash="--")
    neutral.x, rate.x, rate.xlim = "volume [cm³]", "volume rate [cm³/s]", (0.0, None)
    for panel in (neutral, rate):
        panel.y, panel.ylim = "depth [m]", (0.0, float(z[-1]) * 1.02)
    return picture


def _speeds(v: Vehicle, panel: Panel) -> None:
    """Draw the terminal speeds by the volume's distance from neutral."""
    p, ratio = body_plant(v), v.drag.rising_ratio
    volumes = np.linspace(0.0, 0.5 * (v.stroke.maximum - v.stroke.minimum), 101)
    both = {"sinking": (1.0, Ink.BLUE), "rising": (ratio, Ink.VERMILION)}
    ways = {"terminal speed": (1.0, Ink.BLUE)} if ratio == 1.0 else both
    for label, (share, color) in ways.items():
        speeds = [terminal_speed(p, p.a_b * volume / share) for volume in volumes.tolist()]
        panel.line(1e6 * volumes, 100.0 * np.array(speeds), color, label)
    panel.x, panel.y = "volume above or below neutral [cm³]", "speed [cm/s]"
    panel.xlim = panel.ylim = (0.0, None)


class _Number(NamedTuple):
    """A number of a vehicle: its place in the file, itself, and the class that says what it is."""

    place: str
    value: Any
    unit: str | None
    model: type[BaseModel] | None
    name: str

    @property
    def meaning(self) -> str:
        """What it means, as its class says."""
        if self.model is None:
            return "parameter of the law"
        classes = (one for one in self.model.__mro__ if issubclass(one, BaseModel))
        return next((said for c in classes if (said := _meanings(c).get(self.name))), "")


@cache
def _meanings(model: type[BaseModel]) -> dict[str, str]:
    return {} if model is BaseModel else meanings(model)


def _numbers(v: Vehicle) -> Iterator[_Number]:
    """Give every number of a vehicle, SI."""

    def walk(model: BaseModel, path: tuple[str | int, ...]) -> Iterator[_Number]:
        for name in type(model).model_fields:
            value = getattr(model, name)
            if isinstance(value, BaseModel):
                yield from walk(value, (*path, name))
            elif isinstance(value, tuple) and any(isinstance(x, BaseModel) for x in value):
                for number, part in enumerate(value):
                    yield from walk(part, (*path, name, number))
            elif (
                path and value is not None and not isinstance(value, dict)
            ) or name == "trim_error":
                unit = field_unit(type(model), name)
                yield _Number(dotted((*path, name)), value, unit, type(model), name)

    yield from walk(v, ())
    if v.controller is not None:
        law, numbers = bind(v.controller)
        for name in v.controller.parameters:
            place = dotted(("controller", "parameters", name))
            yield _Number(place, getattr(numbers, name), law.units[name], None, name)


def fields_of(v: Vehicle) -> dict[str, dict[str, Any]]:
    """Return every number of a vehicle in SI as {dotted field: {value, unit}}."""
    return {one.place: {"value": one.value, "unit": one.unit} for one in _numbers(v)}


def derived(v: Vehicle) -> dict[str, tuple[float | None, str, str]]:
    """Return what follows from a vehicle's numbers, as {name: (value, unit, meaning)}."""
    stroke, psi, drag = v.stroke, v.hull.psi, v.drag
    rows: dict[str, tuple[float | None, str, str]]
    rows = {"mass_kg": (v.mass, "kg", "mass that is accelerated")}
    rate_of: tuple[float, str] | None = None
    if isinstance(v.engine, Positioner):
        rate_of = v.engine.speed * v.engine.piston_area, "of the positioner"
    elif isinstance(v.engine, PumpAndValve):
        rate_of = float(drive_map(v, 0.0).rate_out[0]), "of the pump at the surface"
    else:
        a = reduced(v.engine, v.water)
        rows |= {
            "K1A_m3_s_V": (a.gain, "m3/s/V", "volume rate per volt, K1 A"),
            "T1_s": (a.T1, "s", "time constant of the motor, T1"),
            "load_V_m": (a.load_drive, "V/m", "voltage that holds a metre of water, k_z/k_u"),
            "k_l_m2_s": (a.k_l, "m2/s", "leakage, k_l"),
        }
        if v.supply is not None:
            rate_of = a.gain * v.supply.voltage, "at the surface, full supply"
    if rate_of is not None:
        rows["volume_rate_m3_s"] = rate_of[0], "m3/s", f"volume rate {rate_of[1]}"
    if drag.k_dl > 0.0:
        gain, time = v.water.specific_weight / drag.k_dl, v.mass / drag.k_dl
        rows["K2_1_m2_s"] = gain, "1/m2/s", "speed per volume at low speed, K2"
        rows["T2_s"] = time, "s", "time constant of the motion, T2"
    rows["neutral_volume_surface_m3"] = v.neutral_volume(0.0), "m3", "neutral at the surface"
    limit = v.hull.depth_limit
    if limit is not None:
        meaning = f"neutral at {limit:g} m, its rating"
        rows["neutral_volume_limit_m3"] = v.neutral_volume(limit), "m3", meaning
    end = stroke.maximum if psi > 0.0 else stroke.minimum
    deepest = (end - v.trim_error) / psi if psi != 0.0 else None
    rows["neutral_depth_limit_m"] = deepest, "m", "depth to which the stroke reaches neutral"
    return rows
