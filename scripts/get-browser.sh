#!/bin/sh
# Prints the path of a Chromium for the test of report.html, and installs Debian's if there is none and that is possible.
set -eu

find_browser() {
  for name in chromium chromium-browser google-chrome google-chrome-stable; do
    command -v "$name" && return 0
  done
  return 1
}

find_browser && exit 0
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
  echo "get-browser: installing chromium with apt-get" >&2
  export DEBIAN_FRONTEND=noninteractive
  { apt-get update && apt-get install --yes --no-install-recommends chromium; } >&2
  find_browser && exit 0
fi
echo "get-browser: no Chromium on PATH, and none can be installed here (that takes root and apt-get);" \
  "install chromium by hand" >&2
exit 1
