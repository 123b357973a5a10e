#!/usr/bin/env bash
# A build without features: it runs the server of the first page of README, and says how to get what it lacks.
set -euo pipefail
cd "$(dirname "$0")/.."

cargo build --locked --quiet --bin hbot
hbot=${CARGO_TARGET_DIR:-target}/debug/hbot
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export XDG_STATE_HOME=$work

# Expects that a command fails with these words.
refused() {
    local words=$1
    shift
    if "$hbot" "$@" >"$work/out" 2>&1; then echo "hbot $* succeeds" >&2; exit 1; fi
    grep -qF -- "$words" "$work/out" || { echo "hbot $* does not say: $words" >&2; cat "$work/out" >&2; exit 1; }
}

"$hbot" server --listen 127.0.0.1:0 --time virtual --duration 1 >/dev/null
refused "cargo run --features metrics server" server --listen 127.0.0.1:0 --metrics 127.0.0.1:0
refused "cargo run --features live server" server --listen 127.0.0.1:0 --foxglove 127.0.0.1:0
sed '/^\[api\]/a tls = { certificate = "rig.pem", key = "rig.key" }' rigs/prototype.toml >"$work/rig.toml"
grep -q '^tls' "$work/rig.toml"
refused "cargo run --features tls server" server --rig "$work/rig.toml" --port sim --listen 127.0.0.1:0
refused "build with \`--features tls\`" info --ca "$work/rig.toml"
echo "a build without features says how to get metrics, live viewers and encryption"
