"""A vehicle file to start from: every field of the schema, its unit, meaning and default."""

from __future__ import annotations

import inspect
import json
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from swimbladder.control.registry import LAWS, MISSION_LAWS
from swimbladder.parameters import Vehicle, field_unit
from swimbladder.parameters.schema import dotted, listed_model, models_in, tags_of

__all__ = ["KINDS", "vehicle_template"]

_Table = dict[str, Any]

_BODY: _Table = {
    "stroke": {"minimum": "-350 cm3", "maximum": "350 cm3"},
    "hull": {
        "displaced_volume": "27.5 L",
        "psi": "4 cm3/m",
        "waterplane_area": "314 cm2",
        "height": "1.3 m",
        "depth_limit": "80 m",
    },
}
_PHYSICAL: _Table = {
    "kind": "physical",
    "dry_mass": "27.5 kg",  # neutral in fresh water
    "entrained_mass": "10.5 kg",
    "added_mass": "7 kg",
    "drag": {"law": "linear", "k_dl": "1.24 N s/m"},
}
# A profiling float for 1000 m, its hull the stiffer one and neutral in sea water.
_FLOAT: _Table = {
    "water": {"density": "1025 kg/m3"},
    "stroke": {"minimum": "-300 cm3", "maximum": "300 cm3"},
    "hull": {
        "displaced_volume": "27.5 L",
        "psi": "-0.05 cm3/m",
        "waterplane_area": "235 cm2",
        "height": "1.17 m",
        "depth_limit": "1000 m",
    },
    "motion": {
        "kind": "physical",
        "dry_mass": "28.19 kg",
        "entrained_mass": "1 kg",
        "added_mass": "1.8 kg",
        "drag": {"law": "quadratic", "k_dt": "12 N s2/m2"},
    },
}
_MOTOR: _Table = {
    "resistance": "1.5 ohm",
    "torque_constant": "30 mN m/A",
    "rotor_inertia": "5e-6 kg m2",
    "viscous_friction": "2e-6 N m s/rad",
}
_CASCADE: _Table = {
    "law": "cascade",
    "sample_time": "0.3 s",
    "parameters": {
        "k_pV": "1000 V/dm3",
        "k_pz": "-0.1 dm3/m",
        "k_iz": "-7e-4 dm3/s/m",
        "k_dz": "-2.3 dm3 s/m",
    },
}
_EXAMPLES: dict[str, _Table] = {
    "electromechanical": {
        "actuator": {
            "kind": "electromechanical",
            "motor": _MOTOR,
            "drive": {
                "lead": "5 mm/rev",
                "gear_ratio": 60.0,
                "efficiency": "60 %",
                "piston_area": "75 cm2",
            },
        },
        "supply": {"voltage": "12 V"},
        "motion": _PHYSICAL,
        "controller": _CASCADE,
    },
    "electrohydraulic": {
        "actuator": {
            "kind": "electrohydraulic",
            "motor": _MOTOR,
            "drive": {"pump_displacement": "0.2 cm3/rev", "pump_efficiency": "70 %"},
        },
        "supply": {"voltage": "12 V"},
        "motion": _PHYSICAL,
        "controller": _CASCADE | {"parameters": _CASCADE["parameters"] | {"k_pV": "3000 V/dm3"}},
    },
    "identified": {
        "actuator": {
            "kind": "identified",
            "K1": "0.44 mm/s/V",
            "T1": "0.09 s",
            "piston_area": "75 cm2",
            "depth_voltage": "0.08 V/m",
        },
        "supply": {"voltage": "12 V"},
        "motion": {"kind": "identified", "K2": "8000 1/m2/s", "T2": "36 s"},
        "controller": _CASCADE,
    },
    "unified": {
        "actuator": {
            "kind": "unified",
            "inertia": "5.4e-5 kg m2",
            "k_u": "0.02 N m/V",
            "k_v": "6e-4 N m s/rad",
            "k_q": "1e-7 m3/rad",
            "k_z": "1.6e-3 N m/m",
        },
        "supply": {"voltage": "12 V"},
        "motion": _PHYSICAL,
        "controller": _CASCADE,
    },
    "pump-valve": {
        "actuator": {
            "kind": "pump-valve",
            "pump": {
                "kind": "power-law",
                "delivery": "1 mL/s",
                "slip": "0.02 mL/s/MPa",
                "idle_power": "10 W",
                "power_per_pressure": "1.5 W/MPa",
            },
            "valve": {"flow": "2.5 mL/s/bar^0.5", "power": "4 W"},
        },
        "supply": {"voltage": "15 V", "capacity": "1000 Wh"},
        **_FLOAT,
        "controller": {
            "law": "rate",
            "sample_time": "1 s",
            "parameters": {
                "coefficient": "1190 cm3 s2/m2",
                "tolerance": "5 m",
                "near": "5 m",
                "far": "50 m",
                "slow_speed": "2 cm/s",
                "near_speed": "3 cm/s",
                "far_speed": "8 cm/s",
                "ascent_speed": "9 cm/s",
                "speed_band": "2 cm/s",
                "speed_step": "1 cm/s",
                "volume_step": "2 cm3",
                "dead": "60 s",
                "run": "10 s",
                "window": "60 s",
            },
        },
    },
    "positioner": {
        "actuator": {"kind": "positioner", "speed": "2 mm/s", "piston_area": "75 cm2"},
        "motion": _PHYSICAL,
        "controller": {
            "law": "position-pid",
            "sample_time": "0.5 s",
            "parameters": {
                "K_p": "15 mm/m",
                "K_i": "0.1 mm/s/m",
                "K_d": "300 mm s/m",
                "threshold": "1 m",
                "smoothing": 1.0,
                "position_min": "-45 mm",
                "position_max": "45 mm",
                "piston_area": "75 cm2",
                "volume_at_zero": "0 m3",
            },
        },
    },
}
KINDS = tuple(_EXAMPLES)
"""The kinds of actuator that a template can be made for."""

