"""The body that the actuator moves and the water around it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from swimbladder.vehicle.schema import Parameters, Unit, refusal

_ROUNDING = 1e-4  # share of the displaced volume by which its parts may miss it: rounded numbers


class Water(Parameters):
    """The water the vehicle moves in, of constant density."""

    density: Annotated[float, Unit("kg/m3"), Field(ge=900.0, le=1100.0)] = 1000.0
    """density of the water rho"""
    gravity: Annotated[float, Unit("m/s2"), Field(ge=9.7, le=9.9)] = 9.80665
    """gravity g"""
    compressibility: Annotated[float, Unit("1/Pa"), Field(ge=0.0, le=1e-9)] = 4.4e-10
    """compressibility of this water, which the constant density leaves out and psi counts beyond;
    that of sea water near the surface (TEOS-10), fresh water has 4.7e-10"""
    temperature: Annotated[float, Unit("degC"), Field(ge=-5.0, le=60.0)] = 15.0
    """temperature in which trim_error holds"""

    @property
    def specific_weight(self) -> float:
        """Weight of a volume of water, k_b = rho g [N/m3]."""
        return self.density * self.gravity


class Stroke(Parameters):
    """The volume change that the end stops allow; 0 is mid-stroke, positive is lighter."""

    minimum: Annotated[float, Unit("m3")]
    """volume with the piston fully in"""
    maximum: Annotated[float, Unit("m3")]
    """volume with the piston fully out"""
    switch_margin: Annotated[float, Unit("m3"), Field(ge=0.0)] | None = None
    """volume before either end stop at which a limit switch cuts the command that drives on; the
    piston may coast to the stop; not given: no switches"""

    @property
    def lowest(self) -> float:
        """The least volume that a command drives to [m3]: the end stop, or the switch before it."""
        return self.minimum + (self.switch_margin or 0.0)

    @property
    def highest(self) -> float:
        """The largest volume that a command drives to [m3]."""
        return self.maximum - (self.switch_margin or 0.0)

    def check(self) -> None:
        """Refuse fields that do not go together."""
        if self.minimum >= self.maximum:
            what = (
                f"the minimum, {self.minimum * 1e6:g} cm3, is not below the maximum, "
                f"{self.maximum * 1e6:g} cm3"
            )
            remedy = "Volumes are counted from mid-stroke: the minimum is usually negative"
            raise refusal(what, remedy, "minimum")
        if self.lowest >= self.highest:
            remedy = "Give the volume between a switch and its end stop"
            raise refusal("the switches leave no stroke between them", remedy, "switch_margin")


class HullPart(Parameters):
    """A component that displaces water: a tube, a dome, foam, the oil outside it."""

    name: str = Field(min_length=1)
    """what the part is called"""
    volume: Annotated[float, Unit("m3"), Field(gt=0.0)]
    """water that it displaces at the surface, at reference_temperature"""
    compressibility: Annotated[float, Unit("1/Pa"), Field(ge=0.0, le=1e-7)]
    """share of that volume it loses per pressure"""
    thermal_expansion: Annotated[float, Unit("1/K"), Field(ge=-1e-3, le=1e-2)] = 0.0
    """share of that volume it gains per kelvin (three times the linear one)"""
    stiffening: Annotated[float, Unit("1/Pa2"), Field(ge=-1e-14, le=1e-14)] = 0.0
    """what the compressibility loses per pressure, down to 0; negative: it grows"""


class Hull(Parameters):
    """The body: how much it displaces, how it compresses, where it emerges."""

    displaced_volume: Annotated[float, Unit("m3"), Field(gt=0.0)]
    """volume displaced at mid-stroke V_p"""
    psi: Annotated[float, Unit("m3/m"), Field(ge=-1e-3, le=1e-3)]
    """volume the hull loses per metre beyond what the water does, eq. (31); negative: the hull is
    stiffer than water"""
    waterplane_area: Annotated[float, Unit("m2"), Field(gt=0.0)]
    """cross-section of the hull at the water line"""
    emergence_depth: Annotated[float, Unit("m")] = 0.0
    """depth of the pressure sensor at which the hull starts to emerge"""
    height: Annotated[float, Unit("m"), Field(gt=0.0)]
    """height of the part of the hull that can emerge"""
    depth_limit: Annotated[float, Unit("m"), Field(gt=0.0)] | None = None
    """depth the vehicle is rated for; not given: not stated"""
    trapped_air: Annotated[float, Unit("m3"), Field(ge=0.0)] = 0.0
    """air caught outside the hull, within displaced_volume, as it is at the surface: Boyle's law,
    beside psi; for ballast, mission and a cast; else psi only"""
    reference_temperature: Annotated[float, Unit("degC"), Field(ge=-5.0, le=60.0)] = 15.0
    """temperature of the hull at which it displaces displaced_volume"""
    thermal_time_constant: Annotated[float, Unit("s"), Field(ge=0.0, le=1e6)] = 0.0
    """time in which the parts come within 1/e of the water's temperature; 0: they have it at once;
    for mission and campaign"""
    parts: tuple[HullPart, ...] = ()
    """components of displaced_volume, for ballast, mission and simulate --cast; none: one that psi
    tells of"""

    def check(self) -> None:
        """Refuse fields that do not go together."""
        if self.trapped_air >= self.displaced_volume:
            what = f"it is not less than the displaced volume, {self.displaced_volume * 1e6:g} cm3"
            remedy = "Give the air that is caught outside the pressure hull"
            raise refusal(what, remedy, "trapped_air")
        names = [part.name for part in self.parts]
        if twice := [n for k, n in enumerate(names) if n in names[:k]]:
            what = f"two parts have the name {twice[0]!r}"
            raise refusal(what, "Give each a name of its own", "parts")
        total = sum(part.volume for part in self.parts) + self.trapped_air
        if self.parts and abs(total - self.displaced_volume) > _ROUNDING * self.displaced_volume:
            what = (
                f"the parts displace {total * 1e6:.8g} cm3, trapped air included, and not the "
                f"displaced volume of {self.displaced_volume * 1e6:.8g} cm3"
            )
            remedy = "List every part that displaces water, or correct displaced_volume"
            raise refusal(what, remedy, "parts")


class Drag(Parameters):
    """Hydrodynamic drag, eq. (16), symmetric in speed but for `rising_ratio`.

    linear: k_dl w. quadratic: k_dt w|w|. switched: laminar up to epsilon, turbulent above,
    continuous there. switched-literal: eq. (16) as printed, which jumps at epsilon.
    blended: k_dl w + k_dt w|w|.
    """

    law: Literal["linear", "quadratic", "switched", "switched-literal", "blended"] = "linear"
    """how the drag grows with speed"""
    k_dl: Annotated[float, Unit("N s/m"), Field(ge=0.0)] = 0.0
    """laminar drag coefficient"""
    k_dt: Annotated[float, Unit("N s2/m2"), Field(ge=0.0)] = 0.0
    """turbulent drag coefficient"""
    epsilon: Annotated[float, Unit("m/s"), Field(ge=0.0)] = 0.0
    """speed at which drag turns turbulent"""
    rising_ratio: Annotated[float, Unit(""), Field(ge=0.1, le=10.0)] = 1.0
    """drag while rising over that while sinking at the same speed, which the coefficients give; for
    mission, ballast, energy and size, the others refuse it"""

    def check(self) -> None:
        """Refuse fields that do not go together."""
        needs = {
            "linear": ("k_dl",),
            "quadratic": ("k_dt",),
            "switched": ("k_dl", "k_dt", "epsilon"),
            "switched-literal": ("k_dl", "k_dt", "epsilon"),
            "blended": ("k_dl", "k_dt"),
        }[self.law]
        for name in ("k_dl", "k_dt", "epsilon"):
            if name in needs and getattr(self, name) <= 0.0:
                raise refusal(f"the drag law {self.law!r} needs it above 0", f"Add {name}", name)
            if name not in needs and getattr(self, name) != 0.0:
                what = f"the drag law {self.law!r} does not use it"
                raise refusal(what, "Leave it out, or choose another law", name)


class PhysicalMotion(Parameters):
    """Masses and drag, each from where it comes."""

    kind: Literal["physical"] = "physical"
    dry_mass: Annotated[float, Unit("kg"), Field(gt=0.0)]
    """mass of the vehicle in air"""
    entrained_mass: Annotated[float, Unit("kg"), Field(ge=0.0)] = 0.0
    """mass of the water enclosed in free-flooded spaces"""
    added_mass: Annotated[float, Unit("kg"), Field(ge=0.0)] = 0.0
    """mass of the water accelerated around the hull"""
    drag: Drag
    """hydrodynamic drag, eq. (16)"""


class IdentifiedMotion(Parameters):
    """The vertical motion as identified in shallow water (eqs 26-29); drag is laminar."""

    kind: Literal["identified"] = "identified"
    K2: Annotated[float, Unit("1/m2/s"), Field(gt=0.0)]
    """speed per volume rho g/k_dl, eq. (28)"""
    T2: Annotated[float, Unit("s"), Field(gt=0.0)]
    """time constant m/k_dl, eq. (29)"""


Motion = Annotated[PhysicalMotion | IdentifiedMotion, Field(discriminator="kind")]
