"""
Predicted on a dive that was not fitted
=======================================

The truth is simulated apart from the package: SciPy integrates the equations below, with drag that
is mostly turbulent and a neutral volume that drifts. `identify` is given four releases in a pool,
with 2 mm of noise. The identified vehicle, driven by the volume of another dive, then predicts it;
of that dive only the neutral volume is fitted.
"""

import tempfile
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

import swimbladder as sb

random = np.random.default_rng(3)
time = np.arange(0.0, 120.0, 0.3)  # s


def log(volume, start):
    """Log a dive of a 33 kg body: 45 kg are accelerated, psi is 4.2 cm3/m, drag 60 N s2/m2."""

    def motion(t, state):
        depth, speed = state
        excess = 4.2e-6 * (depth - start) - np.interp(t, time, volume) + 2e-9 * t  # m3
        return speed, (9800.0 * excess - (3.0 + 60.0 * abs(speed)) * speed) / 45.0

    depth = solve_ivp(motion, (0.0, time[-1]), (start, 0.0), t_eval=time, rtol=1e-9).y[0]
    n = int(np.argmax((np.abs(depth - start) > 2.8) | (time == time[-1])))
    rows = np.column_stack([time, depth + random.normal(0.0, 2e-3, time.size), volume])[:n]
    path = Path(tempfile.mkdtemp()) / "log.csv"
    np.savetxt(path, rows, delimiter=",", header="time_s,depth_m,volume_m3", comments="")
    return sb.read_log(path)


pool = []
for change, start in [(20e-6, 3.75), (-30e-6, 0.75), (45e-6, 3.75), (-75e-6, 0.75)]:
    ramp = np.clip((time - 3.0) * np.sign(change) * 40e-6, min(change, 0.0), max(change, 0.0))
    pool.append(log(ramp, start))
start = sb.load_vehicle("feup-em").replace({"name": "what was identified in the pool,"})
found = sb.identify(pool, start, drag="blended", profiles=False, choices=False)
print(found)

moves = 1e-6 * np.array([0.0, -40.0, -40.0, 40.0, 40.0, -30.0, -30.0, 5.0])
pulses = np.interp(time, [5.0, 7.0, 25.0, 29.0, 50.0, 54.0, 75.0, 77.0], moves)
seen = sb.compare(log(pulses, 1.5), found.vehicle)
print(seen)
seen.plot()
