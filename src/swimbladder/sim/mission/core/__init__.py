"""The compiled core of missions: hours to years of a vehicle, from phase to phase.

The loop is that of `closed_loop`; `phases` says what a phase, a row of the trajectory and a
cycle are, and what a vehicle's motion means for the mission. Where `engine.rodas` moves it, `hooks`
has the law of its processor and puts both into the loop; so does `sampled` with the laws that are
called at each sample. What they are made from is in `swimbladder.sim.mission`.
"""
