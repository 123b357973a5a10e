#!/usr/bin/env bash
# The client for C and C++: it is installed into an empty folder and used from there, by pkg-config, by CMake and
# statically. Examples and tests are compiled with all warnings as errors and with the sanitizers for addresses and
# undefined behaviour, run against a server, and survive its death.
set -euo pipefail
cd "$(dirname "$0")/.."

.ci/install.sh build-essential cmake pkg-config

# What the tests of the workspace have built, so that nothing is compiled with a second set of features. HBOT_BUILT
# names a folder with the libraries and the program, if they are there already.
if [ -n "${HBOT_BUILT:-}" ]; then
    target=$HBOT_BUILT
else
    target=${CARGO_TARGET_DIR:-$PWD/target}/debug
    cargo test --workspace --no-run --locked --quiet
fi
built=$target
[ -e "$built/libhbot_c.so" ] || built=$target/deps

work=$(mktemp -d)
server=
stop() {
    if [ -n "$server" ]; then
        kill -9 "$server" 2>/dev/null || true
        wait "$server" 2>/dev/null || true
        server=
    fi
}
trap 'stop; rm -rf "$work"' EXIT

# Waits until a command succeeds, for at most a minute.
eventually() {
    for _ in $(seq 600); do
        if "$@"; then return; fi
        sleep 0.1
    done
    echo "not within a minute: $*" >&2
    exit 1
}

# The web port stands in another line.
listening() { address=$(grep listen "$work/server.log" | grep -oE '127\.0\.0\.1:[0-9]+' | head -n 1) && [ -n "$address" ]; }

cp rigs/prototype.toml "$work/rig.toml"
serve() {
    stop
    : >"$work/server.log"
    XDG_STATE_HOME=$work "$target/hbot" server --rig "$work/rig.toml" --listen 127.0.0.1:0 "$@" >"$work/server.log" 2>&1 &
    server=$!
    eventually listening
}

echo "-- install"
cmake -S clients/c -B "$work/build" -DHBOT_BUILT="$built" >/dev/null
cmake --install "$work/build" --prefix "$work/prefix" >/dev/null
export PKG_CONFIG_PATH=$work/prefix/lib/pkgconfig LD_LIBRARY_PATH=$work/prefix/lib
readelf -d "$work/prefix/lib/libhbot.so" | grep -q 'SONAME.*\[libhbot.so.0.1\]'
cflags=$(pkg-config --cflags hbot)
libs=$(pkg-config --libs hbot)

echo "-- compile"
checks="-Wall -Wextra -Werror -pedantic -g -fsanitize=address,undefined -fno-sanitize-recover=all"
c=clients/c
gcc -std=c11 $checks $cflags $c/examples/first_feel.c $libs -o "$work/first_feel" &
g++ -std=c++17 $checks $cflags $c/examples/damper.cpp $libs -o "$work/damper" &
g++ -std=c++17 $checks $cflags $c/tests/contract.cpp $libs -o "$work/contract" &
g++ -std=c++17 $checks $cflags -I$c/chai3d/declarations -I$c/chai3d -I$c/tests \
    $c/chai3d/CHbotDevice.cpp $c/tests/chai3d.cpp $libs -o "$work/chai3d" &
gcc -std=c11 $checks $cflags $c/examples/first_feel.c "$work/prefix/lib/libhbot.a" \
    $(pkg-config --static --libs hbot | sed 's/-lhbot//') -o "$work/first_feel_static" &
for _ in 1 2 3 4 5; do wait -n; done
if ldd "$work/first_feel_static" | grep -q hbot; then
    echo "the static program needs the shared library" >&2
    exit 1
fi

echo "-- find_package"
mkdir "$work/user"
cat >"$work/user/CMakeLists.txt" <<END
cmake_minimum_required(VERSION 3.20)
project(user LANGUAGES C CXX)
find_package(hbot 0.1 REQUIRED)
add_executable(shared $PWD/$c/examples/damper.cpp)
target_compile_features(shared PRIVATE cxx_std_17)
target_link_libraries(shared hbot::hbot)
add_executable(static $PWD/$c/examples/first_feel.c)
target_link_libraries(static hbot::static)
END
cmake -S "$work/user" -B "$work/user/build" -DCMAKE_PREFIX_PATH="$work/prefix" >/dev/null
cmake --build "$work/user/build" >/dev/null

echo "-- run"
# Runs a program with the address of a fresh server.
run() {
    serve
    "$1" "$address" "${@:2}" || { cat "$work/server.log" >&2; exit 1; }
}
run "$work/contract"
run "$work/chai3d"
run "$work/first_feel" 1
run "$work/first_feel_static" 1
run "$work/damper" 2
run "$work/user/build/shared" 0.2
run "$work/user/build/static" 0.2

echo "-- the first programs of the page"
# Compiles the first block of the page in a language, with the address of the server, and runs it. It must print nothing.
page() {
    awk -v fence="\`\`\`$2" '$0 == fence { on = 1; next } /^```/ { if (on) exit } on' $c/README.md |
        sed "s/127.0.0.1:4268/$1/" >"$work/page.$2"
    grep -q "$1" "$work/page.$2" || return 1
    local compiler=(g++ -std=c++17)
    [ "$2" = cpp ] || compiler=(gcc -std=c11)
    "${compiler[@]}" $checks $cflags "$work/page.$2" $libs -o "$work/page_$2" || return 1
    local printed
    printed=$("$work/page_$2" </dev/null 2>&1) && [ -z "$printed" ] || { echo "the page's program in $2: $printed" && return 1; }
}
page_c() { page "$1" c; }
page_cpp() { page "$1" cpp; }
run page_c
run page_cpp

echo "-- the server is killed in the middle"
# Runs a program, kills the server when it has printed its first line, and looks how it ends: with
# 1 and the reason, not by a signal, by a sanitizer or after a wait.
killed() {
    serve
    "$@" "$address" 600 >"$work/out" 2>"$work/err" &
    local program=$!
    eventually test -s "$work/out"
    stop
    local result=0
    wait "$program" || result=$?
    echo "$(basename "$1"): exit code $result, $(cat "$work/err")"
    [ "$result" -eq 1 ] && grep -Eq '^(closed|io): ' "$work/err" && [ "$(wc -l <"$work/err")" -eq 1 ]
}
killed "$work/first_feel"
killed "$work/damper"

echo "-- an encrypted server with a token"
openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=rig \
    -addext subjectAltName=DNS:rig.local -keyout "$work/rig.key" -out "$work/rig.pem" 2>/dev/null
printf 'a token of more than sixteen bytes\n' >"$work/token"
chmod 600 "$work/token" "$work/rig.key"
sed -i '/^\[api\]/a tls = { certificate = "rig.pem", key = "rig.key" }' "$work/rig.toml"
g++ -std=c++17 $checks $cflags $c/tests/secure.cpp $libs -o "$work/secure"
serve --token-file "$work/token"
"$work/secure" "$address" "$work/rig.pem" "$(cat "$work/token")"
