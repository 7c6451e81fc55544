"""Days at the pool, as logs."""

import numpy as np

from swimbladder.io.logs import Log
from tests.design.experiments.truth import run


def logs(plan, vehicle, rng, setting):
    """Return the logs of a campaign, with all errors that the setting states."""
    found, late = [], setting.delay_std * rng.normal()
    for number, one in enumerate(plan.experiments, start=1):
        time, depth, volume = run(
            plan,
            one,
            vehicle,
            rng,
            noise=setting.noise,
            quantum=setting.quantum,
            neutral=setting.neutral_std * rng.normal(),
            drift=setting.drift_std * rng.normal(),
            late=late,
        )
        line = np.arange(len(time)) + 2
        found.append(
            Log(source=f"{number}", time=time, depth=depth, volume=volume + 1e-4, line=line)
        )
    return found
