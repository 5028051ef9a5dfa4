#!/bin/sh
# Time and memory of `mirrorstats import` for Parquet of STEPS steps, beside Polars, which copies the same columns.
set -eu
cd "$(dirname "$0")/../.."
target=${CARGO_TARGET_DIR:-target}
PYTHONPATH=$(scripts/get-writers.sh)
export PYTHONPATH
cargo build --release --bin mirrorstats
exec python3 scripts/bench/import_parquet.py --program "$target/release/mirrorstats" --data "$target/bench-import" \
  --steps "${STEPS:-14000000}" --rounds "${ROUNDS:-5}"
