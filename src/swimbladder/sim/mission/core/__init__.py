"""The compiled core of missions: hours to years of a vehicle, from phase to phase.

The loop is that of `closed_loop`; `phases` is what a vehicle's motion means for the mission. Where
`engine.rodas` moves it, `rule` is the law of its processor, and `hooks` puts both into the loop; so
does `sampled` with the laws that are called at each sample. `records` says what a phase, a row
of the trajectory and a cycle are. What they are made from is in `swimbladder.sim.mission`.
"""
