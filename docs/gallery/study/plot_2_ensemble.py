"""
Two thousand vehicles that differ
=================================

Nobody knows K2 and psi to the last digit. Two thousand vehicles, drawn from what is known of them,
make the same step at once: a softer hull (psi) overshoots more, a vehicle that answers a change of
volume faster (K2) less.
"""

import matplotlib.pyplot as plt
import numpy as np

import swimbladder as sb

vehicle = sb.load_vehicle("feup-em")
random = np.random.default_rng(7)
count = 2000
K2 = vehicle.motion.K2 * random.normal(1.0, 0.1, count)  # 1/m2/s
psi = random.normal(4.04e-6, 0.4e-6, count)  # m3/m
fleet = sb.simulate_ensemble(
    vehicle,
    count=count,
    setpoints=[(0.0, 3.0)],
    duration=400.0,
    start_depth=1.5,
    vary={"a_b": K2 / vehicle.motion.T2, "psi": psi},
)
low, high = fleet.overshoot.quantile([0.05, 0.95]).values
print(f"nine of ten overshoot by {low:.1f} to {high:.1f} %")

figure, axes = plt.subplots(layout="constrained")
points = axes.scatter(1e6 * psi, fleet.overshoot, c=K2, s=6)
axes.set(xlabel="psi [cm$^3$/m]", ylabel="overshoot [%]")
figure.colorbar(points, label="K2 [1/(m$^2$ s)]")
