"""
Margins before the first dive
=============================

The linear model says beforehand what the sampled loop forgives: how much gain, phase and delay.
``to_control()`` hands the model to python-control, which here draws the motor and the vehicle, from
the voltage to the depth at rest at 3 m.
"""

import control
import matplotlib.pyplot as plt
import numpy as np

import swimbladder as sb

analysis = sb.analyse("feup-em", depth="3 m")
print(analysis)

depth = analysis.model.to_control()[0, 0]  # from u to z
frequency = np.geomspace(1e-3, 1e1, 300)  # rad/s
response = control.frequency_response(depth, frequency)

figure, (gain, phase) = plt.subplots(2, sharex=True, layout="constrained")
gain.loglog(frequency, response.magnitude)
gain.set(ylabel="depth per voltage [m/V]")
phase.semilogx(frequency, np.degrees(response.phase))
phase.set(xlabel="frequency [rad/s]", ylabel="phase [degrees]")
for axes in (gain, phase):
    axes.grid(alpha=0.3)
