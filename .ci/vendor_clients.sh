#!/usr/bin/env bash
# The vendors' own clients drive the virtual motor controllers over a pseudo-terminal, and their encoders still make the vectors
# that the drivers are tested against. Installs what it needs into a venv that it throws away.
set -euo pipefail
cd "$(dirname "$0")/.."

python3 -c 'import ensurepip' 2>/dev/null || .ci/install.sh python3-venv
folder=$(mktemp -d)
served=
trap 'exec 3>&- || true; [ -z "$served" ] || wait "$served" || true; rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet moteus==1.1.1 cantools==45.1.0 python-can==4.6.1 pyserial==3.5
# Of this one the DBC alone is used: its own dependencies are not needed.
"$folder/venv/bin/pip" install --quiet --no-deps odrive-can==2.1.0

"$folder/venv/bin/python" tests/vendor/make_moteus_vectors.py >"$folder/moteus.json"
cmp "$folder/moteus.json" tests/vendor/moteus.json
"$folder/venv/bin/python" tests/vendor/make_odrive_vectors.py >"$folder/odrive.json"
cmp "$folder/odrive.json" tests/vendor/odrive.json

# The tests of the workspace have built it. A build of it alone has other features and compiles most packages anew.
hbot="${CARGO_TARGET_DIR:-target}/debug/hbot"
[ -x "$hbot" ] || { echo "$hbot is missing: cargo build --features full" >&2; exit 1; }

# Serves virtual controllers that speak $1 and has the client $2 drive them.
drive() {
    mkfifo "$folder/$1.in"
    "$hbot" controllers --protocol "$1" <"$folder/$1.in" >"$folder/$1.out" &
    served=$!
    exec 3>"$folder/$1.in"
    while [ ! -s "$folder/$1.out" ]; do
        kill -0 "$served" || { echo "the virtual controllers have ended"; exit 1; }
        sleep 0.1
    done
    echo "-- the vendor's client on virtual $1 controllers"
    timeout 120 "$folder/venv/bin/python" "$2" "$(cat "$folder/$1.out")"
    exec 3>&-
    wait "$served"
    served=
}

drive moteus tests/vendor/moteus_client.py
drive odrive tests/vendor/odrive_client.py
