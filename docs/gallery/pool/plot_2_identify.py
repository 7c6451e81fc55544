"""
From a pool log to parameters
=============================

Four releases in a pool, with a depth sensor of 2 mm and a trim that is off by a fraction of a cubic
centimetre each time. A vehicle whose parameters are known stands in for the pool; `identify` is
given the logs alone.
"""

import tempfile
from pathlib import Path

import numpy as np

import swimbladder as sb

real = sb.load_vehicle("feup-em")
random = np.random.default_rng(7)
logs, folder = [], Path(tempfile.mkdtemp())
for change in (20e-6, -30e-6, 45e-6, -75e-6):  # m3
    start = 3.75 if change > 0 else 0.75  # m
    time = np.arange(0.0, 100.0, 0.3)
    moved = (time - 3.0) * np.sign(change) * 40e-6
    volume = np.clip(moved, min(change, 0.0), max(change, 0.0))
    trim = real.neutral_volume(start) + random.normal(0.0, 0.3e-6)
    ran = sb.drive(real, time=time, volume=volume + trim, start_depth=start)
    n = int(np.argmax(np.abs(ran.depth - start) > 3.0))
    rows = np.column_stack([time, ran.depth + random.normal(0.0, 2e-3, time.size), volume])[:n]
    path = folder / f"release {1e6 * change:+.0f} cm3.csv"
    np.savetxt(path, rows, delimiter=",", header="time_s,depth_m,volume_m3", comments="")
    logs.append(sb.read_log(path))

found = sb.identify(logs, real, choices=False)
print(found)
found.plot()
