"""`python -m mirrorstats` is the command `mirrorstats`."""

import sys

from ._command import main

sys.exit(main())
