#!/bin/sh
# Prints the folder that PYTHONPATH needs for DuckDB: one version of it, fetched once, beside what cargo builds.
set -eu
version=2.0.0
target=${CARGO_TARGET_DIR:-target}
packages=$target/python
if [ ! -d "$packages/duckdb" ]; then
  echo "get-duckdb: fetching duckdb $version" >&2
  python3 -m pip install --quiet --disable-pip-version-check --root-user-action=ignore --target "$packages" \
    "duckdb==$version" >&2
fi
cd "$packages" && pwd
