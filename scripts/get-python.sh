#!/bin/sh
# Prints the folder of a virtual environment with the packages of python/requirements.txt, made once, beside what cargo builds:
# what builds the wheel, and what its tests need. Needs python3 with venv.
set -eu
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-target}
environment=$target/python-environment
if ! cmp -s python/requirements.txt "$environment/requirements.txt"; then
  echo "get-python: fetching the packages of python/requirements.txt" >&2
  rm -rf "$environment"
  { python3 -m venv "$environment" &&
    "$environment/bin/python" -m pip install --quiet --disable-pip-version-check -r python/requirements.txt; } >&2 || {
    echo "get-python: cannot make an environment with them; Debian has it in the package python3-venv" >&2
    exit 1
  }
  cp python/requirements.txt "$environment/requirements.txt"
fi
cd "$environment" && pwd
