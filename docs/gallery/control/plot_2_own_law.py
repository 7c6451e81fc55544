"""
A law of your own
=================

Any function of a measurement and a set-point is a control law. This one places the volume where the
vehicle would rest and adds a share of the depth error. It needs no gain for the speed, and pays for
it: beside the paper's controller it swings for minutes.
"""

import matplotlib.pyplot as plt

import swimbladder as sb

vehicle = sb.load_vehicle("feup-em")


def proportional(measurement, reference):
    volume = vehicle.neutral_volume(reference) - 60e-6 * (reference - measurement.depth)  # m3
    return 1e6 * (volume - measurement.volume)  # V


figure, axes = plt.subplots(layout="constrained")
for name, law in [("the paper's cascade", None), ("proportional", proportional)]:
    step = sb.simulate(
        vehicle, setpoints=[(0.0, 3.0)], duration="400 s", start_depth="1.5 m", law=law
    )
    axes.plot(step.time, step.depth, label=name)
axes.axhline(3.0, color="gray", linestyle=":", label="set-point")
axes.set(xlabel="time [s]", ylabel="depth [m]")
axes.invert_yaxis()
axes.legend()
