#!/bin/sh
# Reports on the bundled recordings as soon as a program without the world is built, then builds the world, records a few
# episodes of the scripted agents and reports on them. Where MuJoCo or a renderer cannot be had, it says what to do about it
# and ends with the first report. Two builds: the first table comes after half of the time, for a tenth more of it in all.
# Figures as PNG and PDF cost as much to compile as the world and are left out.
set -eu
cd "$(dirname "$0")/.."
traces=runs/demo
report=reports/latest
features=
program() { cargo run --quiet --profile demo --no-default-features --features "$features" -- "$@"; }
record() { program record --out "$traces" --seeds 1 --runs 1 "$@"; }

echo "demo: building; then the tables of recordings that were made before"
program report fixtures/recorded --out "$report"

echo
if scripts/get-mujoco.sh && scripts/get-egl.sh; then
  features=sim
  echo "demo: building the world; then a few episodes are recorded"
  # Each where its name says what to expect. What is recorded already is not recorded again.
  record --agent oracle --experiment E1..E4
  record --agent gullible --experiment E3
  record --agent mimic --experiment E4
  record --agent guesser --experiment E1
  record --agent frozen --experiment E1 --no-frames
  program report "$traces" --out "$report"
else
  echo "demo: recording needs MuJoCo and a renderer, see above" >&2
  traces=fixtures/recorded
fi
echo
echo "The tables are in $report/tables, every cell in $report/cells.csv, all of it in $report/report.html."
if [ "$traces" = runs/demo ]; then
  echo "The episodes are in $traces: any viewer of MCAP plays the logs, \`mirrorstats report $traces\` reads the traces."
fi
echo "The paper's own tables: cargo run -- report fixtures/paper --style paper"
