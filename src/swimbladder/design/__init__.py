"""Design: linear analysis, tuning, stability, plans, sizing, ballast, energy and experiments.

`linear` and `analysis` linearise and judge a loop; `tuning` searches for gains, `law_comparison`
compares laws, `stability` confirms; `planning` computes optimal steps; `sizing`, `ballast` and
`energy` choose parts, weights and batteries; `experiments` designs pool experiments and `pool_day`
guides through them.
"""
