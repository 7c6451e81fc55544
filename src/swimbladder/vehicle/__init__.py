"""What a vehicle is made of: frozen, keyword-only, validated.

Numbers are SI floats inside; every field also takes a text with its unit (``"350 cm3"``).
The paper's symbols stand in the fields that were identified (K1, T1, K2, T2, psi), words elsewhere.

::

    Vehicle
    |-- water       Water
    |-- actuator    ElectrohydraulicActuator | ElectromechanicalActuator    from datasheets
    |               UnifiedActuator (Table 1) | IdentifiedActuator (eq. 33) | Positioner (stepper)
    |               PumpAndValve     an electrohydraulic drive as built, for missions
    |-- supply      Supply           battery: voltage, internal resistance, capacity
    |-- driver      Driver           what is lost between battery and motor
    |-- loads       Load, ...        what else draws from the battery
    |-- stroke      Stroke           smallest and largest volume, 0 is mid-stroke
    |-- hull        Hull             displaced volume, compressibility, where it emerges
    |               HullPart         a component of it
    |-- motion      PhysicalMotion | IdentifiedMotion (eqs 26-29)
    |-- sensors     Sensors          noise and quantum of depth and volume
    |-- controller  Controller       the name of a law, its sample time and gains
    |-- supervisor  Supervisor       when the firmware brings the vehicle up
    `-- identified  Identified       how sure the identified numbers are
"""

from swimbladder.vehicle.actuators import (
    Actuator,
    DatasheetPump,
    Driver,
    ElectrohydraulicActuator,
    ElectromechanicalActuator,
    HydraulicDrive,
    IdentifiedActuator,
    Load,
    Motor,
    Oil,
    Phase,
    Positioner,
    PowerLawPump,
    PumpAndValve,
    ScrewDrive,
    Supply,
    UnifiedActuator,
    Valve,
)
from swimbladder.vehicle.schema import Parameters, Unit, field_unit, input_error
from swimbladder.vehicle.vehicle import (
    Between,
    Controller,
    Drag,
    Hull,
    HullPart,
    Identified,
    IdentifiedMotion,
    LawNumbers,
    Motion,
    PhysicalMotion,
    Sensors,
    Stroke,
    Supervisor,
    Vehicle,
    Water,
)

__all__ = [
    "Actuator",
    "Between",
    "Controller",
    "DatasheetPump",
    "Drag",
    "Driver",
    "ElectrohydraulicActuator",
    "ElectromechanicalActuator",
    "Hull",
    "HullPart",
    "HydraulicDrive",
    "Identified",
    "IdentifiedActuator",
    "IdentifiedMotion",
    "LawNumbers",
    "Load",
    "Motion",
    "Motor",
    "Oil",
    "Parameters",
    "Phase",
    "PhysicalMotion",
    "Positioner",
    "PowerLawPump",
    "PumpAndValve",
    "ScrewDrive",
    "Sensors",
    "Stroke",
    "Supervisor",
    "Supply",
    "UnifiedActuator",
    "Unit",
    "Valve",
    "Vehicle",
    "Water",
    "field_unit",
    "input_error",
]
