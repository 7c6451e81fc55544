"""
Break it on purpose
===================

Missions with a fault each: sensors that stick, drift or lie, motors that stall, batteries that
sag, leaks, clocks that stop. The C of the board flies them, once under its supervisor and once
without. A red bar would be a vehicle lost that could have been recovered.
"""

import swimbladder as sb

vehicle = sb.load_vehicle("feup-em").replace({"supervisor.time_limit": "31 min"})
result = sb.faults(vehicle, missions=60, healthy=10)
print(result)
result.plot()
