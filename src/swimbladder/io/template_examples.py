"""The examples that new vehicle files are made of: one of each kind of actuator."""

from __future__ import annotations

from typing import Any

Table = dict[str, Any]

BODY: Table = {
    "stroke": {"minimum": "-350 cm3", "maximum": "350 cm3"},
    "hull": {
        "displaced_volume": "27.5 L",
        "psi": "4 cm3/m",
        "waterplane_area": "314 cm2",
        "height": "1.3 m",
        "depth_limit": "80 m",
    },
}
_PHYSICAL: Table = {
    "kind": "physical",
    "dry_mass": "27.5 kg",  # neutral in fresh water
    "entrained_mass": "10.5 kg",
    "added_mass": "7 kg",
    "drag": {"law": "linear", "k_dl": "1.24 N s/m"},
}
# A profiling float for 1000 m, its hull the stiffer one and neutral in sea water.
_FLOAT: Table = {
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
_MOTOR: Table = {
    "resistance": "1.5 ohm",
    "torque_constant": "30 mN m/A",
    "rotor_inertia": "5e-6 kg m2",
    "viscous_friction": "2e-6 N m s/rad",
}
_CASCADE: Table = {
    "law": "cascade",
    "sample_time": "0.3 s",
    "parameters": {
        "k_pV": "1000 V/dm3",
        "k_pz": "-0.1 dm3/m",
        "k_iz": "-7e-4 dm3/s/m",
        "k_dz": "-2.3 dm3 s/m",
    },
}
EXAMPLES: dict[str, Table] = {
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

# What stands, commented out, in a field that has no default to show.
INSTEAD: dict[str, str] = {
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
    "stroke.switch_margin": '"0 cm3"',
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
