"""Every law on the same scenarios: how soon, how still, and what it costs in volume and energy.

`scenarios` says what is flown, `swell` what waves do to the depth that is read, `contenders` which
laws with which gains, `fly` flies them and measures, `pareto` finds those that no other beats,
`store` keeps what is done, `run` puts them together.
"""

from __future__ import annotations

from swimbladder.design.law_comparison.result import LawComparison
from swimbladder.design.law_comparison.run import compare_laws
from swimbladder.design.law_comparison.scenarios import SCENARIOS

__all__ = ["SCENARIOS", "LawComparison", "compare_laws"]
