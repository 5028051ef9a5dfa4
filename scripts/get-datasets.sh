#!/bin/sh
# Programs that open what `publish` writes: datasets and mlcroissant; Inspect Scout; Every Eval Ever, which needs Python 3.12.
set -eu
cd "$(dirname "$0")"
./get-packages.sh python-datasets datasets==5.2.0 pillow==13.0.0 mlcroissant==1.1.1
./get-packages.sh python-scout inspect_scout==0.6.1

# An interpreter from 3.12 on: on PATH, or one of pyenv's.
python=
for candidate in python3 python3.14 python3.13 python3.12 "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.1[2-9]*/bin/python3; do
  if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 12))' 2>/dev/null; then
    python=$(command -v "$candidate")
    break
  fi
done
if [ "$python" ]; then
  folder=$(PYTHON=$python ./get-packages.sh python-every-eval-ever every_eval_ever==0.3.0)
  echo "$python" >"$folder/.python"
  echo "$folder"
else
  # The package's own schemas: tests validate with them where no interpreter runs the package.
  folder=${CARGO_TARGET_DIR:-$PWD/../target}/python-every-eval-ever
  mkdir -p "$folder"
  python3 -m pip download --quiet --disable-pip-version-check --no-deps --python-version 3.12 --only-binary=:all: \
    --dest "$folder" every_eval_ever==0.3.0 >&2
  (cd "$folder" && python3 -m zipfile -e every_eval_ever-*.whl .)
  echo "$folder"
fi
