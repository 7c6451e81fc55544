"""
The paper's step
================

The prototype of Falcão Carneiro et al. 2023 goes from 1.5 to 3 m under the controller of the paper.
The volume first goes in, so that it sinks, comes back to brake, and ends a little further out than
it began: the hull is compressed.
"""

import swimbladder as sb

vehicle = sb.load_vehicle("feup-em")
step = sb.simulate(vehicle, step=("1.5 m", "3 m"))
print(sb.step_metrics(step.time, step.depth, start=1.5, target=3.0))
step.plot()