# What stands, commented out, in a field that has no default to show.
_INSTEAD: dict[str, str] = {
    "actuator.motor.emf_constant": '"30 mV s/rad"',
    "actuator.drive.oil.volume": '"0.8 L"',
    "actuator.drive.back_efficiency": "0.3",
    "actuator.efficiency": '"60 %"',
    "actuator.back_efficiency": "0.3",
    "actuator.moving_power": '"3 W"',
    "actuator.line.volume": '"20 mL"',
    "actuator.longest_run": '"60 s"',
    "actuator.pump.stall_pressure": '"30 MPa"',
    "actuator.bypass.flow": '"60 mL/s/bar^0.5"',
    "actuator.resistance": '"1.5 ohm"',
    "actuator.emf_constant": '"30 mV s/rad"',
    "supply.voltage": '"12 V"',
    "supply.capacity": '"500 Wh"',
    "loads.name": '"processor"',
    "hull.parts.name": '"tube"',
    "hull.parts.volume": '"27.5 L"',
    "hull.parts.compressibility": '"1.5e-9 1/Pa"',
    "supervisor.depth_limit": '"20 m"',
    "supervisor.time_limit": '"21600 s"',
    "supervisor.battery_low": '"9.6 V"',
    "supervisor.bottom_depth": '"4.5 m"',
    "supervisor.prove_after": '"30 s"',
    "supervisor.neutral_range": '"20 cm3"',
    "supervisor.neutral_change": '"10 cm3"',
    "supervisor.late": '"1 s"',
    "supervisor.frozen": '"20 s"',
    "supervisor.hold_voltage": '"3 V"',
    "supervisor.release_time": '"300 s"',
    "identified.names": '["psi"]',
    "identified.values": "[4e-6]",
    "identified.covariance": "[[4e-14]]",
    "identified.between.psi": '"0.5 cm3/m"',
    "identified.between.drag": '"20 %"',
    "identified.between.neutral_drift_std": '"0.01 cm3/s"',
    "identified.between.neutral_walk": "1.0",
    "identified.between.acceleration_noise": "0.7",
}
_HEAD = """\
# A vehicle for swimbladder: {kind} actuator. Every number is an example: put in your own.
#
# A number with a unit in quotes may have any unit of its kind ("350 cm3", "0.35 L"); a bare number
# is in the unit named in square brackets. Lines that begin with # and no blank are fields at their
# default, or that may be left out; take the # away to change them.

"""


