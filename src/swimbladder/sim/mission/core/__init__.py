"""The compiled core of missions: hours to years of a vehicle, from phase to phase.

The loop is that of `closed_loop`, and `engine.rodas` moves the vehicle in it: `rule` is the law of
its processor, `phases` what its motion means for the mission, `hooks` puts both into the loop, and
`names` says what stands where in the arrays of phases and rows. Bare floats and arrays: what they
are made from is in `swimbladder.sim.mission`.
"""
