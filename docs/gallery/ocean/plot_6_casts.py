"""
A cast, and the volume that it asks for
=======================================

Between 20 and 80 m this sea gets colder by 15 degrees. Denser water carries more, so a float that
rests below has to displace less: the warm layer asks for far more volume than 2000 m of pressure.
"""

import tempfile
from pathlib import Path

import numpy as np

import swimbladder as sb

pressure = np.arange(0.0, 2021.0, 5.0)  # dbar
temperature = 3.0 + 9.0 * np.exp(-pressure / 500.0) + 15.0 / (1.0 + np.exp((pressure - 50.0) / 8.0))
rows = np.column_stack([pressure, temperature, np.full_like(pressure, 35.0)])
path = Path(tempfile.mkdtemp()) / "cast.csv"
header = "pressure_dbar,temperature_degC,salinity"
np.savetxt(path, rows, delimiter=",", header=header, comments="")

found = sb.ballast("example-float", [sb.read_cast(path, latitude=20.0)])
print(found)
found.plot()
