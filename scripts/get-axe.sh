#!/bin/sh
# Prints the folder of axe-core, which finds what keeps people from using a page: one version, fetched once, beside what cargo builds.
set -eu
version=4.14.1
folder=${CARGO_TARGET_DIR:-target}/axe-core
if [ "$(cat "$folder/.version" 2>/dev/null)" != "$version" ]; then
  echo "get-axe: fetching axe-core $version from npm" >&2
  rm -rf "$folder"
  mkdir -p "$folder"
  (cd "$folder" && npm pack --silent "axe-core@$version" >/dev/null && tar -xzf "axe-core-$version.tgz" --strip-components=1)
  echo "$version" >"$folder/.version"
fi
cd "$folder" && pwd
