"""Planned motions: a step of depth in least time, with least volume moved or least energy."""

from swimbladder.planning.least import LeastTime, least_time

__all__ = ["LeastTime", "least_time"]
