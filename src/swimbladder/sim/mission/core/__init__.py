"""The compiled core of missions: hours to years of a vehicle, from phase to phase.

`engine.rodas` moves the vehicle, `moves` is what its processor does at a look, `phases` what its
motion means for the mission, `fly` goes from phase to phase, `names` says what stands where in the
arrays of phases and rows. Bare floats and arrays: what they are made from is in
`swimbladder.sim.mission`.
"""
