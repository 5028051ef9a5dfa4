#!/bin/sh
# Builds the book from docs/ and checks it: dead links and requests to other hosts are errors.
set -eu
cd "$(dirname "$0")/.."
book=$(mkdir -p "${CARGO_TARGET_DIR:-target}" && cd "${CARGO_TARGET_DIR:-target}" && pwd)/book
environment=$(scripts/get-book.sh)
NO_MKDOCS_2_WARNING=1 "$environment/bin/mkdocs" build --quiet --clean --site-dir "$book"
if grep -rnoE '(src|href)="(https?:)?//[^"]*' "$book" --include='*.html' | grep -E 'src=|stylesheet|<link'; then
  echo "book: a page loads something from another host" >&2
  exit 1
fi
echo "book: $book/index.html"
