#!/usr/bin/env bash
# Live viewers: Foxglove's own client library receives every topic of every tick from a running server.
#
# The argument is the number of seconds, 3 by default. A study over a minute: .ci/foxglove.sh 60
#
# Needs target/debug/hbot with the feature live, and node. Installs the client library from npm into target/ci.
set -euo pipefail
cd "$(dirname "$0")/.."

hbot=$PWD/${HBOT:-target/debug/hbot}
[ -x "$hbot" ] || { echo "$hbot is missing: cargo build --features full" >&2; exit 1; }
command -v npm >/dev/null || .ci/install.sh --no-install-recommends nodejs npm
home=target/ci/foxglove
mkdir -p "$home"
[ -d "$home/node_modules/protobufjs" ] ||
    npm install --silent --no-audit --no-fund --prefix "$home" '@foxglove/ws-protocol@0.8' 'ws@8' 'protobufjs@8'
# Node looks for packages beside the script.
cp .ci/foxglove.mjs "$home/"

work=$(mktemp -d)
server=
trap '[ -z "$server" ] || kill "$server" 2>/dev/null || true; rm -rf "$work"' EXIT
XDG_STATE_HOME=$work "$hbot" server --port sim --listen 127.0.0.1:0 --foxglove 127.0.0.1:0 >"$work/out" &
server=$!
for _ in $(seq 600); do
    grep -q '  listen' "$work/out" && break
    sleep 0.1
done
viewers=$(sed -n 's,^viewers ws://,,p' "$work/out")
address=$(awk '/^  listen/ { print $NF }' "$work/out")
[ -n "$viewers" ] && [ -n "$address" ] || { cat "$work/out" >&2; exit 1; }

node "$home/foxglove.mjs" "$viewers" "${1:-3}" "$hbot" set spring stiffness=0.8 --server "$address"
echo "Foxglove's own client receives every topic, and can command nothing"
