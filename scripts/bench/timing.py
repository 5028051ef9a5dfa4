"""Times commands that take turns.

The time of a command is its wall-clock time from start to exit, or what the last line of its output says. Peak memory
is the largest resident set of the process as the operating system reports it at the exit (`ru_maxrss`), in MB.
"""

import collections
import os
import re
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

# `processor`: the seconds of all threads on the processor.
Run = collections.namedtuple("Run", "seconds megabytes processor")

# `command(folder, out)` gives the arguments. `out` is what it writes: a name in the benchmark's folder, or None.
# `inside`: the command prints its own seconds. `own`: it belongs to this repository, so it must not fail.
# `once`: it is slow, and has its turn in the first round only.
Contender = collections.namedtuple("Contender", "name command out inside own once", defaults=(None, False, False, False))


class Failed(Exception):
    """A command that did not exit with 0, with the last line that it said."""


def run(command, inside=False):
    """Runs a command; its seconds and peak memory, and what it printed."""
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as errors:
        start = time.perf_counter()
        process = subprocess.Popen([str(part) for part in command], stdout=out, stderr=errors)
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        errors.seek(0)
        if process.returncode != 0:
            raise Failed(f"exit code {process.returncode}: {last_line(errors.read())}")
        printed = out.read()
        if inside:
            seconds = float(printed.split()[-1])
        return Run(seconds, usage.ru_maxrss / 1024, usage.ru_utime + usage.ru_stime), printed


def last_line(text):
    """The last line that says something, with the names of files but not their folders."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return re.sub(r"/\S*/", "", lines[-1])[-400:] if lines else "no message"


def smallest_peak():
    """Peak memory that cannot be told from less, in MB: a child starts with the peak of the process that starts it."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def remove(path):
    """Removes a file or a folder. Some file systems take longer where there is something to replace."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


class Turns:
    """What each contender took, by (name of the data, name of the contender)."""

    def __init__(self):
        self.runs = collections.defaultdict(list)
        # Rivals that failed, with the reason; they have no further turn.
        self.failed = {}

    def take(self, data, folder, contender, outputs, counts=True):
        """One turn; gives what the contender printed, or None if it is a rival that failed."""
        key = (data, contender.name)
        if key in self.failed:
            return None
        out = outputs / f"{data}-{contender.out}" if contender.out else None
        if out:
            remove(out)
        try:
            found, printed = run(contender.command(folder, out), contender.inside)
        except Failed as failure:
            if contender.own:
                raise
            self.failed[key] = str(failure)
            return None
        if counts:
            self.runs[key].append(found)
        print(f"{data}: {contender.name}: {found.seconds:.3f} s, {found.megabytes:.0f} MB", file=sys.stderr, flush=True)
        return printed

    def best(self, data, name):
        """The shortest time, or None."""
        return min((run.seconds for run in self.runs[data, name]), default=None)

    def median(self, data, name):
        """The median time, or None."""
        return statistics.median(run.seconds for run in self.runs[data, name]) if self.runs[data, name] else None

    def peak(self, data, name):
        """The largest peak memory in MB, or None."""
        return max((run.megabytes for run in self.runs[data, name]), default=None)


def round_robin(turns, folders, contenders, outputs, rounds):
    """Rounds in which every contender has one turn on the data of every order."""
    for turn in range(rounds):
        print(f"round {turn + 1} of {rounds}", file=sys.stderr, flush=True)
        for data, folder in folders.items():
            for contender in contenders:
                if turn == 0 or not contender.once:
                    turns.take(data, folder, contender, outputs)
