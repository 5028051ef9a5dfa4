#!/bin/sh
# Makes sure that pdfTeX compiles the tables of reports: Debian's texlive-latex-base and texlive-latex-recommended if it is missing.
set -eu

found() {
  command -v pdflatex >/dev/null && kpsewhich booktabs.sty graphicx.sty xcolor.sty colortbl.sty >/dev/null
}

found && exit 0
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
  echo "get-tex: installing texlive-latex-base and texlive-latex-recommended with apt-get" >&2
  export DEBIAN_FRONTEND=noninteractive
  { apt-get update && apt-get install --yes --no-install-recommends texlive-latex-base texlive-latex-recommended; } >&2
  found && exit 0
fi
echo "get-tex: no pdflatex with booktabs, graphicx and xcolor, and none can be installed here (that takes root and" \
  "apt-get); install texlive-latex-base and texlive-latex-recommended by hand" >&2
exit 1
