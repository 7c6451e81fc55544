"""Every law on the same scenarios: how soon, how still, and what it costs in volume and energy.

`contenders` says what is flown and by which laws with which gains, `run` flies them, in
swell too, measures, and finds those that no other beats.
"""

from swimbladder.design.law_comparison.contenders import SCENARIOS as SCENARIOS
from swimbladder.design.law_comparison.run import (
    LawComparison as LawComparison,
    compare_laws as compare_laws,
)