def vehicle_template(kind: str, name: str = "my-vehicle") -> str:
    """Return the text of a TOML file for a vehicle with an actuator of `kind`, one of KINDS.

    It loads and simulates as it is. Raises KeyError where there is no such kind.
    """
    example = {
        "schema_version": 1,
        "name": name,
        "description": f"An example with {'an' if kind[0] in 'eiu' else 'a'} {kind} actuator",
        **_BODY,
        **_EXAMPLES[kind],
    }
    lines: list[str] = []
    _table(lines, Vehicle, example, (), off=False)
    return _HEAD.format(kind=kind) + "\n".join(lines) + "\n"


def _table(
    lines: list[str], model: type[BaseModel], given: _Table, path: tuple[str, ...], *, off: bool
) -> None:
    """Append the fields of a table, then its sub-tables; `off` comments the fields out."""
    later = []
    for name, info in model.model_fields.items():
        if _tables(info) or get_origin(info.annotation) is dict:
            later.append((name, info))
            continue
        place = dotted((*path, name))
        active = name in given and not off
        value = _toml(given[name]) if name in given else _default(model, name, info, place)
        lines += [f"# {_meaning(model, name, info)}", f"{'' if active else '#'}{name} = {value}"]
    for name, info in later:
        _subtable(lines, info, given.get(name), (*path, name), off=off)


def _subtable(
    lines: list[str], info: FieldInfo, given: _Table | None, path: tuple[str, ...], *, off: bool
) -> None:
    """Append one sub-table with its heading."""
    models, several = _tables(info), not models_in(info.annotation)
    if len(models) > 1:
        kind = (given or {})["kind"]
        models = [model for model in models if kind in tags_of(model)]
    off = off or (given is None and info.default in (None, ()))
    words = inspect.cleandoc(models[0].__doc__ or "") if models else str(info.description)
    lines += ["", *(f"# {line}".rstrip() for line in words.splitlines() if line)]
    heading = f"[[{dotted(path)}]]" if models and several else f"[{dotted(path)}]"
    lines += [f"{'#' if off else ''}{heading}"]
    if models:
        _table(lines, models[0], given or {}, path, off=off)
        return
    if path == ("controller", "parameters"):
        laws = (*LAWS.values(), *MISSION_LAWS.values())
        units = next(law.units for law in laws if set(given or {}) <= set(law.units))
        for key, value in (given or {}).items():
            lines += [f"# [{units[key] or '-'}]", f"{key} = {_toml(value)}"]
    if path == ("provenance",):
        lines.append('#"hull.psi" = "pressure test of 2024-05-02"')


def _tables(info: FieldInfo) -> list[type[BaseModel]]:
    """Return the parameter classes of a field: a table's own, or that of a list of tables."""
    listed = listed_model(info.annotation)
    return models_in(info.annotation) or ([] if listed is None else [listed])


def _meaning(model: type[BaseModel], name: str, info: FieldInfo) -> str:
    unit = field_unit(model, name)
    text = info.description or "decides which fields this table has"
    text += f" [{unit or '-'}]" if unit is not None else ""
    choices = get_args(info.annotation) if get_origin(info.annotation) is Literal else ()
    return text + (f"; one of {', '.join(map(str, choices))}" if len(choices) > 1 else "")


def _default(model: type[BaseModel], name: str, info: FieldInfo, place: str) -> str:
    default = info.default
    if info.is_required() or default is None:
        return _INSTEAD[place]
    unit = field_unit(model, name)
    return json.dumps(f"{default:.12g} {unit}") if unit else _toml(default)


def _toml(value: object) -> str:
    """Return a text, list, number or truth as TOML, which writes these as JSON does."""
    return json.dumps(value, ensure_ascii=False)
