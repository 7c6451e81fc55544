"""The pool procedure of section 3.1 as a guided day, on a simulated vehicle or a growing log.

`segments` finds rest, changes of volume and glides in samples as they come, `day` says what is to
be done, keeps the experiments, identifies the vehicle after each and says when to stop (`verdict`)
and what went wrong; `rehearsal` goes through a day, by a file that grows or a simulated vehicle.
"""

from swimbladder.design.pool_day.day import News as News, PoolDay as PoolDay
from swimbladder.design.pool_day.rehearsal import (
    GrowingLog as GrowingLog,
    finished as finished,
    follow as follow,
    rehearse as rehearse,
)
from swimbladder.design.pool_day.rehearsal import Operator as Operator
from swimbladder.design.pool_day.segments import Rules as Rules, Sample as Sample
from swimbladder.design.pool_day.day import (
    Task as Task,
    paper_tasks as paper_tasks,
    plan_tasks as plan_tasks,
)
from swimbladder.design.pool_day.verdict import Asked as Asked, Target as Target
