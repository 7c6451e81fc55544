"""
All laws in one picture
=======================

The same step, the same vehicle, the same noise of 2 mm: the paper's cascade as printed, and the
laws that `tune` found gains for, four of them meant to be fast and two to be quiet. Their gains
are in :download:`laws.toml`, beside this example.
"""

import tomllib
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import swimbladder as sb

vehicle = sb.load_vehicle("feup-em").replace({"sensors.depth_noise": "2 mm"})
laws = {"cascade": vehicle.controller.parameters, **tomllib.loads(Path("laws.toml").read_text())}

figure, (depths, volumes) = plt.subplots(2, sharex=True, figsize=(8, 7), layout="constrained")
for name, gains in laws.items():
    tuned = vehicle.replace(
        {"controller": {"law": name, "sample_time": "0.3 s", "parameters": gains}}
    )
    step = sb.simulate(tuned, step=("1.5 m", "3 m"), duration="120 s", seed=1)
    moved = 1e6 * np.cumsum(np.abs(np.diff(step.volume, prepend=step.volume[0])))
    depths.plot(step.time, step.depth, label=name)
    volumes.semilogy(step.time[1:], moved[1:])
depths.set(ylabel="depth [m]")
depths.invert_yaxis()
depths.legend(ncols=2)
volumes.set(xlabel="time [s]", ylabel="volume moved, to and fro [cm$^3$]")
