"""
How slow may the board be?
==========================

The same gains, sampled ever more slowly. The linear analysis says beforehand at which sample time
the loop is lost: where the largest pole leaves the unit circle.
"""

import matplotlib.pyplot as plt
import numpy as np

import swimbladder as sb

vehicle = sb.load_vehicle("feup-em")
times = np.linspace(0.1, 1.0, 19)  # s
largest = []
for sample_time in times:
    loop = sb.analyse(vehicle, depth="3 m", sample_time=sample_time).closed_loop
    largest.append(loop.spectral_radius)

figure, axes = plt.subplots(layout="constrained")
axes.plot(times, largest, "o-")
axes.axhline(1.0, color="gray", linestyle=":", label="limit of stability")
axes.set(xlabel="sample time [s]", ylabel="modulus of the largest pole [-]")
axes.legend()
