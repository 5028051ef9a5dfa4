#!/bin/sh
# Puts MuJoCo's library, out of the wheel on PyPI, into .mujoco/lib, where the feature `sim` looks for it, and its licence
# into .mujoco/LICENSE.
# Does nothing if it is there already. Needs python3 with pip.
set -eu
version=3.17.0
case "$(uname -s)-$(uname -m)" in
  Linux-x86_64)
    platform=manylinux_2_28_x86_64
    # Of the library itself: the wheels of all Python versions hold the same one.
    sha=23496b023ee80fb61ab71167e94bc649f9941710fde96b18bb8204fb332523ad ;;
  *)
    echo "get-mujoco: no MuJoCo is pinned for $(uname -s) on $(uname -m); set MUJOCO_DYNAMIC_LINK_DIR to the folder of your libmujoco $version" >&2
    exit 1 ;;
esac
root=$(cd "$(dirname "$0")/.." && pwd)
lib=$root/.mujoco/lib
file=libmujoco.so.$version
holds() { echo "$sha  $1" | sha256sum -c --status - 2>/dev/null; }
if [ -f "$lib/$file" ] && [ -f "$root/.mujoco/LICENSE" ] && holds "$lib/$file"; then
  exit 0
fi
echo "get-mujoco: fetching MuJoCo $version" >&2
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT
python3 -m pip download -q --disable-pip-version-check --no-deps --only-binary=:all: --implementation cp \
  --python-version 3.12 --platform "$platform" -d "$tmp" "mujoco==$version"
python3 -m zipfile -e "$tmp"/mujoco-*.whl "$tmp/wheel"
holds "$tmp/wheel/mujoco/$file" || { echo "get-mujoco: $file has another sha256 than expected" >&2; exit 1; }
mkdir -p "$lib"
cp "$tmp/wheel/mujoco-$version.dist-info/licenses/LICENSE" "$root/.mujoco/LICENSE"
install -m 755 "$tmp/wheel/mujoco/$file" "$lib/$file"
ln -sf "$file" "$lib/libmujoco.so"
