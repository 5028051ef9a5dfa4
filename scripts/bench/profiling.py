"""Where the time of `score` goes, by stage, as Linux's perf finds it."""

import collections
import re
import shutil
import subprocess

# Which part of the work a function belongs to; the first pattern that fits.
STAGES = [
    ("decompression (zstd)", r"ZSTD_decompress|HUF_decompress|ZSTD_(?!compress).*(decode|Seq)|zstd.*decomp|FSE_read|FSE_build.*DTable|XXH|HUF_read"),
    ("compression of the output", r"ZSTD_|HUF_|FSE_"),
    ("pages: runs and keys", r"trace.*(pages|hybrid|rle|chunk)"),
    ("output", r"ArrowWriter|arrow_writer|encod|writer|score.*format"),
    ("decoding", r"parquet"),
    ("rules and cutting into episodes", r"mirrorstats.*trace|trace::"),
    ("ordering the rows", r"score.*rows|base.*runs|Merge|slice.*sort|driftsort|quicksort|smallsort|insertion_sort"),
    ("kernels", r"mirrorstats.*score|arrow"),
    ("memory (copies, pages)", r"mem(cpy|move|set|cmp|chr)|alloc|free|clear_page|page_fault|fault|copy_"),
    ("kernel, reading files", r"\[k\]"),
]


def stages(report):
    shares = collections.Counter()
    top = []
    for line in report.splitlines():
        match = re.match(r"\s*([\d.]+)%\s+(\S+)\s+(\[.\])\s+(.*)", line)
        if not match:
            continue
        share, symbol = float(match[1]), f"{match[3]} {match[4].strip()}"
        stage = next((name for name, pattern in STAGES if re.search(pattern, symbol)), "other")
        shares[stage] += share
        top.append((share, match[4].strip()))
    return shares, top[:15]


def report(program, folder, outputs):
    """The output of perf, or None without perf."""
    if not shutil.which("perf"):
        return None
    record = outputs / "perf.data"
    score = [program, "score", folder, "-o", outputs / "profile.parquet"]
    if subprocess.run(["perf", "record", "-F", "4000", "-g", "-o", record, *score], capture_output=True).returncode != 0:
        return None
    show = ["perf", "report", "-i", record, "--no-children", "-g", "none", "--sort", "dso,symbol", "--stdio"]
    return subprocess.run(show, capture_output=True, text=True).stdout


def lines(program, folder, outputs):
    """The section of RESULTS.md; no line without perf."""
    found = report(program, folder, outputs)
    if not found:
        return []
    shares, top = stages(found)
    return [
        "",
        "## Where the time of `score` goes",
        "",
        "Shuffled data; cycles of all threads by Linux's perf, by the stage that a function belongs to:",
        "",
        "| stage | share |",
        "|---|---|",
        *[f"| {stage} | {share:.0f} % |" for stage, share in shares.most_common() if share >= 0.5],
        "",
        "The functions with the largest shares:",
        "",
        "```text",
        *[f"{share:5.1f} %  {symbol[:110].rstrip()}" for share, symbol in top],
        "```",
    ]
