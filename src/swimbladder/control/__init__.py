"""Control laws: each one pure function, ``step(parameters, state, measurement, reference)``.

`law` says what a law is, `cascade` is the paper's (Fig. 15, eqs 36-37, Table 3), `position_pid`
commands a position and integrates conditionally, `registry` names them, `protocol` is the pool
procedure (a)-(d) of section 3.1.
"""
