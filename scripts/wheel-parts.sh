#!/bin/sh
# wheel-parts.sh PROGRAM...: puts what the wheel carries beside its code where maturin finds it. Completions and manual pages
# are written by the program, which may be a command of several words.
set -eu
cd "$(dirname "$0")/.."
scripts/get-mujoco.sh
package=python/mirrorstats
data=python/mirrorstats.data/data/share
rm -rf "$package"/libmujoco.so.* "$package/runs" python/mirrorstats.data
cp .mujoco/lib/libmujoco.so.* "$package/"
cp .mujoco/LICENSE "$package/LICENSE-MuJoCo"
cp LICENSE LICENSE-APACHE LICENSE-MIT python/
mkdir "$package/runs"
cp fixtures/paper/*.parquet fixtures/paper/README.md "$package/runs/"
mkdir -p "$data/mirrorstats"
scripts/sbom.py "$data/mirrorstats/sbom.cdx.json"
mkdir -p "$data/man/man1" "$data/bash-completion/completions" "$data/zsh/site-functions" "$data/fish/vendor_completions.d"
[ $# -gt 0 ] || exit 0
"$@" setup man "$data/man/man1" 2>/dev/null
"$@" setup completions bash >"$data/bash-completion/completions/mirrorstats"
"$@" setup completions zsh >"$data/zsh/site-functions/_mirrorstats"
"$@" setup completions fish >"$data/fish/vendor_completions.d/mirrorstats.fish"
