"""How much a command may print."""


def few(printed: str, end: str = "") -> str:
    """Return what a command printed on stdout, of 15 lines at most, which ends so."""
    lines = printed.splitlines()
    assert 0 < len(lines) <= 15, printed
    assert end in lines[-1], printed
    return printed
