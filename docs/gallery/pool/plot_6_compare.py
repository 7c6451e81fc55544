"""
Does the model still fit the log?
=================================

`compare` drives the model with the volume of a log and shows how far its depth is off. This log is
of a vehicle with air trapped in it, so that its hull gives way by half as much again. With the
neutral volume alone fitted, as drawn, a wide residual remains; with psi too, nothing does.
"""

import tempfile
from pathlib import Path

import swimbladder as sb

model = sb.load_vehicle("feup-em")
airy = model.replace({"hull.psi": "6 cm3/m"})
run = sb.simulate(airy, setpoints=[(0.0, 3.0)], duration="120 s", start_depth="1.5 m")
folder = Path(tempfile.mkdtemp())
run.save(folder)

log = sb.read_log(folder / "trajectory.csv")
both = sb.compare(log, model, drive="volume", free=["neutral_volume", "psi"])
print(f"with psi fitted, {1e6 * both.fitted['psi'].value:.2f} cm3/m: {1e3 * both.rms:.1f} mm rms")
alone = sb.compare(log, model, drive="volume", free=["neutral_volume"])
alone.plot()
