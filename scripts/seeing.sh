#!/bin/sh
# The two agents that see in 3 seeds and RUNS runs of E1 to E5, 7 if not said, through HTTP: reports/world/seeing.md. Both play
# at once, each behind a server of its own. PROGRAM is a mirrorstats to record with, built if not said.
set -eu
cd "$(dirname "$0")/.."
scripts/get-mujoco.sh
scripts/get-egl.sh
PYTHONPATH=$(scripts/get-numpy.sh)
export PYTHONPATH OPENBLAS_NUM_THREADS=1
target=${CARGO_TARGET_DIR:-target}
if [ -z "${PROGRAM-}" ]; then
  cargo build --quiet --release --features sim
  PROGRAM=$target/release/mirrorstats
fi
work=$target/seeing
rm -rf "$work"
mkdir -p "$work"

play() {
  model=$1
  shift
  python3 -B examples/agents/seeing.py "$@" >"$work/$model.address" &
  server=$!
  trap 'kill $server' EXIT
  until [ -s "$work/$model.address" ]; do
    kill -0 $server || exit 1
    sleep 0.2
  done
  "$PROGRAM" record --agent vlm --model "$model" --base-url "$(cat "$work/$model.address")/v1" --experiment E1..E5 --seeds 3 \
    --runs "${RUNS:-7}" --no-log --in-flight 2 --threads 1 --out "$work/runs/$model"
}
(play seeing) &
first=$!
(play seeing-trained --trained examples/agents/seeing.npz) &
second=$!
wait $first
wait $second

"$PROGRAM" report "$work/runs" --no-figures --metrics TSA,TTD,MCR,MTATO,CAAL,CR --out "$work/report"
{
  cat <<'END'
# Agents that see

`make seeing` writes this page: two agents of [examples/agents](../../examples/agents) play E1 to E5 through HTTP, from
pixels. [The page about them](../../docs/how-to/seeing-agent.md) says what they know beforehand.

They differ in two functions. `seeing` accepts a body as its own only where its reflection has to be. `seeing-trained`
accepts a body that a network recognises, wherever it is; the network has learned from rooms without other bodies.
END
  sed -n '/^###/,$p' "$work/report/tables/main.md" | sed 's/^###/##/; 1i\\'
  echo
  sed -n '1p' "$work/report/tables/main.md"
  printf '\n## What it shows\n\n'
  "$PROGRAM" score "$work/runs" 2>/dev/null | python3 -c '
import collections, csv, sys
values = collections.defaultdict(list)
for row in csv.DictReader(sys.stdin):
    values[row["model"], row["experiment"]].append(row["TSA"])
counts = {cell: (found.count("1"), len(found)) for cell, found in values.items()}
rows = {cell: f"{right} of {of}" for cell, (right, of) in counts.items()}
for name in ("seeing", "seeing-trained"):
    counts = ", ".join(f"{rows[name, experiment]} in {experiment}" for experiment in ("E1", "E2", "E3", "E4", "E5"))
    print(f"- `{name}` decides correctly in {counts}.")'
  cat <<'END'

In E1 and E3, every body in the mirror is the agent's own, so naming a colour from pixels is enough. E4 adds others,
which the network sometimes takes for its own body. E5 also adds large clutter, which it has never seen. `seeing` asks whether a
body is where its own reflection has to be. It shows no self-recognition by that: its author put the test into the
program. Without a mirror (E2), both guess and say `unknown`.
END
} >"$work/seeing.md"
cp "$work/seeing.md" reports/world/seeing.md
echo "The table is in reports/world/seeing.md."
