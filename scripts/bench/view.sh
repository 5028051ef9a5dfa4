#!/bin/sh
# view.sh [ROUNDS]: `view` beside Inspect View in Chromium, of a release build; prints the table of benches/VIEW.md. The data are
# made once, in target/bench/view; Inspect's own `eval` of 10,000 samples takes minutes.
set -eu
cd "$(dirname "$0")/../.."
rounds=${1:-5}
scripts/get-browser.sh
scripts/get-egl.sh
scripts/get-mujoco.sh
target=${CARGO_TARGET_DIR:-target}
data=target/bench/view
python=target/bench/view-python
here=scripts/bench
cargo build --release --features sim,view --bin mirrorstats --example generate
program=$target/release/mirrorstats
mkdir -p "$data"
if [ ! -x "$python/bin/inspect" ]; then
  python3 -m venv "$python"
  "$python/bin/pip" install --quiet --disable-pip-version-check inspect-ai==0.3.285 playwright==1.65.2
fi
[ -d "$data/list" ] || "$target/release/examples/generate" --steps 710000 --files 4 --out "$data/list"
if [ ! -d "$data/steps" ]; then
  mkdir -p "$data/frames"
  "$program" record --agent "exec:python3 $here/walker.py --frames=$PWD/$data/frames" --model walker --experiment E1 --seeds 20 --runs 1 \
    --out "$data/steps"
fi
[ -d "$data/inspect/steps" ] || "$python/bin/python" $here/inspect_logs.py "$data/frames" "$data/inspect"
"$python/bin/python" $here/view.py --program "$program" --inspect "$python/bin/inspect" --data "$data" --rounds "$rounds"
