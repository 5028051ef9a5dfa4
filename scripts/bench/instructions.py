#!/usr/bin/env python3
"""Compares the instructions of commands with benches/instructions.txt: `instructions.py PROGRAM GENERATE [--bless]`.

`make instructions` calls it; `make bless-instructions` writes the file anew. callgrind counts each command on one thread
over a small trace as other programs write them. Times differ by tens of per cent between two runs on a busy machine, these
counts by 0.01 %, or by up to 0.8 % where two threads happen to read the same footer. The baseline is therefore the least of
three runs. A command with more than 3 % more instructions fails, with the functions that grew.
"""

import argparse
import collections
import os
import re
import subprocess
import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent.parent
BASELINE = REPOSITORY / "benches/instructions.txt"
STEPS = 100_000
MOST_GROWTH = 0.03
# Functions with a smaller share of a command are not listed.
LEAST_SHARE = 0.005
COMMANDS = {
    "score": ["score", "wild", "-o", "scores.parquet"],
    "report": ["report", "wild", "--out", "report"],
    "stats": ["stats", "wild"],
    "trace validate": ["trace", "validate", "wild"],
    "trace info": ["trace", "info", "wild"],
    "diff": ["diff", "paper", "inclusive.toml", "wild"],
}
# Hash maps have random keys, which change the counts by half a per cent: here the system's random bytes are zeros.
NOT_RANDOM = """#include <string.h>
#include <sys/types.h>
ssize_t getrandom(void *bytes, size_t length, unsigned flags) { memset(bytes, 0, length); return length; }
"""
HEADER = """# Instructions of each command and of its functions, without those that they call: scripts/bench/instructions.py.
# Written by `make bless-instructions`, compared by `make instructions`. {versions}
"""


def output(command, **more):
    return subprocess.run(command, check=True, capture_output=True, text=True, **more).stdout.strip()


def versions():
    """What changes the counts without a change here."""
    libc = os.confstr("CS_GNU_LIBC_VERSION")
    return f"{output(['rustc', '--version'])}; {output(['valgrind', '--version'])}; {libc}"


def prepare(generate, work):
    """A folder with the trace; the paths in commands are relative to it, so that their lengths are the same everywhere."""
    subprocess.run(["rm", "-rf", work], check=True)
    work.mkdir(parents=True)
    shape = ["--wild", "--steps", str(STEPS), "--files", "2", "--threads", "1"]
    subprocess.run([generate, *shape, "--out", work / "wild"], check=True)
    library = ["cc", "-shared", "-fPIC", "-x", "c", "-", "-o", work / "zeros.so"]
    subprocess.run(library, input=NOT_RANDOM, text=True, check=True)
    (work / "inclusive.toml").write_bytes((REPOSITORY / "examples/definitions/inclusive.toml").read_bytes())


def counted(program, arguments, work):
    """callgrind's file for one command, as text."""
    profile = work / "callgrind.out"
    # Uncompressed names and no positions: each line can be read alone.
    tool = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={profile}", "--compress-strings=no", "--compress-pos=no"]
    environment = {"PATH": os.environ["PATH"], "LD_PRELOAD": str(work / "zeros.so"), "LC_ALL": "C", "NO_COLOR": "1", "COLUMNS": "100", "MIRRORSTATS_CONFIG_FILE": ""}
    # The shortest program name that is the same on every machine.
    (work / "mirrorstats").unlink(missing_ok=True)
    (work / "mirrorstats").symlink_to(program)
    command = [*tool, "./mirrorstats", *arguments, "--threads", "1"]
    ended = subprocess.run(command, cwd=work, env=environment, capture_output=True, text=True)
    if ended.returncode != 0:
        sys.exit(f"error: {' '.join(arguments)}: exit code {ended.returncode}\n{ended.stderr[-2000:]}")
    return profile.read_text(errors="replace")


def functions(profile):
    """Instructions of each function without its callees, and what each function was called by: callee to callers."""
    own, callers = collections.Counter(), collections.defaultdict(collections.Counter)
    function = callee = None
    is_call = False
    for line in profile.splitlines():
        if line.startswith("fn="):
            function = named(line[3:])
        elif line.startswith("cfn="):
            callee = named(line[4:])
        elif line.startswith("calls="):
            is_call = True
        elif re.match(r"\d+ \d+$", line) and function:
            cost = int(line.split()[1])
            if is_call:
                callers[callee][function] += cost
            else:
                own[function] += cost
            is_call = False
    return own, callers


