"""
Which experiments to run
========================

One number per parameter, from the least time in the pool: `design_experiment` chooses the volume
changes and predicts the standard errors. In (b), single steps of any size cannot do as well as
moving the volume to and fro.
"""

import swimbladder as sb

design = sb.design_experiment(
    "feup-em", pool_depth="4.5 m", sensor_std="2 mm", settling="5 min", moves=1, releases=2
)
print(design)
design.plot()
