"""
Against a thruster
==================

A buoyancy engine pays once for a change of volume, a thruster pays as long as it pushes. On dives
down and up again at 0.1 m/s the engine is the cheaper one below the depth at which the lines cross.
"""

import matplotlib.pyplot as plt
import numpy as np

import swimbladder as sb

answer = sb.energy("example-float", speed="0.1 m/s", thruster=sb.Thruster(efficiency=0.35))
print(answer)

dives = answer.to_dict()["profiling"]
figure, axes = plt.subplots(layout="constrained")
for key, name in [("engine_J", "buoyancy engine"), ("thruster_J", "thruster")]:
    axes.plot(dives["depth_m"], 1e-3 * np.array(dives[key]), label=name)
axes.plot(dives["depth_m"], 1e-3 * np.array(dives["drag_J"]), ":", label="drag alone")
axes.axvline(dives["break_even_m"], color="gray", linewidth=0.8)
axes.set(xlabel="depth of the dive [m]", ylabel="energy of a dive [kJ]")
axes.legend()
