"""The command `mirrorstats`: one call of the native library."""

import signal
import sys


def main() -> int:
    """Run the command line with the arguments of this process; returns its exit code."""
    # As in the plain program, Ctrl-C ends a command unless the command handles it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from . import _native

    return _native.run(["mirrorstats", *sys.argv[1:]])
