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

flags=(-std=gnu11 -O3 -ffp-contract=fast)
gcc "${flags[@]}" -march=native benches/peer/tick.c -o "$peer/tick" -lm
# Like the Rust build, for any processor of this architecture.
gcc "${flags[@]}" benches/peer/tick.c -o "$peer/tick-baseline" -lm
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

r=() n=() b=()
printf '%-6s %10s %12s %16s   ns a tick\n' round hbot 'C, native' 'C, baseline'
for ((i = 1; i <= rounds; i++)); do
    r+=("$(rust)")
    n+=("$(c tick)")
    b+=("$(c tick-baseline)")
    printf '%-6d %10s %12s %16s\n' "$i" "${r[-1]}" "${n[-1]}" "${b[-1]}"
done

# Prints the median, the smallest and the largest of the arguments.
spread() {
    printf '%s\n' "$@" | sort -g | awk '{ v[NR] = $1 } END {
        m = NR % 2 ? v[(NR + 1) / 2] : (v[NR / 2] + v[NR / 2 + 1]) / 2
        print m, v[1], v[NR]
    }'
}
read -r rm rl rh < <(spread "${r[@]}")
read -r nm nl nh < <(spread "${n[@]}")
read -r bm bl bh < <(spread "${b[@]}")
echo
printf '%-12s median %6.1f ns   (%.1f to %.1f)\n' hbot "$rm" "$rl" "$rh"
printf '%-12s median %6.1f ns   (%.1f to %.1f)   hbot / C = %s\n' 'C, native' "$nm" "$nl" "$nh" \
    "$(awk -v a="$rm" -v b="$nm" 'BEGIN { printf "%.2f", a / b }')"
printf '%-12s median %6.1f ns   (%.1f to %.1f)   hbot / C = %s\n' 'C, baseline' "$bm" "$bl" "$bh" \
    "$(awk -v a="$rm" -v b="$bm" 'BEGIN { printf "%.2f", a / b }')"
echo
echo "The last of the first 2000 ticks in C:"
"$peer/tick" 2000 1 1 | grep -v '^ns'
