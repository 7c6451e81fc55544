"""The deep dives of the logged float, with the water that each measured itself."""

from __future__ import annotations

import re
from pathlib import Path

import gsw
import numpy as np
import pandas as pd

from swimbladder.estimation.motion.deep_model import DeepDive, deep_dive
from swimbladder.io.float_log import Action, Device, FloatLog, Stage, Target
from swimbladder.physics.seawater import Cast, Column, cast_column
from swimbladder.vehicle import Vehicle

__all__ = ["columns_of", "dives_of", "logs_of"]

DEEP = 2e6  # Pa: deeper than this is a deep dive
_SALTS = (37.0, 39.2)  # psu, of this sea; others are spikes of the conductivity cell at the surface
_WHERE = (43.4, 7.85)  # latitude and longitude [deg]


def logs_of(folder: Path) -> list[FloatLog]:
    """Return the logs of all dives in the tables of a folder, in order."""
    samples = pd.read_csv(folder / "pressure.csv.gz")
    actions = pd.read_csv(folder / "actions.csv.gz")
    about = pd.read_csv(folder / "dives.csv").set_index("dive")
    times = pd.to_datetime(samples["time"])
    begun = pd.to_datetime(actions["time"])
    found = []
    for name, rows in samples.groupby("dive", sort=False):
        start = times[rows.index[0]]
        mine = actions[actions["dive"] == name]
        dive = about.loc[name]
        settings = {
            key.removeprefix("cmd_"): str(value)
            for key, value in dive.items()
            if str(key).startswith("cmd_") and pd.notna(value)
        }
        found.append(
            FloatLog(
                source=str(name),
                start=start.isoformat(),
                time=(times[rows.index] - start).dt.total_seconds().to_numpy(),
                pressure=100.0 * rows["P_mbar"].to_numpy(dtype=float),
                temperature=1e-3 * rows["T_mdegC"].to_numpy(dtype=float),
                stage=_stages(rows["stage"]),
                settings=settings,
                stages=_mission(dive),
                actions=tuple(
                    _action(row, (when - start).total_seconds())
                    for when, (_, row) in zip(begun[mine.index], mine.iterrows(), strict=True)
                ),
            )
        )
    return found


def dives_of(folder: str | Path, vehicle: Vehicle) -> list[DeepDive]:
    """Return the deep dives that measured their water, in order."""
    folder = Path(folder)
    columns = columns_of(folder)
    return [
        deep_dive(log, columns[log.source], vehicle, name=log.source)
        for log in logs_of(folder)
        if log.source in columns and log.pressure.max() > DEEP
    ]


def columns_of(folder: str | Path) -> dict[str, Column]:
    """Return the water that each dive of a hundred samples or more measured, by its name."""
    casts = pd.read_csv(Path(folder) / "ctd_profiles.csv.gz")
    casts = casts[casts["salinity_psu"].between(*_SALTS)]
    deep = casts.groupby("dive")["pressure_dbar"].max() * 1e4 > 0.9 * DEEP
    return {
        str(name): _column(profile, str(name))
        for name, profile in casts.groupby("dive")
        if deep[name] and len(profile) > 100
    }


def _column(profile: pd.DataFrame, name: str) -> Column:
    """Return the water of a profile, averaged over 1 dbar."""
    level = np.floor(profile["pressure_dbar"].clip(lower=0.0)) + 0.5
    mean = profile.groupby(level)[["temperature_degC", "salinity_psu"]].mean()
    p = mean.index.to_numpy(dtype=float)
    latitude, longitude = _WHERE
    SA = gsw.SA_from_SP(mean["salinity_psu"].to_numpy(), p, longitude, latitude)
    CT = gsw.CT_from_t(SA, mean["temperature_degC"].to_numpy(), p)
    return cast_column(
        Cast(pressure=p, SA=SA, CT=CT, latitude=latitude, longitude=longitude, name=name)
    )


def _stages(stage: pd.Series) -> np.ndarray:
    """Return the mission's stages; there 99 is surfacing and none is before a dive."""
    number = stage.fillna(99.0).to_numpy(dtype=float)
    return np.where(number > 90.0, -2, number).astype(np.int64)


def _mission(dive: pd.Series) -> tuple[Stage, ...]:
    found = []
    for n in range(3):
        said = re.match(r"(\d+)\+/-(\d+)mbar (\d+)s", str(dive.get(f"stage{n}", "")))
        if said:
            p, band, seconds = (float(x) for x in said.groups())
            found.append(
                Stage(number=n, pressure=100.0 * p, tolerance=100.0 * band, duration=seconds)
            )
    return tuple(found)


def _action(row: pd.Series, time: float) -> Action:
    device: Device = row["device"]
    seconds = float(row["cmd_ms"]) / 1000.0
    target = None
    if np.isfinite(row["want_mL"]):
        target = Target(
            time=time,
            speed_from=100.0 * row["v_from_mbar_s"],
            speed_to=100.0 * row["v_to_mbar_s"],
            change=1e-6 * row["want_mL"],
            seconds=row["want_ms"] / 1000.0,
        )
    return Action(device=device, time=time, asked=seconds, seconds=seconds, target=target)
