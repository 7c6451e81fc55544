"""``python -m swimbladder`` is the command line."""

import sys

from swimbladder.cli import main

if __name__ == "__main__":
    sys.exit(main())
