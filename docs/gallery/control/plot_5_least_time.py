"""
The best that the vehicle allows
================================

A linear program finds the least time that any controller needs for a step, with 12 V and the stroke
that there is. The dashed line is what the paper's controller makes of the same step.
"""

import swimbladder as sb

best = sb.plan("feup-em", ("1.5 m", "3 m"))
print(best)

step = sb.simulate("feup-em", step=("1.5 m", "3 m"), duration="36 s")
figure = best.plot()
figure.axes[0].plot(step.time, step.depth, "k--", label="the paper's controller")
figure.axes[0].legend()
figure
