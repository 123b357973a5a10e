#!/usr/bin/env bash
# Fuzzes every decoder for half a minute (FUZZ_SECONDS) by libFuzzer where this machine can build that, and otherwise drives the same
# checks by seeded mutations.
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=${FUZZ_SECONDS:-30}
# Sanitizer flags are unstable; this lets the pinned toolchain take them.
export RUSTC_BOOTSTRAP=1

can_fuzz() {
    command -v g++ >/dev/null || return 1
    cargo fuzz --version >/dev/null 2>&1 || cargo install --quiet --locked cargo-fuzz@0.13.2 || return 1
    cargo fuzz build
}

if can_fuzz; then
    for target in $(cargo fuzz list); do
        echo "-- $target"
        # New inputs go beside the corpus that is kept, not into it.
        found=$(mktemp -d)
        cargo fuzz run "$target" "$found" "fuzz/corpus/$target" -- \
            -max_total_time="$seconds" -max_len=4096 -rss_limit_mb=2048 -timeout=10 -print_final_stats=1 2>&1 |
            grep -E "stat::|Done|ERROR|SUMMARY|panicked|artifact" || { echo "$target failed"; exit 1; }
        rm -rf "$found"
    done
else
    echo "no libFuzzer on this machine: the same checks under seeded mutations"
    HBOT_FUZZ_INPUTS=${FUZZ_INPUTS:-500000} cargo test --release --locked --test fuzz -- --nocapture
fi
