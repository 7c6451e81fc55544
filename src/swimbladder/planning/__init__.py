"""Planned motions: a step of depth in least time, with least volume moved or least energy."""

from swimbladder.planning.least import LeastTime, least_time
from swimbladder.planning.result import Plan
from swimbladder.planning.run import GOALS, plan

__all__ = ["GOALS", "LeastTime", "Plan", "least_time", "plan"]
