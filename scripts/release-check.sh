#!/bin/sh
# The checks before a release: versions, changelog, supply chain, generated files, book, report, wheel. Says each check; stops at the first that fails.
set -eu
cd "$(dirname "$0")/.."
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
fail() { echo "release-check: $1" >&2; exit 1; }

echo "release-check: version $version"
grep -q "^version: $version" CITATION.cff || fail "CITATION.cff has another version: expected $version"
grep -q "^## \[$version\]" CHANGELOG.md || fail "CHANGELOG.md has no section [$version]: rename Unreleased"
[ -z "$(git status --porcelain)" ] || fail "the tree is not clean: commit or remove the changes"
echo "release-check: supply chain"
if command -v cargo-deny >/dev/null; then
  cargo deny --all-features check
else
  echo "release-check: NOT CHECKED: licences, sources, versions and advisories, as cargo-deny is not installed (cargo install cargo-deny)" >&2
fi
echo "release-check: schemas and reference"
cargo test --quiet --workspace --all-features --test house schemas
cargo test --quiet --workspace --all-features --test command_line reference
echo "release-check: book"
scripts/book.sh
echo "release-check: the paper's report"
scripts/end-to-end.sh
echo "release-check: wheel"
wheel=$(scripts/wheel.sh)
scripts/test-wheel.sh "$wheel"
echo "release-check: the documented commands, by the command of the wheel"
installed=$(mktemp -d)
trap 'rm -rf "$installed"' EXIT
python3 -m venv "$installed"
"$installed/bin/pip" install --quiet --disable-pip-version-check --no-index "$wheel"
TEST_PROGRAMS=$installed/bin cargo test --quiet --workspace --all-features --test command_line readme
echo "release-check: all passed; tag v$version"
