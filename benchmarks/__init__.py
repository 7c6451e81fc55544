"""The one-hour closed-loop mission, side by side with the peers: ``python -m benchmarks``.

`mission` says what is run, `reference` what is right; `ours`, `c_loop`, `jax_scan`, `numpy_loop`,
`scipy_loop` and `control_loop` run it; `run` times them in turn, `startup` times the commands and
`memory` a large ensemble, `table` prints.
"""
