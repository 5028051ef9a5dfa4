#!/bin/sh
# The step of action.yml: runs `gate` or `verify`, writes annotations, the summary, a comment and the outputs.
# Environment: COMMAND, ARGUMENTS (one per line), ACCEPT (exit codes), COMMENT (a file), MIRRORSTATS (the program).
set -eu
program=${MIRRORSTATS:-mirrorstats}
comment=${COMMENT:-mirrorstats-comment.md}

set --
while IFS= read -r line; do
  if [ "$line" ]; then set -- "$@" "$line"; fi
done <<END
$ARGUMENTS
END

errors=$(mktemp)
code=0
case $COMMAND in
  gate)
    "$program" gate "$@" --format md >"$comment" 2>"$errors" || code=$?
    verdict=$(sed -n 's/^verdict: \([a-z ]*\);.*/\1/p' "$comment" | tail -n 1)
    ;;
  verify)
    "$program" verify "$@" >"$comment.text" 2>"$errors" || code=$?
    case $code in
      0) verdict=equal ;;
      1) verdict=different ;;
      *) verdict= ;;
    esac
    { echo '**mirrorstats verify**'; echo; sed 's/^/    /' "$comment.text"; } >"$comment"
    ;;
  *)
    echo "action: expected the command gate or verify, found $COMMAND" >&2
    exit 2
    ;;
esac
verdict=${verdict:-error}
cat "$errors" >&2

# A text as the message of a workflow command.
escaped() { sed -e 's/%/%25/g' | awk '{ printf "%s%s", (NR > 1 ? "%0A" : ""), $0 }'; }
if [ "$verdict" = error ]; then
  printf '::error title=mirrorstats %s::%s\n' "$COMMAND" "$(escaped <"$errors")"
  { echo '```'; cat "$errors"; echo '```'; } >"$comment"
elif [ "$COMMAND" = gate ]; then
  "$program" gate "$@" --format github 2>/dev/null || true
elif [ "$verdict" = different ]; then
  # The last line counts; each line before it is a difference.
  sed '$d' "$comment.text" | while IFS= read -r line; do
    printf '::error title=mirrorstats verify::%s\n' "$(printf '%s\n' "$line" | escaped)"
  done
fi
rm -f "$errors" "$comment.text"

cat "$comment" >>"${GITHUB_STEP_SUMMARY:-/dev/null}"
{
  echo "verdict=$verdict"
  echo "exit-code=$code"
  echo "comment=$comment"
} >>"${GITHUB_OUTPUT:-/dev/null}"
for accepted in ${ACCEPT:-0}; do
  if [ "$accepted" = "$code" ]; then exit 0; fi
done
exit "$code"
