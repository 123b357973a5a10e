#!/usr/bin/env bash
# The metrics page, checked by promtool and asked for in both formats; a Prometheus that scrapes a server; every query of the Grafana dashboard
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
scrape() { curl --silent --fail "$@" "http://127.0.0.1:$page/metrics"; }
save() { scrape >"$work/page"; }
eventually save
test "$(tail -n 1 "$work/page")" = "# EOF"

echo "-- promtool"
# promtool reads the text format before OpenMetrics.
scrape --header 'Accept: text/plain;version=0.0.4' --dump-header "$work/head" >"$work/older"
grep -qi '^content-type: text/plain; version=0.0.4' "$work/head"
test "$(grep -c '^# TYPE' "$work/older")" -ge 20
promtool check metrics <"$work/older"
# Both formats have the same samples by name.
names() { grep -v '^#' "$1" | cut -d ' ' -f 1; }
diff <(names "$work/page") <(names "$work/older")

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
