"""
From where does it come back?
=============================

Each point of these maps is a start that was simulated: a change of the set-point from rest, or an
error of depth and speed. Beyond the black line no controller brings this vehicle back, for lack of
volume or of volts.
"""

import swimbladder as sb

found = sb.stability("feup-em", depth_range=("0 m", "5 m"), cells=15)
print(found)
found.plot()
