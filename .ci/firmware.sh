#!/usr/bin/env bash
# Builds the firmware images for an emulated board, and checks that they are small enough for a small microcontroller.
# Also tests the check of frames with the small tables that firmware uses. Then a server drives both images, and the example
# Loopback that .ci/arduino.sh has built. These are live rigs, and a busy machine can put them into a fault: run nothing
# else at that time. Needs the server's program, which the tests of the workspace have built.
set -euo pipefail
cd "$(dirname "$0")/.."

# Largest flash and RAM of an image for four joints, in bytes.
most_flash=$((16 * 1024))
most_ram=$((3 * 1024))

packages=(qemu-system-arm gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib
    rustc-web cargo-web rust-web-src libstd-rust-web-dev)
.ci/install.sh "${packages[@]}"

# Adds up the sizes of sections of an ELF file: sizes FILE SECTION...
sizes() {
    local file=$1
    shift
    arm-none-eabi-size -A "$file" | awk -v names="$*" '
        BEGIN { split(names, all); for (i in all) wanted[all[i]] }
        $1 in wanted { sum += $2 }
        END { print sum + 0 }'
}

# Checks the size of an image: check_size ELF STACK_BYTES. Flash has the code, the constants and the initial values of
# variables. Start-up code is counted too.
check_size() {
    local elf=$1 stack=$2 flash ram
    flash=$(sizes "$elf" .vector_table .text .rodata .data)
    ram=$(sizes "$elf" .data .bss .uninit)
    echo "$(basename "$elf"): $flash bytes of flash, $((ram + stack)) of RAM, of which $stack are the stack"
    if [ "$flash" -gt "$most_flash" ] || [ "$((ram + stack))" -gt "$most_ram" ]; then
        echo "at most $most_flash bytes of flash and $most_ram of RAM are permitted" >&2
        return 1
    fi
}

rust=$(firmware/mps2/build.sh)
check_size "$rust" "$(firmware/stack.py "$rust" __euninit _stack_start)"

# The tests of the workspace run with the large table for the CRC. Here are the others.
for features in "" crc-table; do
    cargo test --locked --quiet -p hbot-link --lib --no-default-features --features "$features"
done

cpp=$(firmware/mps2-cpp/build.sh)
python3 tests/firmware/sizes.py "$(dirname "$cpp")/image.map" start.o

target=${CARGO_TARGET_DIR:-target}
export HBOT="${HBOT:-$target/debug/hbot}"
# A spring for a minute on each, with a reset and a pause of the board.
python3 tests/firmware/on_emulator.py "$rust" "$cpp"
python3 tests/firmware/on_terminal.py "$target/arduino/loopback" 10
