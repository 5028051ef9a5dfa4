#!/bin/sh
# Makes sure that valgrind counts instructions (scripts/bench/instructions.py): Debian's if it is missing.
set -eu

found() {
  valgrind --tool=callgrind --version >/dev/null 2>&1
}

found && exit 0
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
  echo "get-valgrind: installing valgrind with apt-get" >&2
  export DEBIAN_FRONTEND=noninteractive
  { apt-get update && apt-get install --yes --no-install-recommends valgrind; } >&2
  found && exit 0
fi
echo "get-valgrind: no valgrind, and none can be installed here (that takes root and apt-get); install it by hand" >&2
exit 1
