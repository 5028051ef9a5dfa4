#!/bin/sh
# Prints the folder that PYTHONPATH needs for programs that write Parquet: one version of each, fetched once, beside what
# cargo builds. Spark and parquet-java are those of scripts/get-spark.sh.
set -eu
packages="pyarrow==26.0.1 duckdb==2.0.0 polars==2.1.0 datafusion==55.0.0 fastparquet==2026.9.0 pandas==3.1.1"
target=${CARGO_TARGET_DIR:-target}
folder=$target/python-writers
if [ "$(cat "$folder/.packages" 2>/dev/null)" != "$packages" ]; then
  echo "get-writers: fetching $packages" >&2
  rm -rf "$folder"
  # shellcheck disable=SC2086 # one argument per package
  python3 -m pip install --quiet --disable-pip-version-check --root-user-action=ignore --target "$folder" $packages >&2
  echo "$packages" >"$folder/.packages"
fi
cd "$folder" && pwd
