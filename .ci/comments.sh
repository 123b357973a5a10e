#!/usr/bin/env bash
# No comment in Rust sources is wider than 100 columns: rustfmt wraps code, but not comments.
set -euo pipefail
cd "$(dirname "$0")/.."
export LC_ALL=C.UTF-8

# Grep ends with 1 if it finds nothing, and with more if it fails.
found=0
git grep -nP '^(?=.{101})(\s*//|.*\s//[/!]?\s)' -- '*.rs' || found=$?
case $found in
0) echo "wrap these comments at 100 columns" >&2 && exit 1 ;;
1) ;;
*) exit "$found" ;;
esac
