#!/bin/sh
# Records a few episodes of the scripted agents and reports on them. Where MuJoCo or a renderer cannot be had, it says what
# to do about it and reports on the bundled recordings of the same agents.
set -eu
cd "$(dirname "$0")/.."
traces=runs/demo
report=reports/latest
record() { cargo run --quiet --features sim -- record --out "$traces" --seeds 1 --runs 1 "$@"; }

if scripts/get-mujoco.sh && scripts/get-egl.sh; then
  # Each where its name says what to expect. What is recorded already is not recorded again.
  record --agent oracle --experiment E1..E4
  record --agent gullible --experiment E3
  record --agent mimic --experiment E4
  record --agent guesser --experiment E1
  record --agent frozen --experiment E1 --no-frames
  cargo run --quiet --features sim -- report "$traces" --out "$report"
else
  echo "demo: recording needs MuJoCo and a renderer, see above; this is a report on recordings that were made before" >&2
  traces=fixtures/recorded
  cargo run --quiet -- report "$traces" --out "$report"
fi
echo
echo "The tables are in $report/tables, every cell in $report/cells.csv, all of it in $report/report.html."
if [ "$traces" = runs/demo ]; then
  echo "The episodes are in $traces: any viewer of MCAP plays the logs, \`mirrorstats report $traces\` reads the traces."
fi
echo "The paper's own tables: cargo run -- report fixtures/paper --style paper"
