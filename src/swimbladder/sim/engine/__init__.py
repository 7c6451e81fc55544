"""The simulator's compiled core: exact between events, on bare floats and arrays.

`modes` names the linear pieces a vehicle's motion is made of, `chain` builds their exponentials,
`layers` is what uneven water adds to the neutral volume, `advance` carries one vehicle over one
step and finds the events in it, `crossings` says which limit a step may have crossed unseen,
`books` keeps its volume and energy accounts, `sensor` measures, `cache` keeps the compiled code
between processes. Nothing here knows of files, units or control laws.
"""
