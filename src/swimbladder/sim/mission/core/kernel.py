"""`fly` and `phase_step`, compiled and kept on disk under a name of its own source.

Beside the folder's own hash (`engine.cache`): an edit here leaves the other kernels alone.
"""

from __future__ import annotations

from pathlib import Path

from swimbladder.io.files import source_hash
from swimbladder.sim.engine.cache import compiled
from swimbladder.sim.engine.rodas import NAME
from swimbladder.sim.mission.core import fly as _fly
from swimbladder.sim.mission.core import phase_step as _phase_step

_UNDER = f"mission-{source_hash(Path(__file__).parent.glob('*.py'))}-{NAME}"
fly_kernel = compiled(_fly.fly, under=_UNDER)
phase_step_kernel = compiled(_phase_step.phase_step, under=_UNDER)
