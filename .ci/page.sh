#!/usr/bin/env bash
# The page in a browser: Debian's Chromium takes a simulated rig, turns the sphere, loads scenes, stops, loses the server
# and finds it again. Prints how long things take, and checks only what does not depend on the machine.
#
# The argument is a folder for pictures of the page in all its states; by default they are not kept.
#
# HBOT_PAGE=crates/hbot-server/src/web takes the files of the page from there, without building the server.
#
# Also runs the clients of docs/websocket.md: in JavaScript in the page, in C# with Mono.
#
# Needs target/debug/hbot, node, chromium and mono. Installs playwright-core from npm into target/ci.
set -euo pipefail
cd "$(dirname "$0")/.."

hbot=$PWD/${HBOT:-target/debug/hbot}
[ -x "$hbot" ] || { echo "$hbot is missing: cargo build" >&2; exit 1; }
command -v npm >/dev/null || .ci/install.sh --no-install-recommends nodejs npm
command -v mono >/dev/null || .ci/install.sh --no-install-recommends mono-mcs mono-runtime libmono-system4.0-cil
command -v chromium >/dev/null || .ci/install.sh --no-install-recommends chromium fonts-dejavu-core
home=target/ci/page
mkdir -p "$home"
[ -d "$home/node_modules/playwright-core" ] ||
    npm install --silent --no-audit --no-fund --prefix "$home" 'playwright-core@1.65'
# Node looks for packages beside the script.
cp .ci/page/*.mjs "$home/"

bytes=$(cat crates/hbot-server/src/web/*.{html,css,js,svg} | wc -c)
[ "$bytes" -le 200000 ] || { echo "the page has $bytes bytes" >&2; exit 1; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
pictures=${1:-$work/pictures}
mkdir -p "$pictures"
# The script starts servers, holds them and ends them.
XDG_STATE_HOME=$work node "$home/page.mjs" "$hbot" "$pictures"
XDG_STATE_HOME=$work node "$home/clients.mjs" "$hbot" "$work"
echo "the page shows, takes, turns, stops and finds the rig again ($((bytes / 1000)) kB)"
