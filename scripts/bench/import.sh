#!/bin/sh
# Memory and time of `mirrorstats import` for a log of Inspect with SAMPLES samples, and the time of `inspect log dump`.
set -eu
cd "$(dirname "$0")/../.."
samples=${SAMPLES:-200000}
target=${CARGO_TARGET_DIR:-target}
folder=$target/bench-import
log=$folder/$samples.eval
PYTHONPATH=$(scripts/get-harnesses.sh)
export PYTHONPATH
mkdir -p "$folder"
if [ ! -f "$log" ]; then
  python3 scripts/bench/inspect_samples.py "$log.new" "$samples"
  mv "$log.new" "$log"
fi
cargo build --release --bin mirrorstats
echo "mirrorstats import, $samples samples:"
/usr/bin/time -f "%e s, %M kB" "$target/release/mirrorstats" import "$log" -o "$folder/tools.parquet" \
  --definitions examples/domains/tools.toml
echo "inspect log dump, $samples samples:"
/usr/bin/time -f "%e s, %M kB" python3 -c "from inspect_ai._cli.main import main; main()" log dump "$log" >/dev/null
