"""Planned motions: a step of depth in least time, with least volume moved or least energy."""

from swimbladder.design.planning.nominal_trajectory import LeastTime, least_time
from swimbladder.design.planning.run import GOALS, Plan, plan

__all__ = ["GOALS", "LeastTime", "Plan", "least_time", "plan"]
