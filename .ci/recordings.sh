#!/usr/bin/env bash
# Recordings of the program as it is built: an independent reader finds every topic of every tick,
# and a recording whose server was killed, or whose disk was full, replays up to there.
#
# Needs target/debug/hbot. Installs the readers of MCAP's authors from PyPI into target/ci.
set -euo pipefail
cd "$(dirname "$0")/.."

hbot=$PWD/target/debug/hbot
venv=target/ci/recordings
[ -x "$hbot" ] || { echo "$hbot is missing: cargo build --features full" >&2; exit 1; }
[ -x "$venv/bin/python" ] || python3 -m venv "$venv"
"$venv/bin/python" -c 'import mcap, mcap_protobuf' 2>/dev/null ||
    "$venv/bin/pip" install --quiet 'mcap==1.*' 'mcap-protobuf-support<1'

work=$(mktemp -d)
server=
trap '[ -z "$server" ] || kill -9 "$server" 2>/dev/null || true; rm -rf "$work"' EXIT
export XDG_STATE_HOME=$work/state
serve=("$hbot" server --port sim --listen 127.0.0.1:0)

"${serve[@]}" --time virtual --duration 12 --record "$work/whole.mcap" >"$work/whole.txt"
grep -q '12000 ticks recorded, 0 lost' "$work/whole.txt" || { cat "$work/whole.txt" >&2; exit 1; }
"$hbot" replay "$work/whole.mcap"
"$venv/bin/python" .ci/recordings.py "$work/whole.mcap" 12000

# Waits until a file has more than so many bytes.
grown() {
    for _ in $(seq 600); do
        [ "$(stat -c %s "$1" 2>/dev/null || echo 0)" -gt "$2" ] && return
        sleep 0.1
    done
    echo "$1 does not grow" >&2
    exit 1
}

# Runs a replay that must end with exit code 1, say `$2`, and agree in every bit up to there.
partly() {
    local said
    said=$("$hbot" replay "$1" 2>&1) && { echo "$1: a replay of a part counts as a whole one" >&2; exit 1; }
    echo "$said"
    grep -q "$2" <<<"$said" && grep -q 'every bit agrees' <<<"$said"
}

# Killed without a chance to end the file.
"${serve[@]}" --record "$work/killed.mcap" >/dev/null &
server=$!
grown "$work/killed.mcap" 300000
kill -9 "$server"
wait "$server" 2>/dev/null || true
server=
partly "$work/killed.mcap" 'cut'

# A disk that is full: a limit on the size of files, at which writing fails.
code=0
(
    ulimit -f 400
    "${serve[@]}" --time virtual --duration 12 --record "$work/full.mcap" >"$work/full.txt" 2>&1
) || code=$?
[ "$code" = 3 ] || { echo "a recording that failed ends with exit code $code" >&2; exit 1; }
grep -q 'the recording cannot be written' "$work/full.txt" || { cat "$work/full.txt" >&2; exit 1; }
grep -q '1 file failed' "$work/full.txt" || { cat "$work/full.txt" >&2; exit 1; }
grep -q "cut short: $work/full.mcap" "$work/full.txt" || { cat "$work/full.txt" >&2; exit 1; }
partly "$work/full.mcap" 'cut'

# A folder that cannot be made, because its name is that of a file: the server says so and does not begin.
touch "$work/file"
code=0
"${serve[@]}" --time virtual --duration 2 --record "$work/file/folder" >"$work/nowhere.txt" 2>&1 || code=$?
[ "$code" = 1 ] || { echo "a recording that cannot begin ends with exit code $code" >&2; exit 1; }
grep -q 'no file can be made there' "$work/nowhere.txt" || { cat "$work/nowhere.txt" >&2; exit 1; }
echo "recordings are read by MCAP's own reader and replay as far as they go"
