"""The compiled core of missions: hours to years of a vehicle, in steps as long as the motion lets.

`names` says what stands where in the arrays, `motion` is the right-hand side and one
Rosenbrock step, `leap` takes a step with its error, events and books, `moves` is what
the vehicle's processor does at a look, `fly` goes from phase to phase. Bare floats and arrays: what
they are made from is in `swimbladder.sim.mission`.
"""
