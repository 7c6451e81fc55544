"""
Which experiments to run
========================

One number per parameter, from the least time in the pool: `design_experiment` chooses the volume
changes and predicts the standard errors. In (b), single steps of any size cannot do as well as
moving the volume to and fro.
"""

import swimbladder as sb

design = sb.design_experiment(
    "feup-em",
    bottom_depth="4.5 m",
    depth_noise="2 mm",
    settling="5 min",
    max_moves=1,
    max_experiments=2,
)
print(design)
design.plot()
