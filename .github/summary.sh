#!/usr/bin/env bash
# Prints a verdict.json as Markdown: first what did not pass, then all checks, folded.
set -euo pipefail
if [ ! -s "${1:?the path of a verdict.json}" ]; then
  echo "## Dithersteer: could not run"
  echo "There is no $1; the log of the step before has the reason."
  exit 0
fi
jq -r '
  def cell: tostring | gsub("\\|"; "\\|");
  def row: "| \(.status) | \(.title | cell) | \(.measured | cell) | \(.limit | cell) \(.unit | cell) |";
  def table: "| status | check | measured | limit |", "|---|---|---|---|", (.[] | row);
  ([.checks[] | select(.status != "passed")]) as $open
  | "## Dithersteer: \(.verdict), \(.checks | length) checks",
    (if ($open | length) > 0 then "", ($open | table) else empty end),
    "", "<details><summary>All checks</summary>", "", (.checks | table), "", "</details>"
' "$1"
