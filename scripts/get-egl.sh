#!/bin/sh
# Makes sure that pictures can be rendered without a display: EGL and Mesa's software renderer, Debian's packages if they are missing.
set -eu

found() {
  python3 - <<'PYTHON'
import ctypes, glob, sys
try:
    ctypes.CDLL("libEGL.so.1")
except OSError:
    sys.exit(1)
# Mesa before 24 keeps the software renderer in a file of its own.
renderers = glob.glob("/usr/lib/*/dri/swrast_dri.so") + glob.glob("/usr/lib/*/libgallium-*.so") + glob.glob("/usr/lib*/dri/*.so")
sys.exit(0 if renderers else 1)
PYTHON
}

found && exit 0
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
  echo "get-egl: installing libegl1 and libgl1-mesa-dri with apt-get" >&2
  export DEBIAN_FRONTEND=noninteractive
  { apt-get update && apt-get install --yes --no-install-recommends libegl1 libgl1-mesa-dri; } >&2
  found && exit 0
fi
echo "get-egl: no software renderer for EGL, and none can be installed here (that takes root and apt-get);" \
  "install libegl1 and libgl1-mesa-dri by hand" >&2
exit 1
