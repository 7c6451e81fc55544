"""The simulator's compiled core: exact between events, on bare floats and arrays.

`modes` names the linear pieces a vehicle's motion is made of, also in uneven water, `chain` builds
their exponentials, `advance` carries one vehicle over one step and finds the events in it,
`accounts` keeps its volume and energy accounts, `sensor` measures, `cache` keeps the compiled code
between processes. Nothing here knows of files, units or control laws.
"""
