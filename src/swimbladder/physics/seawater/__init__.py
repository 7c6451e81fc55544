"""Sea water as a vehicle meets it: a cast turned once into a column, then only looked up.

::

    uniform_column   the paper's water of constant density, from a vehicle's [water]
    Cast             salinity and temperature over pressure, as a CTD measured them
    cast_column      a cast through TEOS-10 (gsw) -> Column: pressure, density, temperature by depth
    look_up          value and slope of a table at a depth
    WaterMotion      internal waves and swell
    motion_table     a WaterMotion as one array, for moved: displacement and speed w(z, t), compiled

gsw is imported where a cast is turned into a column, not before.
"""

from swimbladder.physics.seawater.cast import (
    Cast as Cast,
    cast_column as cast_column,
    check_rows as check_rows,
)
from swimbladder.physics.seawater.column import (
    Column as Column,
    look_up as look_up,
    uniform_column as uniform_column,
)
from swimbladder.physics.seawater.motion import (
    InternalWave as InternalWave,
    Swell as Swell,
    WaterMotion as WaterMotion,
    check_motion as check_motion,
    motion_table as motion_table,
    moved as moved,
)
