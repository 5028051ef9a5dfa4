#!/bin/sh
# The four questions of the world for the scripted agents, as a table and a figure in reports/world: which body am I
# (contingency), can it be known (can-know), how late may a reflection be (delay), what is remembered (memory).
# Scenes are those of 3 seeds and RUNS runs, 7 if not said. PROGRAM is a mirrorstats to record with, built if not said.
set -eu
cd "$(dirname "$0")/.."
scripts/get-mujoco.sh
runs=${RUNS:-7}
work=${CARGO_TARGET_DIR:-target}/world-questions
rm -rf "$work"
if [ -z "${PROGRAM-}" ]; then
  cargo build --quiet --release --features sim
  PROGRAM=${CARGO_TARGET_DIR:-target}/release/mirrorstats
fi
for agent in oracle mimic confabulator guesser random frozen; do
  "$PROGRAM" record --agent "$agent" --out "$work/runs" --seeds 3 --runs "$runs" --no-log --no-frames --experiment \
    E1,delay-01,delay-02,delay-04,delay-08,delay-16,delay-32,memory-0,memory-8,can-know,cannot-know,contingency,contingency-late,contingency-swap
done
"$PROGRAM" report "$work/runs" --definitions evidence --metrics TSA,WARRANTED,INVENTED,WITHHELD --out "$work/report"
cp "$work/report/tables/main.md" reports/world/questions.md
"$PROGRAM" figure dose-response "$work/runs" --definitions evidence -o reports/world/dose-response.svg
