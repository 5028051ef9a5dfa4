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
