"""A vehicle with a pump and a valve, in steps as long as its motion lets: the RODAS stepper.

`names` says what stands where in the arrays, `motion` is the right-hand side and one Rosenbrock
step, `leap` takes a step with its error, events and accounts, `rest` lets time pass without steps,
`line` is the oil between pump and check valve, `sensing` what the sensors give.
"""
