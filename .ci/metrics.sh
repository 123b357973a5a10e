#!/usr/bin/env bash
# The metrics page, checked by promtool; a Prometheus that scrapes a server; every query of the Grafana dashboard
# answered by it.
set -euo pipefail
cd "$(dirname "$0")/.."

.ci/install.sh --no-install-recommends prometheus curl

hbot=${1:-${CARGO_TARGET_DIR:-target}/debug/hbot}
work=$(mktemp -d)
processes=()
stop() {
    for process in "${processes[@]}"; do kill "$process" 2>/dev/null || true; done
    wait
    rm -rf "$work"
}
trap stop EXIT

# Waits until a command succeeds, for at most a minute.
eventually() {
    for _ in $(seq 600); do
        if "$@"; then return; fi
        sleep 0.1
    done
    echo "not within a minute: $*" >&2
    cat "$work"/*.log >&2
    exit 1
}

# A free port for the page and one for Prometheus, which cannot choose by themselves.
read -r page prometheus < <(python3 -c '
import random, socket
# Below those that the system gives to other programs meanwhile.
def free():
    while True:
        with socket.socket() as s:
            try:
                port = random.randrange(10000, 32768)
                s.bind(("127.0.0.1", port))
                return port
            except OSError:
                pass
print(free(), free())')
XDG_STATE_HOME=$work "$hbot" server --listen 127.0.0.1:0 --metrics "127.0.0.1:$page" >"$work/hbot.log" 2>&1 &
processes+=($!)
scrape() { curl --silent --fail "http://127.0.0.1:$page/metrics" >"$work/page"; }
eventually scrape

echo "-- promtool"
# promtool reads the format before OpenMetrics, in which the name of a counter ends in _total in its comments too.
awk '$1 == "#" && $2 == "HELP" { help = $0; name = $3; next }
    $1 == "#" && $2 == "UNIT" { next }
    $1 == "#" && $2 == "TYPE" {
        if ($4 == "counter") { sub(name, name "_total", help); $3 = name "_total" }
        print help; print; next
    }
    $0 != "# EOF"' "$work/page" >"$work/older"
test "$(grep -c '^# TYPE' "$work/older")" -ge 20
promtool check metrics <"$work/older"

echo "-- Prometheus and the dashboard's queries"
cat >"$work/prometheus.yml" <<END
global: { scrape_interval: 1s }
scrape_configs:
  - job_name: hbot
    static_configs: [{ targets: ["127.0.0.1:$page"] }]
END
prometheus --config.file="$work/prometheus.yml" --storage.tsdb.path="$work/tsdb" --log.level=warn \
    --web.listen-address="127.0.0.1:$prometheus" >"$work/prometheus.log" 2>&1 &
processes+=($!)
.ci/dashboard.py contrib/grafana.json "http://127.0.0.1:$prometheus" "$work/page"
