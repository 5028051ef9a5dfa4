"""`python -m mirrorstats` is the command `mirrorstats`."""

import sys

from ._command import main

if __name__ == "__main__":
    sys.exit(main())
