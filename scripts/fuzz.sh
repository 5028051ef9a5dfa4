#!/bin/sh
# Fuzzes every target (or those that are named) for a share of MINUTES, guided by coverage, and prints what came of each.
# Usage: fuzz.sh MINUTES [TARGET...]; fuzz.sh merge [TARGET...] adds what was found to the committed corpora, minimised.
#
# libFuzzer comes with the crate libfuzzer-sys and is compiled with the C++ compiler that is here; the coverage is that of the
# stable compiler, by passes of LLVM, as `cargo fuzz --sanitizer none` has it.
set -eu
cd "$(dirname "$0")/.."
minutes=${1:-10}
[ $# -eq 0 ] || shift
scripts/get-mujoco.sh >/dev/null
target=${CARGO_TARGET_DIR:-target}
triple=$(rustc -vV | sed -n 's/^host: //p')
found=$target/fuzz-findings
work=$target/fuzz-corpus
log=$target/fuzz-logs
mkdir -p "$found" "$work" "$log"

flags="--cfg mirrorstats_libfuzzer -Cpasses=sancov-module"
for flag in level=4 inline-8bit-counters pc-table trace-compares; do
  flags="$flags -Cllvm-args=-sanitizer-coverage-$flag"
done
# A target folder's own artifacts are for the machine that builds: build scripts are not instrumented.
RUSTFLAGS="$flags" cargo build --quiet --profile fuzz --target "$triple" -p mirrorstats-fuzz
program=$target/$triple/fuzz/mirrorstats-fuzz

# The names as the source has them: a program built for libFuzzer has no verb that lists them.
[ $# -gt 0 ] || set -- $(sed -n 's/^    ("\([a-z]*\)", [a-z_:]*),$/\1/p' fuzz/src/lib.rs)

limits="-rss_limit_mb=2048 -timeout=20 -max_len=65536 -verbosity=1"
if [ "$minutes" = merge ]; then
  for name in "$@"; do
    mkdir -p "$work/$name" "fuzz/corpus/$name" "$work/merged"
    rm -rf "$work/merged/$name"
    mkdir -p "$work/merged/$name"
    FUZZ_TARGET=$name "$program" -merge=1 $limits "$work/merged/$name" "fuzz/corpus/$name" "$work/$name" \
      >"$log/$name.merge" 2>&1
    rm -rf "fuzz/corpus/$name"
    cp -r "$work/merged/$name" "fuzz/corpus/$name"
    echo "$name: $(ls "fuzz/corpus/$name" | wc -l) inputs"
  done
  exit 0
fi

seconds=$((minutes * 60 / $#))
failed=0
echo "| target | executions | per second | coverage | features | corpus | depth | findings |"
echo "|---|--:|--:|--:|--:|--:|---|--:|"
for name in "$@"; do
  mkdir -p "$work/$name" "$found/$name"
  before=$(ls "$found/$name" | wc -l)
  # What is found is kept, and the campaign goes on behind it.
  FUZZ_TARGET=$name "$program" -fork=1 -ignore_crashes=1 -ignore_ooms=1 -ignore_timeouts=1 $limits \
    -max_total_time="$seconds" -artifact_prefix="$found/$name/" "$work/$name" "fuzz/corpus/$name" \
    >"$log/$name" 2>&1 || true
  last=$(grep -a '^#[0-9]*: cov: ' "$log/$name" | tail -1)
  field() { echo "$last" | sed -n "s|.* $1: *\([0-9]*\).*|\1|p"; }
  executions=$(echo "$last" | sed -n 's/^#\([0-9]*\):.*/\1/p')
  depth=$(FUZZ_TARGET=$name FUZZ_DEPTH=1 "$program" -runs=0 $limits "$work/$name" "fuzz/corpus/$name" 2>&1 |
    sed -n 's/^depth: //p' | sort | uniq -c | sort -rn | awk '{ printf "%s%s %s", sep, $2, $1; sep = ", " }')
  findings=$(($(ls "$found/$name" | wc -l) - before))
  [ "$findings" = 0 ] || failed=1
  [ -n "$executions" ] || { failed=1; executions=none; }
  echo "| $name | $executions | $(field exec/s) | $(field cov) | $(field ft) | $(field corp) | $depth | $findings |"
done
[ "$failed" = 0 ] || echo "findings are in $found, logs in $log; replay: cargo run -p mirrorstats-fuzz -- run TARGET FILE" >&2
exit "$failed"
