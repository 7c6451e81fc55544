"""A Kalman filter for depth, speed and a neutral volume that drifts, driven by a known volume.

`kernels` carry the state over one step and along a log, `depth_filter` is what others call, with
the records of `kernels`. Nothing here knows of files, logs or units.
"""
