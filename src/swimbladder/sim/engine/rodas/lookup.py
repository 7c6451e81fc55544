"""Values of the table at any place: cubic Hermite, one read, no search."""

from swimbladder.physics.seawater.column import look_up_bent
from swimbladder.sim.engine.cache import part

# Value, slope and curvature of a column at depth z [m]; of the columns over the line's pressure z
# is its logarithm, as in `line`, and the step that of its grid.
value = part(look_up_bent)
