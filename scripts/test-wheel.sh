#!/bin/sh
# Installs the wheel into an empty virtual environment and uses it as its users do, without Rust. With a wheel as argument that
# one; else one of the profile that the tests have, from the dependencies that they have compiled already.
set -eu
cd "$(dirname "$0")/.."
checkout=$PWD
target=${CARGO_TARGET_DIR:-target}
mkdir -p "$target"
target=$(cd "$target" && pwd)
export CARGO_TARGET_DIR="$target"
scripts/get-egl.sh
browser=$(scripts/get-browser.sh)
tools=$(scripts/get-python.sh)
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

wheel=${1:+$(realpath "$1")}
if [ -z "$wheel" ]; then
  echo "test-wheel: building it"
  cargo test --quiet --workspace --all-features --no-run
  scripts/wheel-parts.sh "$target/debug/mirrorstats"
  (cd python && "$tools/bin/maturin" build --quiet --profile dev --features tested --compatibility linux --auditwheel skip \
    --out "$out/wheels")
  wheel=$(echo "$out"/wheels/mirrorstats-*.whl)
fi

# No Rust, no library of MuJoCo but that of the wheel, no setting of this machine.
clean() { env -i HOME="$out" LANG=C.UTF-8 PATH="$out/env/bin:/usr/bin:/bin" "$@"; }
timed() {
  start=$(date +%s%N)
  "$@"
  echo "test-wheel: $(( ($(date +%s%N) - start) / 1000000 )) ms: $*" >&2
}

echo "test-wheel: an empty environment"
python3 -m venv "$out/env"
timed clean pip install --quiet --disable-pip-version-check --no-index "$wheel"
cd "$out"
clean mirrorstats --version
example=$(clean mirrorstats-example-runs)
timed clean mirrorstats report "$example" --out "$out/example" >"$out/example.txt"
grep -q "Claude Sonnet 4.6" "$out/example.txt"
timed clean mirrorstats record --agent oracle --experiment E1 --seeds 1 --runs 2 --out runs
timed clean mirrorstats report runs --out report >"$out/report.txt"
grep -q oracle "$out/report.txt"
clean mirrorstats world replay runs
test -s "$out/env/share/man/man1/mirrorstats-report.1"
test -s "$out/env/share/bash-completion/completions/mirrorstats"
# A reader that has seen enough is no error, and nothing is traced back.
clean mirrorstats score "$example" 2>"$out/early.txt" | head -1 >/dev/null
test ! -s "$out/early.txt"
code=0
clean mirrorstats report nowhere 2>/dev/null || code=$?
test "$code" = 2

echo "test-wheel: the package, with what others bring"
site=$(clean python -c "import sysconfig; print(sysconfig.get_path('purelib'))")
packages=$("$tools/bin/python" -c "import sysconfig; print(sysconfig.get_path('purelib'))")
echo "$packages" >"$site/tools.pth"
clean python -c "import mirrorstats, polars
study = mirrorstats.open('runs')
print(polars.DataFrame(study.episodes))"
# Still in that folder: what is named by its path from the checkout would differ.
pytest() {
  clean MIRRORSTATS_TEST_FIXTURES="$checkout/fixtures" MIRRORSTATS_TEST_BROWSER="$browser" python -m pytest --quiet \
    -p no:cacheprovider --rootdir "$out" "$@"
}
pytest "$checkout/python/tests" --ignore "$checkout/python/tests/test_inspect.py"
# In a process of its own: Inspect takes over signals.
pytest "$checkout/python/tests/test_inspect.py"

echo "test-wheel: the notebook"
clean python "$checkout/scripts/run-notebook.py" "$checkout/python/notebooks/first-steps.ipynb" "$out/notebook"
