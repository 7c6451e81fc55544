"""
A log as loggers write it
=========================

Pressure in millibar with a decimal comma, a piston in millimetres, a card that was busy for five
seconds. A file says once which column is what, and in which unit; what was converted, dropped or
missing is reported.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import swimbladder as sb

time = np.arange(0.0, 60.0, 0.5)
time = time[(time < 30.0) | (time > 35.0)]
rows = ["millis;Druck;Kolben"]
for t in time:
    pressure, piston = 1013.0 + 98.0 * (1.0 + 0.03 * t), 25.0 - 0.1 * t
    rows.append(f"{1000 * t:.0f};{pressure:.1f};{piston:.2f}".replace(".", ","))
folder = Path(tempfile.mkdtemp())
(folder / "float.csv").write_text("\n".join(rows))
(folder / "float.toml").write_text("""
[log]
delimiter = ";"
water_density = "998 kg/m3"
atmospheric_pressure = "1013 mbar"
decimal = ","
[log.columns]
time_s = "millis@ms"
pressure_Pa = "Druck@mbar"
piston_m = "Kolben@mm"
""")

log = sb.read_log(folder / "float.csv", log_format=folder / "float.toml")
print("\n".join(log.report))

figure, axes = plt.subplots(layout="constrained")
axes.plot(log.time, log.depth, ".")
axes.set(xlabel="time [s]", ylabel="depth [m]")
axes.invert_yaxis()
