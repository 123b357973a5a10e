#!/usr/bin/env bash
# Builds the image and prints the path of its ELF file. The linker's map is beside it. The compiler is Debian's
# gcc-arm-none-eabi, with libnewlib-arm-none-eabi for memcpy.
set -euo pipefail
cd "$(dirname "$0")"

out=${CARGO_TARGET_DIR:-$(realpath ../..)/target}/mps2-cpp
mkdir -p "$out"
library=../../clients/arduino/HbotLink
cpu=(-mcpu=cortex-m4 -mthumb -mfpu=fpv4-sp-d16 -mfloat-abi=hard)
for source in start board main; do
    arm-none-eabi-g++ "${cpu[@]}" -std=c++11 -O2 -g -ffunction-sections -fdata-sections -fno-exceptions -fno-rtti \
        -fno-threadsafe-statics -ffreestanding -fno-use-cxa-atexit -Wall -Wextra -Wconversion -Wpedantic \
        -Werror -I "$library/src" -I "$library/examples/Loopback" -c "$source.cpp" -o "$out/$source.o"
done
arm-none-eabi-g++ "${cpu[@]}" -nostartfiles --specs=nano.specs -T image.ld -Wl,--gc-sections \
    -Wl,-Map="$out/image.map" "$out/start.o" "$out/board.o" "$out/main.o" -o "$out/image.elf"
echo "$out/image.elf"
