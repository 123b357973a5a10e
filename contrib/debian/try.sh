#!/usr/bin/env bash
# Installs the package hbot into a clean root, runs the service's command line as the service's user, and purges the
# package. Fails if anything is left that is neither the base system's nor made by a user. Run it as root.
#
#     contrib/debian/try.sh ROOT PACKAGE.deb
#
# ROOT is a folder with Debian's base system and systemd. base.sh makes it if it does not exist. The script works on a
# copy of it.
set -euo pipefail
base=$1
package=$2

"$(dirname "$0")/base.sh" "$base"

server=
work=$(mktemp -d)
root=$work/root
stop() {
    [ -z "$server" ] || kill "$server" 2>/dev/null || true
    # Nothing is removed through a mount.
    if mountpoint -q "$root/proc"; then umount "$root/proc" || return; fi
    rm -rf --one-file-system "$work"
}
trap stop EXIT
cp -a "$base" "$root"
mount -t proc proc "$root/proc"

fail() { echo "$*" >&2; exit 1; }
inside() { DEBIAN_FRONTEND=noninteractive chroot "$root" "$@"; }
# Waits until a command succeeds, for at most a minute.
eventually() {
    for _ in $(seq 600); do
        if "$@"; then return; fi
        kill -0 "$server" || break
        sleep 0.1
    done
    cat "$work"/server.* >&2
    fail "not within a minute: $*"
}
# Everything in the root that a package can leave behind: files, users and groups. dpkg keeps a log and backups, and
# systemd-analyze, which this script runs, leaves systemd-units-load.
everything() {
    (cd "$root" && find . -path ./proc -prune -o -path ./tmp -prune -o \
        ! -path './var/log/dpkg.log' ! -path './var/lib/dpkg/*-old' ! -path './var/cache/*' \
        ! -path './etc/*-' ! -path './etc/.pwd.lock' ! -path './run/systemd/systemd-units-load' -print)
    cat "$root"/etc/{passwd,group,shadow,gshadow}
}
install_package() {
    cp "$package" "$root/tmp/hbot.deb"
    inside dpkg --install /tmp/hbot.deb >"$work/dpkg" 2>&1 || { cat "$work/dpkg" >&2; exit 1; }
    rm "$root/tmp/hbot.deb"
}
purge() { inside dpkg --purge hbot >"$work/dpkg" 2>&1 || { cat "$work/dpkg" >&2; exit 1; }; }
unit_value() { sed -n "s/^$1=//p" "$root/usr/lib/systemd/system/hbot.service"; }

echo "-- install"
everything | sort >"$work/before"
install_package
[ -n "$(inside getent passwd hbot)" ] || fail "there is no user hbot"
for group in dialout realtime; do
    inside id -nG hbot | grep -qw "$group" || fail "the user hbot is not in the group $group"
done
[ -z "$(find "$root/etc/systemd/system" -name hbot.service)" ] || fail "the service is enabled without being asked"
inside systemd-analyze verify --man=no /usr/lib/systemd/system/hbot.service
inside systemd-analyze security --offline=true --threshold=20 /usr/lib/systemd/system/hbot.service |
    tail -n 1

echo "-- run the service's command line as the user $(unit_value User)"
sed 's/^listen = .*/listen = "127.0.0.1:0"/' rigs/prototype.toml >"$root/etc/hbot/rig.toml"
# What systemd does before it starts the service: StateDirectory, the limits, the user and its groups, no capabilities.
inside install -d -o hbot -g hbot -m 0750 "/var/lib/$(unit_value StateDirectory)"
limits=(prlimit --rtprio="$(unit_value LimitRTPRIO)" --memlock=unlimited)
"${limits[@]}" true 2>/dev/null || { echo "this machine refuses the limits of the unit: the loop runs without them"; limits=(); }
: >"$work/server.out" >"$work/server.log"
"${limits[@]}" chroot "$root" setpriv --reuid "$(unit_value User)" --regid "$(unit_value Group)" --init-groups \
    --no-new-privs --bounding-set=-all --inh-caps=-all \
    env -i "$(unit_value Environment)" sh -c "umask 077; exec $(unit_value ExecStart)" \
    >"$work/server.out" 2>"$work/server.log" &
server=$!
address() { grep -ohE '127\.0\.0\.1:[1-9][0-9]*' "$work/server.out" "$work/server.log" | head -n 1; }
listening() { [ -n "$(address)" ]; }
eventually listening
grep -E '^Uid' "/proc/$server/status" | grep -qw "$(inside id -u hbot)" || fail "the server runs as another user"
grep -qE '^CapEff:\s+0+$' "/proc/$server/status" || fail "the server has capabilities"
inside hbot estop --server "$(address)"
logged() { [ -n "$(find "$root/var/lib/hbot/hbot/flight" -name '*-estop.csv' 2>/dev/null)" ]; }
eventually logged
kill -TERM "$server"
wait "$server" || fail "the server ended with $?"
server=

echo "-- purge keeps what a user made"
touch "$root/var/lib/hbot/run.mcap" "$root/var/lib/hbot/hbot/flight/flight-plan.csv"
purge
everything | sort >"$work/after"
diff <(comm -13 "$work/before" "$work/after" | grep '^\./') - <<END
./etc/hbot
./etc/hbot/rig.toml
./var/lib/hbot
./var/lib/hbot/hbot
./var/lib/hbot/hbot/flight
./var/lib/hbot/hbot/flight/flight-plan.csv
./var/lib/hbot/run.mcap
END
[ -n "$(inside getent passwd hbot)" ] || fail "files are kept, but their user is gone"

echo "-- purge leaves nothing else"
rm -r "$root/etc/hbot" "$root/var/lib/hbot"
install_package
purge
everything | sort >"$work/after"
diff "$work/before" "$work/after" || fail "something is left, or missing"
echo "installed, run and purged; nothing is left"
