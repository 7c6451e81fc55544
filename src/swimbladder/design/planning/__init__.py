"""Planned motions: a step of depth in least time, with least volume moved or least energy."""

from swimbladder.design.planning.run import least_time as least_time
from swimbladder.design.planning.run import Plan as Plan, plan as plan
