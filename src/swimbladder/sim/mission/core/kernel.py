"""`fly`, compiled and kept on disk under a name of its own source.

Beside the folder's own hash (`engine.cache`): an edit here leaves the other kernels alone.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from swimbladder.sim.engine.cache import compiled
from swimbladder.sim.mission.core import fly as _fly

__all__ = ["fly_kernel"]


def _name() -> str:
    digest = hashlib.sha256()
    try:
        for source in sorted(Path(__file__).parent.glob("*.py")):
            digest.update(source.name.encode() + source.read_bytes())
    except OSError:  # inside an archive: the version has to do
        digest.update(b"no source")
    return f"mission-{digest.hexdigest()[:16]}"


fly_kernel = compiled(_fly.fly, under=_name())
