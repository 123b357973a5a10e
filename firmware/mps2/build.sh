#!/usr/bin/env bash
# Builds the image and prints the path of its ELF file. The linker's map is beside it. The compiler is Debian's Rust,
# which comes with the sources of its core library: packages rustc-web, cargo-web, rust-web-src, libstd-rust-web-dev (for
# what runs during the build) and gcc-arm-none-eabi (for the linker).
set -euo pipefail
cd "$(dirname "$0")"

out=$(realpath -m "${CARGO_TARGET_DIR:-../../target}")/mps2
mkdir -p "$out"
# RUSTC_BOOTSTRAP permits -Zbuild-std, which builds the core library for this processor. Debian's cargo ignores the
# toolchain that rust-toolchain.toml names. Variables that are meant for the main workspace must not act here.
env -u RUSTFLAGS -u CARGO_BUILD_TARGET -u CARGO_INCREMENTAL RUSTC=/usr/bin/rustc RUSTC_BOOTSTRAP=1 CARGO_TARGET_DIR="$out" \
    /usr/bin/cargo build --release --locked -Zbuild-std=core --quiet \
    --config "target.thumbv7em-none-eabihf.rustflags=['-Clink-arg=-Map=$out/image.map']" >&2
echo "$out/thumbv7em-none-eabihf/release/hbot-mps2"
