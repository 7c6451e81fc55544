"""From measured logs to parameters with confidence intervals, and models compared with logs.

`motion` estimates the vertical motion, from pool logs and deep dives, `actuator` the drive's
constants from its own signals; `comparison` drives a model with a log; `kalman` holds the filters.
"""
