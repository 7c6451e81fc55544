"""``python -m tests.frozen CASE ...``: write these cases anew; without a name, list them.

When that is allowed stands in README.md beside this file.
"""

import fnmatch
import os
import sys
import time

os.environ["MPLBACKEND"] = "Agg"
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from tests.frozen.cases import CASES
from tests.frozen.compare import first_difference
from tests.frozen.snapshot import run
from tests.frozen.store import load, path_of, save


def main(patterns: list[str]) -> int:
    wanted = [c for c in CASES if any(fnmatch.fnmatchcase(c.name, p) for p in patterns)]
    if not wanted:
        print("\n".join(f"{case.name}: {' '.join(case.arguments)}" for case in CASES))
        return 0 if not patterns else 2
    for case in wanted:
        begin = time.process_time()
        snapshot = run(case)
        took = f"{time.process_time() - begin:.1f} s"
        changed = "new"
        if path_of(case.name).exists():
            changed = first_difference(case, load(case.name), snapshot) or "as before"
        save(case.name, snapshot)
        print(f"{case.name}: exit {snapshot['exit']}, {took}, {changed}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
