#!/usr/bin/env bash
# The program that couples two rigs, its theory and its tests on two servers. Needs the server's program, which the tests
# of the workspace have built, and the environment of .ci/python.sh, which runs before.
set -euo pipefail
cd "$(dirname "$0")/.."

target="$PWD/${CARGO_TARGET_DIR:-target}"
case ${CARGO_TARGET_DIR:-} in /*) target="$CARGO_TARGET_DIR" ;; esac
export HBOT_PROGRAM="${HBOT_PROGRAM:-$target/debug/hbot}"
venv="$target/python/venv"
if [ ! -x "$venv/bin/pytest" ]; then
    echo "run .ci/python.sh first: it makes $venv" >&2
    exit 1
fi
# Installed already, unless the requirements of the experiments have changed.
"$venv/bin/pip" install --quiet --disable-pip-version-check 'matplotlib>=3.8' 'numpy>=1.24'

echo "-- the coupling of two rigs"
cd examples
"$venv/bin/ruff" format --quiet --check couple.py coupling
"$venv/bin/ruff" check --quiet couple.py coupling
"$venv/bin/mypy" --cache-dir "$target/python/mypy"
"$venv/bin/pytest" -q -o cache_dir="$target/python/pytest"
