"""
A stepper in a tank
===================

`ntnu-bv` is a float of 6 kg whose stepper moves a piston by 32 cm3 to either side of mid-stroke. In
a tank of 1.5 m its own controller goes down and up, with a depth sensor that counts in steps of
5 mm.
"""

import swimbladder as sb

run = sb.simulate(
    "ntnu-bv",
    setpoints=[(0.0, 1.1), (150.0, 0.5)],
    duration="5 min",
    start_depth="0.4 m",
    bottom_depth="1.5 m",
    seed=1,
)
print(run)
run.plot()
