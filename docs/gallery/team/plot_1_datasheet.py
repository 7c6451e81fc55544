"""
My float, from its datasheets
=============================

Start from the example with motor, gearbox and spindle, put in the numbers of your own parts, and
look at what changes. A number may have any unit of its kind; a wrong kind is refused.
"""

import matplotlib.pyplot as plt

import swimbladder as sb

example = sb.load_vehicle("example-em")
mine = example.replace(
    {
        "name": "mine",
        "actuator.motor.resistance": "2.4 ohm",
        "actuator.motor.torque_constant": "23 mN m/A",
        "actuator.drive.lead": "1 mm/rev",
        "supply.voltage": "7.4 V",
    }
)

figure, axes = plt.subplots(2, sharex=True, layout="constrained")
for vehicle in (example, mine):
    step = sb.simulate(vehicle, setpoints=[(0.0, 4.0)], duration="120 s", start_depth="1 m")
    axes[0].plot(step.time, step.depth, label=vehicle.name)
    axes[1].plot(step.time, 1e6 * step.volume)
axes[0].set(ylabel="depth [m]")
axes[0].invert_yaxis()
axes[0].legend()
axes[1].set(xlabel="time [s]", ylabel="volume [cm$^3$]")
