"""A vehicle with a pump and a valve, in steps as long as its motion lets: the RODAS stepper.

`records` says what a lane holds, `motion` is the right-hand side and one Rosenbrock step, `step`
takes a step with its error, events and accounts, or lets time pass at rest, `line` is the oil
between pump and check valve, `drive` runs pump and valve.
"""

from pathlib import Path

from swimbladder.io.files import source_hash

__all__ = ["NAME"]

NAME = f"rodas-{source_hash(Path(__file__).parent.glob('*.py'))}"
"""Of this source: kernels that hold it are kept under it."""
