"""Control laws translated: into C99 for a microcontroller, and into a twin equal to it bit for bit.

`subset` reads a law's Python functions into the typed tree of `tree`; `c99` writes that tree as C,
`twin` runs it in float32. `clock` counts the ticks between two calls of a law, in both; `library`
makes an Arduino library of it, with a golden trace that `golden` flies.
"""
