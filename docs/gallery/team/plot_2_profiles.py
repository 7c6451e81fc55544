"""
Hold 2.5 m, twice
=================

A contest asks for two profiles: down to 2.5 m, held for 45 s within half a metre, and up again.
Here with a depth sensor of 5 mm, and the share of the time in which it holds.
"""

import matplotlib.pyplot as plt
import numpy as np

import swimbladder as sb

vehicle = sb.load_vehicle("feup-em").replace({"sensors.depth_noise": "5 mm"})
points = [(0.0, 2.5), (150.0, 0.4), (300.0, 2.5), (450.0, 0.4)]
run = sb.simulate(
    vehicle, setpoints=points, duration="10 min", start_depth="0.4 m", bottom_depth="4 m", seed=3
)
held = np.abs(run.depth - 2.5) < 0.5

figure, axes = plt.subplots(layout="constrained")
axes.axhspan(2.0, 3.0, alpha=0.15, label="2.5 m, within 0.5 m")
axes.plot(run.time, run.depth, label=f"held for {0.3 * held.sum():.0f} s")
axes.set(xlabel="time [s]", ylabel="depth [m]")
axes.invert_yaxis()
axes.legend()
