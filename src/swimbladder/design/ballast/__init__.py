"""Ballast: the volume a vehicle rests with in a real sea, what to add, and whether the stroke does.

::

    Uncertainty          1 sigma of what is not known: mass, volume, psi, heat, air, trim, density
    seas             casts -> the water down to where a vehicle goes; with_mass: that on the scale
    ballast          a vehicle, casts, a target -> Ballasting: mass to add, needs, margins, odds
    ballasted        the vehicle with that mass in the water of the cast

Volumes are those of the drive, 0 at mid-stroke; the law is `swimbladder.physics.hull`.
"""

from swimbladder.design.ballast.run import (
    Ballasting,
    Target,
    Uncertainty,
    ballast,
    ballasted,
    material_of,
    seas,
    uncertainty_of,
    with_mass,
)

__all__ = [
    "Ballasting",
    "Target",
    "Uncertainty",
    "ballast",
    "ballasted",
    "material_of",
    "seas",
    "uncertainty_of",
    "with_mass",
]
