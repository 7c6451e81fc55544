"""The pool procedure of section 3.1 as a guided day, on a simulated vehicle or a growing log.

`segments` finds rest, changes of volume and glides in samples as they come, `tasks` says what is to
be done, `day` keeps the experiments, identifies the vehicle after each and says when to stop
(`verdict`) and what went wrong; `follow` goes through a day, by a file that grows or a vehicle that
`rehearsal` simulates.
"""

from swimbladder.design.pool_day.day import News, PoolDay
from swimbladder.design.pool_day.follow import GrowingLog, finished, follow, rehearse
from swimbladder.design.pool_day.rehearsal import Operator
from swimbladder.design.pool_day.segments import Rules, Sample
from swimbladder.design.pool_day.tasks import Task, paper_tasks, plan_tasks
from swimbladder.design.pool_day.verdict import Asked, Target

__all__ = [
    "Asked",
    "GrowingLog",
    "News",
    "Operator",
    "PoolDay",
    "Rules",
    "Sample",
    "Target",
    "Task",
    "finished",
    "follow",
    "paper_tasks",
    "plan_tasks",
    "rehearse",
]
