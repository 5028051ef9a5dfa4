#!/bin/sh
# Runs tests: `scripts/test.sh short` those of `make test`, `scripts/test.sh long` the others. cargo-nextest runs them where it is
# installed, because it fills both processors across test programs; `cargo test` runs them where it is not.
set -eu
cd "$(dirname "$0")/.."

# Tests that take most of the time, by parts of their names.
long="accessible:: calibration:: cluster:: documented_command_lines documented_outputs faults:: foreign:: hostile::
  html::address html::episodes html::figures html::pair html::results html::surroundings import::inspect:: latex::
  log::lengths logs_of_inspect_robots on_cluster pairs:: people:: publish::changes publish::opened seeing:: spark_ view::copy view::find
  view::first_screen view::labels view::live view::values world::panes"

nextest=
if cargo nextest --version >/dev/null 2>&1; then
  nextest=yes
  filter=
  for part in $long; do filter="$filter${filter:+ or }test($part)"; done
else
  # Many tests wait for other processes, so more tests run than there are processors.
  export RUST_TEST_THREADS="${RUST_TEST_THREADS:-$(($(getconf _NPROCESSORS_ONLN) * 3 / 2))}"
fi

# The member `fuzz` replays its corpora; chosen together, both use one build of the program.
run() { cargo test --workspace --all-features --no-fail-fast "$@"; }
case ${1-} in
  short)
    if [ "$nextest" ]; then
      cargo nextest run --workspace --all-features -E "not ($filter)"
      run --doc
    else
      skips=
      for part in $long; do skips="$skips --skip $part"; done
      # shellcheck disable=SC2086
      run -- $skips
    fi
    ;;
  long)
    # Tests of pages share browsers within one process, so `cargo test` runs all of these.
    # shellcheck disable=SC2086
    run --lib --bins --tests -- $long
    ;;
  *)
    echo "usage: scripts/test.sh short|long" >&2
    exit 2
    ;;
esac
