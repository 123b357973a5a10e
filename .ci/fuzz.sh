#!/usr/bin/env bash
# Fuzzes every decoder for half a minute (FUZZ_SECONDS) by libFuzzer where this machine can build that, and otherwise drives the same
# checks by seeded mutations.
#
#     .ci/fuzz.sh           builds and fuzzes
#     .ci/fuzz.sh --build   only builds
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=${FUZZ_SECONDS:-30}
# Sanitizer flags are unstable; this lets the pinned toolchain take them.
export RUSTC_BOOTSTRAP=1

can_fuzz() {
    command -v g++ >/dev/null || return 1
    cargo fuzz --version >/dev/null 2>&1 || CARGO_PROFILE_DEV_DEBUG=none CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}/tools/build \
        cargo install --quiet --locked --debug cargo-fuzz@0.13.2 || return 1
    cargo fuzz build && return
    # A target that does not compile is a mistake. A machine that cannot build libFuzzer only lacks something.
    cargo check --quiet --locked --manifest-path fuzz/Cargo.toml --package libfuzzer-sys || return 1
    cargo check --quiet --locked --manifest-path fuzz/Cargo.toml || exit 1
    return 1
}

# Writes the requests of hbot-api's golden file as the corpus of the two encodings.
requests() {
    python3 - "$1" <<'PYTHON'
import pathlib, sys
lines = pathlib.Path("crates/hbot-api/src/tests/messages.golden").read_text().splitlines()[1:]
for i, (line, frame) in enumerate(zip(lines[::2], lines[1::2])):
    if '"op":' in line and '"event":' not in line:
        for name, content in ("api_json", line.encode() + b"\n"), ("api_msgpack", bytes.fromhex(frame)):
            path = pathlib.Path(sys.argv[1], name, f"{i:02}")
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(content)
PYTHON
}

# Fuzzes one decoder. Prints its figures only when it is done, because several run at once.
fuzz() {
    local target=$1 found said failed=0 corpus=fuzz/corpus/$1
    [ -d "$corpus" ] || corpus=$requests/$1
    # New inputs go beside the corpus that is kept, not into it.
    found=$(mktemp -d)
    said=$(cargo fuzz run "$target" "$found" "$corpus" -- -max_total_time="$seconds" \
        -max_len=4096 -rss_limit_mb=2048 -timeout=10 -print_final_stats=1 2>&1) || failed=1
    rm -rf "$found"
    printf -- '-- %s\n%s\n' "$target" "$(grep -E 'stat::|Done|ERROR|SUMMARY|panicked|artifact' <<<"$said")"
    [ "$failed" = 0 ] || { printf '%s\n' "$said" | tail -n 40; echo "$target failed"; return 1; }
}

if [ "${1:-}" = --build ]; then
    # Without libFuzzer the seeded mutations are built when they run.
    can_fuzz || true
    exit
fi
if can_fuzz; then
    # One decoder on each processor at a time.
    requests=$(mktemp -d)
    trap 'rm -rf "$requests"' EXIT
    requests "$requests"
    export seconds requests
    export -f fuzz
    cargo fuzz list | xargs -P "$(nproc)" -I{} bash -c 'set -euo pipefail; fuzz "$1"' _ {}
else
    echo "no libFuzzer on this machine: the same checks under seeded mutations"
    HBOT_FUZZ_INPUTS=${FUZZ_INPUTS:-500000} cargo test --release --locked --test fuzz -- --nocapture
fi
