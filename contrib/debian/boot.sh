#!/usr/bin/env bash
# Boots systemd in a container, and lets it start, restart and stop the service of the package hbot, on the simulated
# rig. Run it as root, with systemd-container and debootstrap installed.
#
#     contrib/debian/boot.sh ROOT PACKAGE.deb
#
# ROOT is a folder with Debian's base system and systemd, as for try.sh. base.sh makes it if it does not exist. The
# script works on a copy of it.
set -euo pipefail
base=$1
package=$2

"$(dirname "$0")/base.sh" "$base"
work=$(mktemp -d)
root=$work/root
trap 'rm -rf --one-file-system "$work"' EXIT
cp -a "$base" "$root"
cp "$package" "$root/tmp/hbot.deb"
chroot "$root" dpkg --install /tmp/hbot.deb >"$work/dpkg" 2>&1 || { cat "$work/dpkg" >&2; exit 1; }
cp rigs/prototype.toml "$root/etc/hbot/rig.toml"

# What runs inside, after the boot. Its last line says that it came to its end.
cat >"$root/usr/local/bin/trial" <<'TRIAL'
#!/bin/bash
exec >/trial.log 2>&1
set -euo pipefail
of() { systemctl show hbot --value --property="$1"; }
is() { [ "$(of "$1")" = "$2" ] || { echo "$1 is $(of "$1"), not $2"; false; }; }
eventually() { for _ in $(seq 100); do if "$@" >/dev/null 2>&1; then return; fi; sleep 0.1; done; "$@"; }
logged() { [ -n "$(find /var/lib/hbot/hbot/flight -name '*-estop.csv')" ]; }
trap 'journalctl --unit hbot --no-pager | tail -n 20; systemctl start --no-block poweroff.target' EXIT

echo "-- start"
systemctl start hbot
eventually hbot info
grep -E '^(Uid|CapEff|NoNewPrivs|Seccomp):' "/proc/$(of MainPID)/status"
hbot estop
eventually logged
echo "-- systemd starts it again after a kill"
kill -KILL "$(of MainPID)"
eventually is NRestarts 1
eventually hbot info
echo "-- stop"
systemctl stop hbot
is Result success
is ExecMainStatus 0
echo "-- without a rig file it does not start"
rm /etc/hbot/rig.toml
systemctl start hbot
is ConditionResult no
is ActiveState inactive
systemd-analyze security hbot --no-pager | tail -n 1
dpkg --purge hbot
[ -z "$(systemctl list-unit-files --no-legend 'hbot*')" ]
trap - EXIT
echo "started, restarted, stopped and purged"
systemctl start --no-block poweroff.target
TRIAL
chmod +x "$root/usr/local/bin/trial"
cat >"$root/etc/systemd/system/trial.service" <<'UNIT'
[Unit]
After=multi-user.target
[Service]
Type=oneshot
ExecStart=/usr/local/bin/trial
UNIT
mkdir -p "$root/etc/systemd/system/multi-user.target.wants"
ln -s ../trial.service "$root/etc/systemd/system/multi-user.target.wants/trial.service"

timeout 180 systemd-nspawn --quiet --directory="$root" --boot --keep-unit --register=no >"$work/boot" 2>&1 ||
    { tail -n 20 "$work/boot" >&2; exit 1; }
cat "$root/trial.log"
grep -q "^started, restarted, stopped and purged" "$root/trial.log"
