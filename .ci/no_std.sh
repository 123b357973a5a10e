#!/usr/bin/env bash
# The core and the link need neither the standard library nor an allocator nor a C library: a static program made of
# them runs, and its symbol table has none of the three. Also builds both for a microcontroller where that target is installed.
set -euo pipefail
cd "$(dirname "$0")/.."

proof=tests/no_std
build="$(realpath "${CARGO_TARGET_DIR:-$proof/target}")/no_std"
binary="$build/x86_64-unknown-linux-gnu/release/hbot-no-std"
binary_with_heap="$build/heap/x86_64-unknown-linux-gnu/release/hbot-no-std"

# Names that only an allocator, a C library or the standard library has.
allocator='(^|_)(malloc|calloc|realloc|free|aligned_alloc|posix_memalign|rust_alloc|rust_dealloc|rust_realloc|rust_alloc_zeroed|rg_alloc|rdl_alloc)$|__rust_no_alloc_shim|exchange_malloc'
libc='^(printf|puts|abort|exit|_exit|errno|__errno_location|strlen|write|read|mmap|brk|sbrk|pthread_.*|__libc_.*|_IO_.*|__cxa_.*|_Unwind_.*)(@.*)?$'
library='(^|[^:[:alnum:]_])(std|alloc)::'

# Says what is wrong with a binary; fails if anything is.
inspect() {
    local file=$1 wrong=0 found
    # What links Rust's names to people's, and the bare names of everything else.
    found=$(nm "$file" | awk '{print $NF}' | grep -E "$allocator|$libc" || true)
    [ -z "$found" ] || { echo "symbols of an allocator or the C library:"; echo "$found"; wrong=1; }
    found=$(nm -C "$file" | grep -E "$library" || true)
    [ -z "$found" ] || { echo "symbols of the standard library:"; echo "$found"; wrong=1; }
    found=$(nm -u "$file")
    [ -z "$found" ] || { echo "undefined symbols:"; echo "$found"; wrong=1; }
    if readelf --program-headers --wide "$file" | grep -E 'INTERP|DYNAMIC'; then
        echo "not static: it asks for an interpreter or a dynamic section"
        wrong=1
    fi
    # A program without names would pass all of this.
    found=$(nm -C "$file" | grep -c 'hbot_core::' || true)
    [ "$found" -gt 0 ] || { echo "no symbol of hbot_core: is it stripped?"; wrong=1; }
    return "$wrong"
}

echo "building and running $binary"
# From its own folder, whose .cargo/config.toml says how to link.
(cd "$proof" && cargo build --release --locked --target-dir "$build")
"$binary"
inspect "$binary"
echo "runs and exits with 0; $(stat -c %s "$binary") bytes, $(nm "$binary" | wc -l) symbols, static, no std, no allocator, no libc"

echo "the same program with one allocation must be noticed"
(cd "$proof" && cargo build --release --locked --target-dir "$build/heap" --features heap)
"$binary_with_heap"
if inspect "$binary_with_heap"; then
    echo "an allocation went unnoticed: the check above proves nothing" >&2
    exit 1
fi
echo "noticed"

mcu=thumbv7em-none-eabihf
if [ -d "$(rustc --print target-libdir --target "$mcu")" ]; then
    cargo build --locked --package hbot-core --package hbot-device --target "$mcu"
    echo "builds for $mcu"
else
    echo "$mcu is not installed here: not built for it (rustup target add $mcu)"
fi
