"""
Steps of the motor on the bench
===============================

The motor is held at several voltages, both ways, and the piston is logged. Its speed per volt, its
time constant and the voltage that friction takes follow, each with its interval.
"""

import tempfile
from pathlib import Path

import numpy as np

import swimbladder as sb

K1, T1, friction = 0.444e-3, 0.09, 0.4  # m/s/V, s, V: what is to be found
held = [3, -3, 6, -6, 12, -12] * 2
voltage = np.concatenate([[0.0] * 50 + [u] * 60 for u in held] + [[0.0] * 50])
position, speed, piston = 0.0, 0.0, []
for u in voltage:
    piston.append(position)
    for _ in range(20):  # of 1 ms
        way = np.sign(speed or u)
        faster = speed + 1e-3 * (K1 * (u - friction * way) - speed) / T1
        speed = 0.0 if (speed == 0.0 and abs(u) <= friction) or faster * way < 0.0 else faster
        position += 1e-3 * speed
piston = np.array(piston) + np.random.default_rng(1).normal(0.0, 1e-5, voltage.size)
rows = np.column_stack([0.02 * np.arange(voltage.size), piston, voltage])
path = Path(tempfile.mkdtemp()) / "bench.csv"
np.savetxt(path, rows, delimiter=",", header="time_s,piston_m,voltage_V", comments="")

log = sb.read_log(path, required=("piston_m", "voltage_V"))
found = sb.identify_actuator([log], "feup-em")
print(found)
found.plot()
