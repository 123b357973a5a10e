#!/usr/bin/env bash
# Compares the time of the balanced tick with the same formulas in plain C (tick.c). The programs run
# alternately, so that other load on the machine affects all of them.
#
#   benches/peer/compare.sh [rounds]
set -euo pipefail

rounds=${1:-5}
bench=tick/f64/balanced/2
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

rust() {
    local out
    out=$("${pin[@]}" cargo bench --quiet --bench tick -- "$bench" \
        --warm-up-time 1 --measurement-time 3 --discard-baseline 2>&1)
    # The line is "time: [low median high]", each number with its unit. Convert the median to ns.
    awk '$1 == "time:" || $2 == "time:" {
        sub(/.*\[/, ""); sub(/\].*/, "")
        k = $4 == "ns" ? 1 : $4 == "ps" ? 1e-3 : $4 == "ms" ? 1e6 : 1e3
        printf "%.1f\n", $3 * k; found = 1
    } END { exit !found }' <<<"$out"
}
c() { "${pin[@]}" "$peer/$1" 2000 150 20000 | awk '/^ns\/tick/ { print $5 }'; }

programs=(tick tick-watch tick-baseline tick-baseline-watch)
names=('C, native' 'C, native, with the watch' 'C, baseline' 'C, baseline, with the watch')
r=() c0=() c1=() c2=() c3=()
printf '%-6s %8s %10s %10s %10s %10s   ns a tick\n' round hbot native '+ watch' baseline '+ watch'
for ((i = 1; i <= rounds; i++)); do
    r+=("$(rust)")
    row=("${r[-1]}")
    for k in "${!programs[@]}"; do
        declare -n times=c$k
        times+=("$(c "${programs[k]}")")
        row+=("${times[-1]}")
    done
    printf '%-6d %8s %10s %10s %10s %10s\n' "$i" "${row[@]}"
done

# Prints the median, the smallest and the largest of the arguments.
spread() {
    printf '%s\n' "$@" | sort -g | awk '{ v[NR] = $1 } END {
        m = NR % 2 ? v[(NR + 1) / 2] : (v[NR / 2] + v[NR / 2 + 1]) / 2
        print m, v[1], v[NR]
    }'
}
read -r rm rl rh < <(spread "${r[@]}")
echo
printf '%-28s median %6.1f ns   (%.1f to %.1f)\n' hbot "$rm" "$rl" "$rh"
for k in "${!programs[@]}"; do
    declare -n times=c$k
    read -r m l h < <(spread "${times[@]}")
    printf '%-28s median %6.1f ns   (%.1f to %.1f)   hbot / C = %s\n' "${names[k]}" "$m" "$l" "$h" \
        "$(awk -v a="$rm" -v b="$m" 'BEGIN { printf "%.2f", a / b }')"
done
echo
echo "The last of the first 2000 ticks in C:"
"$peer/tick" 2000 1 1 | grep -v '^ns'
# The watch changes no result. Without fused operations, all bits can be compared.
diff <("$peer/tick-baseline" 2000 1 1 | grep -v '^ns') <("$peer/tick-baseline-watch" 2000 1 1 | grep -v '^ns')
