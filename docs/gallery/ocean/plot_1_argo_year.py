"""
An Argo year and its battery
============================

Ten-day cycles: park at 1000 m, profile from 1900 m, transmit. A year of them, with every run of
pump and valve, and what is left of the battery.
"""

import swimbladder as sb

phases = [
    {"kind": "descend", "depth": "1000 m"},
    {"kind": "park", "depth": "1000 m", "tolerance": "50 m", "duration": "9 d"},
    {"kind": "descend", "depth": "1900 m", "name": "to the profile"},
    {"kind": "profile", "depth": "10 m", "tolerance": "5 m"},
    {"kind": "surface", "duration": "30 min"},
]
year = sb.mission("example-float", sb.Mission(phases=phases, cycles=37))
print(year)
year.plot()
