"""The compiled core of missions: hours to years of a vehicle, from phase to phase.

The loop is that of `closed_loop`; `phases` is what a vehicle's motion means for the mission. Where
`engine.rodas` moves it, `rule` is the law of its processor, and `hooks` puts both into the loop; so
does `sampled` with the laws that are called at each sample. `names` says what stands where in the
arrays of phases and rows. Bare floats and arrays: what they
are made from is in `swimbladder.sim.mission`.
"""
