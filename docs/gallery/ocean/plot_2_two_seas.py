"""
Ballast in two seas
===================

A float that is to leave a warm, salty sea for a cold one: each has its own density over depth, so
each asks for another neutral volume. `ballast` finds the mass for the first and whether the stroke
covers both.
"""

import tempfile
from pathlib import Path

import numpy as np

import swimbladder as sb

pressure = np.arange(0.0, 2101.0, 10.0)  # dbar
seas = {"warm": (24.0, 13.5, 38.3), "cold": (8.0, 1.0, 34.9)}  # degC, degC, PSS-78
casts = []
for name, (surface, deep, salinity) in seas.items():
    temperature = deep + (surface - deep) * np.exp(-pressure / 120.0)
    rows = np.column_stack([pressure, temperature, np.full_like(pressure, salinity)])
    path = Path(tempfile.mkdtemp()) / f"{name}.csv"
    header = "pressure_dbar,temperature_degC,salinity"
    np.savetxt(path, rows, delimiter=",", header=header, comments="")
    casts.append(sb.read_cast(path, latitude=60.0))

found = sb.ballast("example-float", casts, target=sb.Target(neutral_depth=1000.0))
print(found)
found.plot()
