"""Simulation: the compiled steppers, the closed loop, missions, campaigns, missions with faults.

`engine` steps one vehicle exactly between events; `closed_loop` runs a law on it, one vehicle or
many; `pool` flies the paper's experiments; `mission` flies months in a real sea, `campaign` many
of them; `faults` flies missions in which things fail.
"""
