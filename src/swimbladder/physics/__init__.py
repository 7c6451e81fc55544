"""One function per equation: actuators, oil, hull, drag, battery, seawater, and their sum.

`actuator`, `electric`, `motor`, `oil`, `steady_drives`: how a drive changes the
volume; `buoyancy_engine` any of them at steady speed; `hull`, `seawater`: what the vehicle
displaces and what the water weighs; `battery`: what is left in it; `dynamics`: the vertical motion.
"""
