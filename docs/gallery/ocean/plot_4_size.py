"""
Which pump, motor and battery?
==============================

Every combination of the parts on the shelf that does 200 cycles to 1000 m, by what it weighs and
what a cycle takes. Put your own shelf in with `load_parts`.
"""

import swimbladder as sb

found = sb.size("example-float", sb.Dive(max_depth=1000.0, cycles=200), sweeps=False)
print(found)
found.plot()
