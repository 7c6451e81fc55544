"""
How fast does it sink and rise?
===============================

A float moves its volume in runs of pump and valve, and glides in between: the speed is a saw-tooth
about what the mission asks for. Trajectory tools want it over depth; `save` writes it as a table,
``vertical-speed.csv``.
"""

import matplotlib.pyplot as plt
import numpy as np

import swimbladder as sb

phases = [
    {"kind": "descend", "depth": "1000 m"},
    {"kind": "park", "depth": "1000 m", "tolerance": "50 m", "duration": "1 d"},
    {"kind": "profile", "depth": "10 m", "tolerance": "5 m"},
    {"kind": "surface", "duration": "30 min"},
]
flown = sb.mission("example-float", sb.Mission(phases=phases, cycles=1))
rows = flown.flight.rows

figure, axes = plt.subplots(layout="constrained")
deep = rows["z"] > 10.0
for name, way in [("sinking", rows["w"] > 0.005), ("rising", rows["w"] < -0.005)]:
    axes.plot(100.0 * np.where(deep & way, rows["w"], np.nan), rows["z"], label=name)
axes.set(xlabel="speed, positive down [cm/s]", ylabel="depth [m]")
axes.invert_yaxis()
axes.legend()
