#!/bin/sh
# A data set that LeRobot's own package writes, and an evaluation that `lerobot-eval`'s own code makes, through `import`, `report`
# and `stats`: scripts/check-lerobot.sh PROGRAM. A job of its own: the package brings PyTorch, some 6 GB.
set -eu
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-target}
environment=$target/lerobot-0.4.4
if [ ! -x "$environment/bin/lerobot-eval" ]; then
  python3 -m venv "$environment"
  "$environment/bin/pip" install --quiet --disable-pip-version-check lerobot==0.4.4
fi
exec "$environment/bin/python" scripts/check-lerobot.py "$1"
