#!/bin/sh
# Runs the program as a user does and compares what it writes with what is committed.
set -eu
cd "$(dirname "$0")/.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

# The program that the tests build: `cargo build` alone would compile the large dependencies a second time, with fewer of
# their features.
cargo test --quiet --workspace --all-features --no-run
target=${CARGO_TARGET_DIR:-target}
mirrorstats() { "$target/debug/mirrorstats" "$@"; }
# Python packages, fetched once into a folder: the folder, the module that tells whether they are there, the packages.
fetch() {
  [ ! -d "$1/$2" ] || return 0
  folder=$1
  shift 2
  python3 -m pip install --quiet --disable-pip-version-check --root-user-action=ignore --target "$folder" "$@" || {
    echo "end-to-end: cannot fetch $* from PyPI, and there is no check without them" >&2
    exit 1
  }
}

echo "end-to-end: the committed report, byte for byte"
mirrorstats report fixtures/paper --style paper --png --out "$out/paper" >"$out/main.txt"
diff -r --exclude=report.html reports/paper "$out/paper"
# The page is large; what is committed of it is its hash.
page=$PWD/reports/report.html.sha256
(cd "$out/paper" && sha256sum --check --quiet "$page")

echo "end-to-end: the published tables, cell by cell"
mirrorstats table compare fixtures/paper --published fixtures/published/main_table.csv
mirrorstats table compare fixtures/paper --published fixtures/published/appendix_table.csv

echo "end-to-end: the bundled traces keep every rule"
mirrorstats trace validate fixtures/paper

echo "end-to-end: the definitions have no fault"
mirrorstats definitions check paper
mirrorstats definitions check extended

echo "end-to-end: the same scores from the SQL lowering on an independent engine"
packages=$(scripts/get-duckdb.sh)
PYTHONPATH=$packages python3 scripts/check-sql.py "$target/debug/mirrorstats" fixtures/paper
PYTHONPATH=$packages python3 scripts/check-sql.py "$target/debug/mirrorstats" fixtures/paper --where "seed <> 2 and TSA = 1"
PYTHONPATH=$packages python3 scripts/check-sql.py "$target/debug/mirrorstats" fixtures/paper \
  --definitions scripts/check-sql.toml

echo "end-to-end: logs as MCAP's and Foxglove's own packages read them"
fetch "$packages" mcap mcap==1.6.0 mcap-protobuf-support==0.6.0 foxglove-schemas-protobuf==0.4.0 jsonschema==4.26.0
mirrorstats record --agent random --experiment E4,E5 --seeds 1 --runs 2 --no-frames --out "$out/runs" 2>/dev/null
PYTHONPATH=$packages python3 scripts/check-log.py fixtures/recorded/*.mcap "$out"/runs/*.mcap
mirrorstats trace recover "$out/runs/E4-random.mcap" --out "$out/recovered.parquet"
cmp "$out/runs/E4-random.parquet" "$out/recovered.parquet"
mirrorstats world replay "$out/runs"

echo "end-to-end: requests to models are those of the official client libraries"
# From 2.0 on, Anthropic's library speaks a version of the API that refuses a temperature.
clients=$target/python-clients
fetch "$clients" anthropic openai==3.52.0 google-genai==3.4.0 anthropic==1.17.0
PYTHONPATH=$clients python3 scripts/check-clients.py "$target/debug/mirrorstats"
