#!/bin/sh
# Writes fixtures/recorded anew: a few episodes of each scripted agent where its name says what to expect, one log. Bodies are
# mannequins, as in the first recordings.
set -eu
cd "$(dirname "$0")/.."
scripts/get-mujoco.sh
out=fixtures/recorded
rm -f "$out"/*.parquet "$out"/*.mcap
config=$(mktemp)
trap 'rm -f "$config"' EXIT
echo 'body.shape = "mannequin"' >"$config"
record() { cargo run --quiet --features sim -- record --config "$config" --out "$out" --seeds 1 "$@"; }
record --agent oracle --experiment E1..E5 --runs 2 --no-log
record --agent gullible --experiment E1,E3 --runs 2 --no-log
record --agent mimic --experiment E1,E4 --runs 2 --no-log
record --agent confabulator --experiment E1 --runs 2 --no-log
record --agent random --experiment E1..E5 --runs 2 --no-log
record --agent frozen --experiment E1 --runs 1 --no-log
record --agent guesser --experiment E1 --runs 2
du -ch "$out"/*.parquet "$out"/*.mcap | tail -1
