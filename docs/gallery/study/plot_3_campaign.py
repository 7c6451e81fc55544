"""
A campaign, here or on a cluster
================================

Floats that leave the yard with a trim, a drag and a pump of their own. The store takes the flights
as they end, so a campaign that was killed goes on. On a cluster only the workers differ:
``Workers(executor="dask", scheduler="tcp://...")``, or ``Workers(part=(3, 8))`` in the third of
eight jobs.
"""

import tempfile
from pathlib import Path

import swimbladder as sb

vehicle = sb.load_vehicle("example-float")
mission = sb.Mission(
    phases=[
        {"kind": "descend", "depth": "1000 m"},
        {"kind": "park", "depth": "1000 m", "tolerance": "50 m", "duration": "2 d"},
        {"kind": "surface", "duration": "30 min"},
    ]
)
floats = sb.Floats(
    vehicle=vehicle,
    mission=mission,
    columns=[sb.water_of(vehicle, mission)],
    floats=64,
    cycles=2,
    spread=sb.Spread(trim="15 cm3", drag="15 %", pump="10 %"),
    store=Path(tempfile.mkdtemp()) / "campaign.zarr",
)
campaign = sb.campaign(floats, sb.Workers(executor="threads"))
print(campaign)
campaign.plot()
