#!/bin/sh
# gym.sh [WHEEL]: `mirrorstats.gym` beside `mirrorstats.record`, from a wheel, built if not said; prints the numbers of
# benches/WORLD.md.
set -eu
cd "$(dirname "$0")/../.."
scripts/get-egl.sh
wheel=${1:-$(scripts/wheel.sh)}
python=${CARGO_TARGET_DIR:-target}/bench-gym
rm -rf "$python"
python3 -m venv "$python"
"$python/bin/pip" install --quiet --disable-pip-version-check "$wheel" numpy "$(grep ^gymnasium== python/requirements.txt)"
"$python/bin/python" scripts/bench/gym.py
