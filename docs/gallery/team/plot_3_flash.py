"""
Flash an Uno
============

The controller as an Arduino library in C99, equal to its simulation to the bit, with a mission to
check the board against. `write_library` writes the folder that the Arduino IDE takes.
"""

import tempfile
from pathlib import Path

import swimbladder as sb

vehicle = sb.load_vehicle("feup-em").replace({"supervisor.time_limit": "2 h"})
library = sb.firmware(vehicle)
print(library)
for path in sb.write_library(library, Path(tempfile.mkdtemp()) / "controller"):
    print(path.name, path.stat().st_size, "bytes")
library.plot()
