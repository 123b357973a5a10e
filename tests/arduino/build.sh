#!/usr/bin/env bash
# Builds a C++ program of these tests against the header: build.sh OUTPUT SOURCE... [FLAG...]
# HEADER_FOLDER names another folder with HbotLink.h, for a header that was changed on purpose.
set -euo pipefail
cd "$(dirname "$0")/../.."

output=$1
shift
g++ -std=c++11 -O1 -g -Wall -Wextra -Wconversion -Wsign-conversion -Wpedantic -Werror \
    -fsanitize=address,undefined -fno-sanitize-recover=all \
    -I "${HEADER_FOLDER:-clients/arduino/HbotLink/src}" -DLINK_PAGE="\"$PWD/docs/link.md\"" "$@" -o "$output"
