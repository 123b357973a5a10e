#!/usr/bin/env bash
# The Arduino library: the vectors of docs/link.md, every duty, a million inputs against hbot-link's decoder, and its
# examples. A server drives the example Loopback in .ci/firmware.sh.
set -euo pipefail
cd "$(dirname "$0")/.."

.ci/install.sh g++ doctest-dev
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
out=$target/arduino
mkdir -p "$out"
build=tests/arduino/build.sh

echo "-- vectors and duties, under the sanitizers, with both tables of the CRC"
for source in main page vectors duties; do
    "$build" "$out/$source.o" -c "tests/arduino/$source.cpp"
done
"$build" "$out/tests" "$out"/{main,page,vectors,duties}.o
"$out/tests" --minimal
"$build" "$out/tests_256" -DHBOT_LINK_CRC_TABLE_256 "$out"/{main,page}.o tests/arduino/vectors.cpp
"$out/tests_256" --minimal

echo "-- each duty taken out"
python3 tests/arduino/taken_out.py "$out"

echo "-- a million inputs through the header and through hbot-link"
"$build" "$out/decoder" tests/arduino/decoder.cpp
HBOT_ARDUINO_DECODER="$out/decoder" HBOT_FUZZ_INPUTS=1000000 \
    cargo test --quiet --workspace --locked --test fuzz -- --ignored --nocapture

echo "-- the examples"
for example in Loopback SimpleFOC HBridge; do
    "$build" "$out/$example.o" -I tests/arduino/board -include Arduino.h \
        -x c++ -c "clients/arduino/HbotLink/examples/$example/$example.ino"
done
"$build" "$out/loopback" -I tests/arduino/board tests/arduino/board/on_terminal.cpp "$out/Loopback.o"
