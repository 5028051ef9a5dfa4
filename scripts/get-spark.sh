#!/bin/sh
# Prints the folder that PYTHONPATH needs for the tests of Spark: pyspark of one version, fetched once, beside what
# cargo builds. Spark runs on Java 17 or newer, which is installed by hand or, as root on Debian, by this script.
set -eu
version=4.3.0
target=${CARGO_TARGET_DIR:-target}
packages=$target/python-spark

if ! command -v java >/dev/null && [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
  echo "get-spark: installing openjdk-17-jre-headless with apt-get" >&2
  export DEBIAN_FRONTEND=noninteractive
  { apt-get update && apt-get install --yes --no-install-recommends openjdk-17-jre-headless; } >&2
fi
command -v java >/dev/null || { echo "get-spark: no Java on PATH; install Java 17 or newer" >&2; exit 1; }

if [ ! -e "$packages/pyspark/$version" ]; then
  echo "get-spark: fetching pyspark $version" >&2
  rm -rf "$packages"
  python3 -m pip install --quiet --disable-pip-version-check --root-user-action=ignore --target "$packages" \
    "pyspark==$version" >&2
  : >"$packages/pyspark/$version"
fi
cd "$packages" && pwd
