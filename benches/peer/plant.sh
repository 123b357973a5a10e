#!/usr/bin/env bash
# Compares the time of the simulated plant with the same equations in plain C (reduced.c), alternately
# on one core. The task is that of docs/internals/plant.md: 2 s of a sphere that is held by a spring and
# driven by two sines, with each method.
#
#   benches/peer/plant.sh [rounds]
set -euo pipefail

rounds=${1:-9}
reps=200
cd "$(dirname "$0")/../.."
target=${CARGO_TARGET_DIR:-target}
mkdir -p "$target/peer"

gcc -O3 -march=native -ffp-contract=fast benches/peer/reduced.c -o "$target/peer/reduced" -lm
cargo build --quiet --release -p hbot-sim --example peer_task
rust=$target/release/examples/peer_task

pin=()
if command -v taskset >/dev/null && taskset -c 1 true 2>/dev/null; then
    pin=(taskset -c 1)
fi
file=$target/peer/marks.bin

# The method of hbot, its number in the C program (- if it has none), and the number of steps in 10 ms.
tasks=(
    "SemiImplicitEuler 0 10" "Rk4 1 10" "Rkmk4 2 10"
    "Rk4 1 1" "Rk4 1 2" "Rk4 1 80" "Midpoint - 2" "Midpoint - 10"
)
row='%-18s %7s  %9s %9s  %10s %10s  %22s  %9s %9s\n'
# Prints a quantile: the value below which the fraction `part` of the other arguments lies.
quartile() {
    local part=$1
    shift
    printf '%s\n' "$@" | sort -g | awk -v part="$part" '{ v[NR] = $1 } END { print v[int(part * (NR - 1) + 0.5) + 1] }'
}
# shellcheck disable=SC2059
printf "$row" method step 'hbot us' 'C us' 'hbot ms/s' 'C ms/s' 'hbot / C (quartiles)' error 'error, C'
for task in "${tasks[@]}"; do
    read -r method number steps <<<"$task"
    ours=() theirs=() ratios=()
    for ((i = 0; i < rounds; i++)); do
        h=$("${pin[@]}" "$rust" run "$method" "$steps" "$reps")
        c=nan
        if [ "$number" != - ]; then
            c=$("${pin[@]}" "$target/peer/reduced" "$number" "$steps" 200 "$reps" 0.0102 "$file" | cut -d' ' -f1)
        fi
        ours+=("$h") theirs+=("$c") ratios+=("$(awk -v h="$h" -v c="$c" 'BEGIN { printf "%.3f", h / c }')")
    done
    error=$("$rust" error "$method" "$steps" | cut -d' ' -f1)
    error_c=-
    [ "$number" = - ] || error_c=$("$rust" error "$file" | cut -d' ' -f1)
    n=$((200 * steps))
    us() { awk -v s="$1" -v n="$n" 'BEGIN { printf "%.3f", s / n * 1e6 }'; }
    ms() { awk -v s="$1" 'BEGIN { printf "%.4f", s * 500 }'; }
    h=$(quartile 0.5 "${ours[@]}")
    if [ "$number" = - ]; then
        c=nan ratio=-
    else
        c=$(quartile 0.5 "${theirs[@]}")
        ratio="$(quartile 0.5 "${ratios[@]}") ($(quartile 0.25 "${ratios[@]}") to $(quartile 0.75 "${ratios[@]}"))"
    fi
    printf "$row" "$method" "$(awk -v s="$steps" 'BEGIN { printf "%.3g", 10 / s }') ms" "$(us "$h")" "$(us "$c")" \
        "$(ms "$h")" "$(ms "$c")" "$ratio" "$error" "$error_c"
done
