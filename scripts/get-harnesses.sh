#!/bin/sh
# Prints the folder that PYTHONPATH needs for programs whose logs `import` reads: one version of each, fetched once, beside
# what cargo builds.
set -eu
packages="inspect_ai==0.3.285 inspect-robots==0.60.0"
target=${CARGO_TARGET_DIR:-target}
folder=$target/python-harnesses
if [ "$(cat "$folder/.packages" 2>/dev/null)" != "$packages" ]; then
  echo "get-harnesses: fetching $packages" >&2
  rm -rf "$folder"
  # shellcheck disable=SC2086 # one argument per package
  python3 -m pip install --quiet --disable-pip-version-check --root-user-action=ignore --target "$folder" $packages >&2
  echo "$packages" >"$folder/.packages"
fi
cd "$folder" && pwd
