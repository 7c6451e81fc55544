"""What the motor can do, learnt while it is driven hard.

A path is planned with a share of the motor's rate. Where the motor has less than that, because the
battery is lower than was reckoned with, or of ice or wear, a path at the old rate is not followed:
volume and depth come late, more and more, and large steps may swing without end, as rate limits
let them (Stein, IEEE Control Systems Magazine 23(4), 2003, 12). So the rate is watched where the
voltage is high and steady, paths are planned with what was seen, and one that the vehicle cannot
follow begins anew where it is.
"""

BEHIND = 5.0  # samples at full rate, that the volume may be behind before a path begins anew
_TRUST = 0.3  # in a sample that shows what the motor has
_SPARE = 1.1  # a motor with 1/1.1 of its rate follows paths as they are
_LEAST = 0.1  # share of its rate that is always assumed


def learn_ability(ability: float, drive: float, driven: float, moved: float, limit: float) -> float:
    """Return the share of its rate that the motor was seen to have [-].

    drive and driven [V]: voltage beyond the load of the sea at the sample before and at the one
    before that; moved [V]: what the volume moved since, as the voltage that moves it so; limit [V].
    """
    if abs(drive) < 0.5 * limit or drive * driven < 0.25 * limit * limit:
        return ability
    return ability + _TRUST * (min(max(moved / drive, _LEAST), 1.0) - ability)


def usable(ability: float) -> float:
    """Return the share of its jerk that a path is planned with [-]."""
    return min(1.0, _SPARE * ability)
