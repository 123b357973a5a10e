#!/usr/bin/env bash
# Measures the lateness of the loop without the panel and with it, alternately, so that other load on
# the machine affects both. Without a screen it needs Xvfb. Run it on an otherwise idle machine:
#
#   benches/panel/lateness.sh [rounds] [seconds a run]
set -euo pipefail

rounds=${1:-5}
seconds=${2:-20}
cd "$(dirname "$0")/../.."
cargo build --quiet --release -p hbot -p hbot-gui
bin=${CARGO_TARGET_DIR:-target}/release
address=127.0.0.1:4269

display=''
trap '[[ -z $display ]] || kill "$display"' EXIT
if [[ -z ${DISPLAY:-}${WAYLAND_DISPLAY:-} ]]; then
    Xvfb :99 -screen 0 1400x900x24 -nolisten tcp 2>/dev/null &
    display=$!
    export DISPLAY=:99
    sleep 1
fi

# Prints the median and the 99 % quantile of the lateness in one run of the server, us.
server() {
    "$bin/hbot" server --listen "$address" --duration "$seconds" 2>/dev/null |
        sed -n 's/.*lateness \([0-9.]*\) (\([0-9.]*\)).*/\1 \2/p'
}

watched() {
    "$bin/hbot-gui" --server "$address" 2>/dev/null &
    local panel=$!
    server
    kill "$panel"
    wait "$panel" 2>/dev/null || true
}

middle() { printf '%s\n' "$@" | sort -g | sed -n "$((($# + 1) / 2))p"; }

without=() with=()
printf '%-6s %20s %20s   lateness us: median, 99 %%\n' round 'without the panel' 'with it'
for ((i = 1; i <= rounds; i++)); do
    a=$(server)
    b=$(watched)
    without+=("${a% *}")
    with+=("${b% *}")
    printf '%-6s %20s %20s\n' "$i" "$a" "$b"
done
awk -v a="$(middle "${without[@]}")" -v b="$(middle "${with[@]}")" 'BEGIN {
    printf "middle of the medians: %.1f us without, %.1f us with the panel: %.2f times\n", a, b, b / a
}'
