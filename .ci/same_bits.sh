#!/usr/bin/env bash
# The control law computes the same bits on three machines: a microcontroller (Cortex-M4F, in QEMU), arm64 (in QEMU) and
# this one. Each runs firmware/core-hash, which hashes all outputs of a recorded run in f32 and in f64.
# `cargo test --test core same_bits` compares the hashes of this machine with the expected ones.
set -euo pipefail
cd "$(dirname "$0")/.."

# Debian's Rust builds for both emulated machines; the pinned toolchain has no other targets.
packages=(qemu-system-arm qemu-user-static gcc-arm-none-eabi gcc-aarch64-linux-gnu libc6-dev-arm64-cross
    rustc-web cargo-web rust-web-src libstd-rust-web-dev libstd-rust-web-dev:arm64)
.ci/install.sh "${packages[@]}"

target="$(realpath "${CARGO_TARGET_DIR:-target}")/core-hash"
cd firmware/core-hash
debian() { RUSTC=/usr/bin/rustc /usr/bin/cargo "$@" --release --locked --quiet --target-dir "$target"; }

declare -A hashes
hashes["this machine"]=$(cargo run --release --locked --quiet --target-dir "$target/host")
hashes["arm64"]=$(debian run --target aarch64-unknown-linux-gnu)
hashes["Cortex-M4F"]=$(RUSTC_BOOTSTRAP=1 debian run --target thumbv7em-none-eabihf -Zbuild-std=core)

# The program fails if a hash is not the expected one. A machine that printed nothing would pass that.
for machine in "${!hashes[@]}"; do
    printf '%s:\n%s\n' "$machine" "${hashes[$machine]}"
    [ "${hashes[$machine]}" = "${hashes["this machine"]}" ]
    [ "$(grep -cE '^f(32|64)( 0x[0-9A-F]{16}){2}$' <<<"${hashes[$machine]}")" = 2 ]
done
echo "the same bits on three machines"
