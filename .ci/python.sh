#!/usr/bin/env bash
# The Python client: types, style, tests against the real server, and both packages installed into an empty environment
# and used; and the experiments. Needs the server's program, which the tests of the workspace have built.
#
#     .ci/python.sh              what .ci/run does
#     .ci/python.sh --install    only installs what it needs, into target/python
set -euo pipefail
cd "$(dirname "$0")/.."

target="$PWD/${CARGO_TARGET_DIR:-target}"
case ${CARGO_TARGET_DIR:-} in /*) target="$CARGO_TARGET_DIR" ;; esac
python3 -c 'import ensurepip' 2>/dev/null || .ci/install.sh python3-venv
command -v openssl >/dev/null || .ci/install.sh openssl

# The environments stay in target/: a second run installs nothing.
venv="$target/python/venv"
if [ ! -x "$venv/bin/python" ]; then
    python3 -m venv "$venv"
fi
cd clients/python
"$venv/bin/pip" install --quiet --disable-pip-version-check --editable '.[align,gym,numpy,msgpack,lsl,mcap,toml]' \
    matplotlib pytest==9.* pytest-timeout==2.* pytest-xdist==3.* mypy==2.* ruff==0.* build==1.* hatchling==1.*

# pip has rclpy for all Pythons that hbot is for. Without it this script ends here.
"$venv/bin/pip" install --quiet --disable-pip-version-check --editable '.[ros2]'

# MuJoCo has no packages for every Python. What it is needed for is left out then, but never in silence.
if "$venv/bin/pip" install --quiet --disable-pip-version-check --editable '.[mujoco]' 2>/dev/null &&
    "$venv/bin/python" -c 'import mujoco' 2>/dev/null; then
    export HBOT_MUJOCO=1
else
    echo "** MUJOCO CANNOT BE INSTALLED HERE: hbot.mujoco and its examples are NOT TESTED **" >&2
fi

# PsychoPy wants older packages than the rest, and has none for Python 3.13.
command -v Xvfb >/dev/null && command -v xdotool >/dev/null || ../../.ci/install.sh xvfb xdotool
if [ ! -x "$target/python/psychopy/bin/python" ]; then
    python3 -m venv "$target/python/psychopy"
fi
"$target/python/psychopy/bin/pip" install --quiet --disable-pip-version-check \
    --editable . --editable '../../examples/experiments[psychopy]' pytest==9.* pytest-timeout==2.*

[ "${1:-}" != --install ] || exit 0
export HBOT_PROGRAM="${HBOT_PROGRAM:-$target/debug/hbot}"
if [ ! -x "$HBOT_PROGRAM" ]; then
    cargo build --quiet --locked --workspace --features full --bin hbot
fi

echo "-- style and types"
"$venv/bin/ruff" format --quiet --check .
"$venv/bin/ruff" check --quiet .
"$venv/bin/mypy" --cache-dir "$target/python/mypy"

if [ -n "${HBOT_MUJOCO:-}" ]; then
    echo "-- examples that feel MuJoCo, for a minute each"
    "$venv/bin/pytest" -q -k minute -o cache_dir="$target/python/pytest"
fi

# They mostly wait for a server.
echo "-- tests against $HBOT_PROGRAM, four at a time"
"$venv/bin/pytest" -q -n 4 -k "not minute" -o cache_dir="$target/python/pytest"

# Each package is installed alone into an environment that has nothing else.
rm -rf "$target/python/dist"
"$venv/bin/python" -m build --no-isolation --outdir "$target/python/dist" . >/dev/null
for package in "$target"/python/dist/*; do
    echo "-- $(basename "$package") in an empty environment"
    rm -rf "$target/python/empty"
    python3 -m venv "$target/python/empty"
    "$target/python/empty/bin/pip" install --quiet --disable-pip-version-check "$package"
    "$target/python/empty/bin/python" tests/installed.py
done

echo "-- the experiments, with simulated participants"
cd ../../examples/experiments
"$venv/bin/pip" install --quiet --disable-pip-version-check --editable .
"$venv/bin/ruff" format --quiet --check .
"$venv/bin/ruff" check --quiet .
"$venv/bin/mypy" --cache-dir "$target/python/mypy"
"$venv/bin/pytest" -q -o cache_dir="$target/python/pytest"

echo "-- the experiment in a window of PsychoPy"
HBOT_PSYCHOPY=1 "$target/python/psychopy/bin/pytest" -q -o cache_dir="$target/python/pytest" tests/test_psychopy.py