def named(symbol):
    """A function without the compiler's hash and callgrind's mark of recursion."""
    return re.sub(r"::h[0-9a-f]{16}|'\d+$", "", symbol)


def owner(function, callers):
    """The nearest function of this repository that calls `function`, by its most expensive callers."""
    seen = set()
    while function and not function_is_ours(function) and function not in seen:
        seen.add(function)
        function = next((name for name, _ in callers[function].most_common() if name not in seen), None)
    return function


def function_is_ours(function):
    return "mirrorstats" in function.split(" as ")[0]


def measure(options):
    prepare(options.generate.resolve(), options.work)
    found = {}
    for name, arguments in COMMANDS.items():
        runs = [functions(counted(options.program.resolve(), arguments, options.work)) for _ in range(3 if options.bless else 1)]
        found[name] = min(runs, key=lambda run: run[0].total())
        print(f"{name}: {found[name][0].total():,} instructions", file=sys.stderr, flush=True)
    return found


def lines(found):
    for command, (own, _) in found.items():
        total = own.total()
        yield f"\n{total:>12} {command}"
        yield from (f"{cost:>12}   {name}" for name, cost in own.most_common() if cost >= LEAST_SHARE * total)


def baseline(text):
    """By command: its instructions, and those of its functions."""
    known, functions_of = {}, {}
    for line in text.splitlines():
        parts = re.match(r" *(\d+) (  )?(.*)", line)
        if parts and parts[2]:
            functions_of[parts[3]] = int(parts[1])
        elif parts:
            functions_of = {}
            known[parts[3]] = (int(parts[1]), functions_of)
    return known


def grown(own, callers, total, before):
    """The three functions that grew most, as lines."""
    # A function that the baseline does not list had a smaller share than those that it lists.
    growth = collections.Counter({name: cost - before.get(name, round(LEAST_SHARE * total)) for name, cost in own.items()})
    for name, by in growth.most_common(3):
        caller = owner(name, callers)
        for_whom = f", called by {caller}" if caller and caller != name else ""
        yield f"  {by:+,} instructions ({by / total:+.1%}): {name}{for_whom}"


def compare(found):
    """The commands that got worse, as lines."""
    if not BASELINE.exists():
        sys.exit(f"error: no {BASELINE.name}; `make bless-instructions` writes it")
    known = baseline(BASELINE.read_text())
    worse = []
    for command, (own, callers) in found.items():
        if command not in known:
            worse.append(f"{command}: {BASELINE.name} does not have it")
            continue
        total, before = known[command]
        change = own.total() / total - 1
        if change > MOST_GROWTH:
            worse += [f"{command}: {total:,} instructions before, {own.total():,} now, {change:+.1%}"]
            worse += grown(own, callers, total, before)
        else:
            print(f"{command}: {change:+.2%}" + (", `make bless-instructions` keeps it" if change < -MOST_GROWTH else ""))
    return worse


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=Path)
    parser.add_argument("generate", type=Path)
    parser.add_argument("--work", type=Path, default=Path(os.environ.get("CARGO_TARGET_DIR", "target")) / "instructions")
    parser.add_argument("--bless", action="store_true", help="write the baseline anew")
    options = parser.parse_args()
    options.work = options.work.resolve()
    found = measure(options)
    if options.bless:
        BASELINE.write_text(HEADER.format(versions=versions()) + "\n".join(lines(found)) + "\n")
        return
    worse = compare(found)
    if worse:
        print(*worse, sep="\n", file=sys.stderr)
        made_with = BASELINE.read_text().splitlines()[1].split(". ", 1)[1]
        if made_with != versions():
            print(f"The baseline was counted with {made_with}; here: {versions()}.", file=sys.stderr)
        sys.exit("error: more than 3 % more instructions; if the new counts are intended, run `make bless-instructions`")


if __name__ == "__main__":
    main()
