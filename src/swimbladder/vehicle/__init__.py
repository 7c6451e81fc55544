"""What a vehicle is made of: frozen, keyword-only, validated.

Numbers are SI floats inside; every field also takes a text with its unit (``"350 cm3"``).
The paper's symbols stand in the fields that were identified (K1, T1, K2, T2, psi), words elsewhere.

::

    Vehicle
    |-- water       Water
    |-- actuator    ElectrohydraulicActuator | ElectromechanicalActuator    from datasheets
    |               UnifiedActuator (Table 1) | IdentifiedActuator (eq. 33) | Positioner (stepper)
    |               PumpAndValve     an electrohydraulic drive as built
    |               ActuatorKind     of another package, which acts as one of these
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
    Actuator as Actuator,
    ActuatorKind as ActuatorKind,
    AnyActuator as AnyActuator,
    CurvePump as CurvePump,
    DatasheetPump as DatasheetPump,
    Driver as Driver,
    ElectrohydraulicActuator as ElectrohydraulicActuator,
    ElectromechanicalActuator as ElectromechanicalActuator,
    HydraulicDrive as HydraulicDrive,
    IdentifiedActuator as IdentifiedActuator,
    Load as Load,
    Motor as Motor,
    Oil as Oil,
    Phase as Phase,
    Positioner as Positioner,
    PowerLawPump as PowerLawPump,
    Pump as Pump,
    PumpAndValve as PumpAndValve,
    ScrewDrive as ScrewDrive,
    Supply as Supply,
    UnifiedActuator as UnifiedActuator,
    Valve as Valve,
)
from swimbladder.vehicle.schema import (
    Parameters as Parameters,
    Unit as Unit,
    field_unit as field_unit,
    input_error as input_error,
)
from swimbladder.vehicle.vehicle import (
    Between as Between,
    Controller as Controller,
    Drag as Drag,
    Hull as Hull,
    HullPart as HullPart,
    Identified as Identified,
    IdentifiedMotion as IdentifiedMotion,
    LawNumbers as LawNumbers,
    Motion as Motion,
    PhysicalMotion as PhysicalMotion,
    Sensors as Sensors,
    Stroke as Stroke,
    Supervisor as Supervisor,
    Vehicle as Vehicle,
    Water as Water,
)
