"""Control laws translated: into C99 for a microcontroller, and into a twin equal to it bit for bit.

`subset` reads a law's Python functions into the typed tree of `tree`; `c99` writes that tree as C,
`twin` runs it in float32, called by a counter of ticks as the C is; `library` makes an
Arduino library of it, with a golden trace that `golden` flies.
"""
