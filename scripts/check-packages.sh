#!/bin/sh
# Compares what the program writes with the packages of others: logs with MCAP's and Foxglove's readers, requests to models with
# the providers' client libraries.
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
    echo "check-packages: cannot fetch $* from PyPI, and there is no check without them" >&2
    exit 1
  }
}

packages=$(scripts/get-duckdb.sh)

echo "check-packages: logs as MCAP's and Foxglove's own packages read them"
fetch "$packages" mcap mcap==1.6.0 mcap-protobuf-support==0.6.0 foxglove-schemas-protobuf==0.4.0 jsonschema==4.26.0
mirrorstats record --agent random --experiment E4,E5 --seeds 1 --runs 2 --no-frames --out "$out/runs" 2>/dev/null
PYTHONPATH=$packages python3 scripts/check-log.py fixtures/recorded/*.mcap "$out"/runs/*.mcap
mirrorstats trace recover "$out/runs/E4-random.mcap" --out "$out/recovered.parquet"
cmp "$out/runs/E4-random.parquet" "$out/recovered.parquet"
mirrorstats world replay "$out/runs"

echo "check-packages: requests to models are those of the official client libraries"
# From 2.0 on, Anthropic's library speaks a version of the API that refuses a temperature.
clients=$target/python-clients
fetch "$clients" anthropic openai==3.52.0 google-genai==3.4.0 anthropic==1.17.0
PYTHONPATH=$clients python3 scripts/check-clients.py "$target/debug/mirrorstats"
