#!/bin/sh
# Prints the folder that PYTHONPATH needs for some Python packages: one version of each, fetched once, beside what cargo builds.
# Arguments: the folder, the packages. PYTHON names another interpreter than python3.
set -eu
folder=${CARGO_TARGET_DIR:-target}/$1
shift
packages=$*
if [ "$(cat "$folder/.packages" 2>/dev/null)" != "$packages" ]; then
  echo "get-packages: fetching $packages" >&2
  rm -rf "$folder"
  "${PYTHON:-python3}" -m pip install --quiet --disable-pip-version-check --root-user-action=ignore --target "$folder" "$@" >&2
  echo "$packages" >"$folder/.packages"
fi
cd "$folder" && pwd
