#!/usr/bin/env bash
# Makes the folder ROOT with Debian's base system and systemd, by debootstrap, if it does not exist. try.sh and boot.sh
# work on copies of it. Run it as root.
#
#     contrib/debian/base.sh ROOT
set -euo pipefail
base=$1

[ ! -d "$base" ] || exit 0
debootstrap --variant=minbase --include=systemd,udev bookworm "$base.part" >"$base.log" ||
    { tail "$base.log" >&2; exit 1; }
mv "$base.part" "$base"
