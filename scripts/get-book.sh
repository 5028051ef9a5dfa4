#!/bin/sh
# Prints the folder of a virtual environment with the generator of the book, made once, beside what cargo builds.
set -eu
version=9.8.2
environment=${CARGO_TARGET_DIR:-target}/book-environment-$version
if [ ! -x "$environment/bin/mkdocs" ]; then
  echo "get-book: fetching mkdocs-material $version" >&2
  rm -rf "$environment"
  { python3 -m venv "$environment" &&
    "$environment/bin/python" -m pip install --quiet --disable-pip-version-check "mkdocs-material==$version"; } >&2
fi
cd "$environment" && pwd
