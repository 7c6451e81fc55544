"""A Kalman filter for depth, speed and a neutral volume that drifts, driven by a known volume.

`motion` carries the state over one step, `kernels` are the loops along a log, `depth_filter` is
what others call. Bare arrays inside; nothing here knows of files, logs or units.
"""
