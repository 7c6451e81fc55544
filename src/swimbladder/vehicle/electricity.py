"""Battery, driver and hotel loads: what the electricity on board comes from and goes to."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StrictBool

from swimbladder.vehicle.schema import Parameters, Unit

Phase = Literal["descend", "park", "profile", "hold", "surface"]


class Supply(Parameters):
    """The battery: the voltage that limits the motor, and what is in it."""

    voltage: Annotated[float, Unit("V"), Field(gt=0.0)] = Field(description="open-circuit voltage")
    internal_resistance: Annotated[float, Unit("ohm"), Field(ge=0.0)] = Field(
        0.0, description="resistance of battery and leads"
    )
    capacity: Annotated[float, Unit("J"), Field(gt=0.0)] | None = Field(
        None, description="energy in the full battery at 20 degC; not given: not stated"
    )
    cold_share: Annotated[float, Unit(""), Field(gt=0.0, le=1.0)] = Field(
        1.0, description="share of the capacity that can be drawn at 0 degC; linear in between"
    )
    self_discharge: Annotated[float, Unit("1/s"), Field(ge=0.0, le=1e-6)] = Field(
        0.0, description="share of what is in it that is lost per time"
    )


class Driver(Parameters):
    """The motor's driver, between battery and motor; without this table it loses nothing.

    `energy` and `mission` count it, `simulate` does not.
    """

    efficiency: Annotated[float, Unit(""), Field(gt=0.0, le=1.0)] = Field(
        1.0, description="share of the battery's power that reaches the motor"
    )
    standby_power: Annotated[float, Unit("W"), Field(ge=0.0)] = Field(
        0.0, description="power it draws all the time, beside that of the motor"
    )
    regenerates: StrictBool = Field(
        False, description="whether a motor driven by the sea charges the battery"
    )


class Load(Parameters):
    """Something else that draws from the battery, counted by `mission`: a processor, a radio."""

    name: str = Field(min_length=1, description="what draws it")
    power: Annotated[float, Unit("W"), Field(ge=0.0)] = Field(
        0.0, description="power while it is on"
    )
    phases: tuple[Phase, ...] = Field(
        (), description="phases of a mission in which it is on; empty: all of them"
    )
    energy_per_surfacing: Annotated[float, Unit("J"), Field(ge=0.0)] = Field(
        0.0, description="energy of what it does once at each surfacing"
    )
