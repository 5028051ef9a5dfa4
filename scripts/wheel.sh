#!/bin/sh
# Builds the wheel for others: optimised, stripped, for every Linux with glibc 2.28 or newer. Prints where it is.
set -eu
cd "$(dirname "$0")/.."
most=45000000
target=${CARGO_TARGET_DIR:-target}
mkdir -p "$target"
target=$(cd "$target" && pwd)
export CARGO_TARGET_DIR="$target"
tools=$(scripts/get-python.sh)/bin
export PATH="$tools:$PATH"
wheels=$target/wheels
build() {
  rm -rf "$wheels"
  (cd python && maturin build --profile wheel --zig --compatibility manylinux_2_28 --auditwheel skip --strip \
    --compression-level 9 --out "$wheels") >&2
  wheel=$(echo "$wheels"/mirrorstats-*.whl)
}
scripts/wheel-parts.sh
build
# The command of this wheel writes the pages that the next one carries; nothing is compiled again for it.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m zipfile -e "$wheel" "$work"
PYTHONPATH=$work scripts/wheel-parts.sh python3 -m mirrorstats
build

policy=$(auditwheel show "$wheel")
echo "$policy" >&2
glibc=$(echo "$policy" | tr -d '\n' | sed -n 's/.*following platform tag: *"manylinux_2_\([0-9]*\)_x86_64".*/\1/p')
if [ "${glibc:-99}" -gt 28 ]; then
  echo "wheel: expected a wheel for manylinux_2_28 or older" >&2
  exit 1
fi
bytes=$(wc -c <"$wheel")
if [ "$bytes" -ge "$most" ]; then
  echo "wheel: expected fewer than $most bytes, found $bytes" >&2
  exit 1
fi
echo "$wheel"
