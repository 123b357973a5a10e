#!/usr/bin/env bash
# Compares the time of the balanced tick with the same formulas in plain C (tick.c). The programs run
# alternately, so that other load on the machine affects all of them. On a busy machine compare the least times.
#
#   benches/peer/compare.sh [rounds]
set -euo pipefail

rounds=${1:-21}
cd "$(dirname "$0")/../.."
peer=${CARGO_TARGET_DIR:-target}/peer
mkdir -p "$peer"

# Programs in plain C: for this processor and, like the Rust build, for any processor of this
# architecture; each without and with the watch on encoder counts, which hbot has.
flags=(-std=gnu11 -O3 -ffp-contract=fast)
build() { gcc "${flags[@]}" "${@:2}" benches/peer/tick.c -o "$peer/$1" -lm; }
build tick -march=native
build tick-watch -march=native -DWATCH=1
build tick-baseline
build tick-baseline-watch -DWATCH=1
cargo bench --quiet --bench tick --no-run

pin=()
if command -v taskset >/dev/null && taskset -c 1 true 2>/dev/null; then
    pin=(taskset -c 1)
fi

# Each program measures 500 series of 400 ticks, and prints the least and the median of their mean times.
rust() { "${pin[@]}" cargo bench --quiet --bench tick -- --peer 500 400; }
c() { "${pin[@]}" "$peer/$1" 2000 500 400; }

programs=(rust 'c tick' 'c tick-watch' 'c tick-baseline' 'c tick-baseline-watch')
names=(hbot 'C, native' 'C, native, with the watch' 'C, baseline' 'C, baseline, with the watch')
results=$(mktemp)
trap 'rm -f "$results"' EXIT
for ((i = 1; i <= rounds; i++)); do
    if [ -t 2 ]; then printf '\rround %d of %d' "$i" "$rounds" >&2; fi
    for k in "${!programs[@]}"; do
        line=$(${programs[k]} | grep '^ns/tick')
        printf '%s\t%s\n' "${names[k]}" "$line" >>"$results"
    done
done
if [ -t 2 ]; then printf '\r                \r' >&2; fi

python3 - "$results" <<'PY'
import statistics, sys

medians, least = {}, {}
for line in open(sys.argv[1]):
    name, times = line.rstrip("\n").split("\t")
    _, _, low, _, median, *_ = times.split()
    medians.setdefault(name, []).append(float(median))
    least[name] = min(float(low), least.get(name, float("inf")))
print(f"{'ns a tick':28} {'median of rounds':>22} {'hbot / C':>9} {'least':>7} {'hbot / C':>9}")
for name, rounds in medians.items():
    median = statistics.median(rounds)
    shown = f"{median:.0f} ({min(rounds):.0f} to {max(rounds):.0f})"
    ratios = [statistics.median(medians["hbot"]) / median, least["hbot"] / least[name]]
    a, b = ("", "") if name == "hbot" else (f"{ratio:.2f}" for ratio in ratios)
    print(f"{name:28} {shown:>22} {a:>9} {least[name]:7.0f} {b:>9}")
PY
echo
echo "The last of the first 2000 ticks in C:"
"$peer/tick" 2000 1 1 | grep -v '^ns'
# The watch changes no result. Without fused operations, all bits can be compared.
diff <("$peer/tick-baseline" 2000 1 1 | grep -v '^ns') <("$peer/tick-baseline-watch" 2000 1 1 | grep -v '^ns')
