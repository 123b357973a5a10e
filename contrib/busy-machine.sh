#!/bin/sh
# Measures whether the server keeps its simulated rig running on a busy machine. It starts busy loops, runs the server
# beside them several times, and prints one row of a table for each run: faults, and ticks that were late, skipped or
# missed. docs/realtime.md explains the result.
#
#     contrib/busy-machine.sh HBOT [RUNS [SECONDS [LOOPS [OPTIONS OF THE SERVER...]]]]
#     contrib/busy-machine.sh target/debug/hbot 10 60 4 --port sim:pty
set -eu
hbot=$1
runs=${2:-10}
seconds=${3:-60}
loops=${4:-4}
[ $# -lt 4 ] && shift $# || shift 4

folder=$(mktemp -d)
busy=
trap 'kill $busy 2>/dev/null || true; rm -rf "$folder"' EXIT
for _ in $(seq "$loops"); do
    (while :; do :; done) &
    busy="$busy $!"
done

echo "| user | real-time priority | fault | ticks | late | skipped | missed | load of the machine |"
echo "|---|---|---|---|---|---|---|---|"
for _ in $(seq "$runs"); do
    XDG_STATE_HOME=$folder HBOT_LOG=warn "$hbot" server --listen 127.0.0.1:0 --duration "$seconds" "$@" \
        >"$folder/out" 2>"$folder/log" || true
    # A log line of a fault reads: "... WARN hbot_server...: link_lost: the motor controllers ... tick=1234".
    fault=$(sed -n 's/.*WARN[^ ]* [^ ]* \([a-z_]*\): .*tick[^=]*=[^0-9]*\([0-9]*\).*/\1 in tick \2/p' "$folder/log" | head -n 1)
    grep -q 'no real-time priority' "$folder/out" && urgent=no || urgent=yes
    counts=$(sed -n 's/.*stopped.* after \([0-9]*\) ticks: \([0-9]*\) late, \([0-9]*\) skipped, \([0-9]*\) missed.*/\1 | \2 | \3 | \4/p' \
        "$folder/out")
    load=$(cut -d ' ' -f 1 /proc/loadavg)
    echo "| $(id -un) | $urgent | ${fault:-none} | ${counts:-no end was seen} | $load |"
done
