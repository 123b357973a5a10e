#!/usr/bin/env bash
# Installs those of the Debian packages that are missing. A package of another architecture is named PACKAGE:ARCHITECTURE.
# Several scripts can call this at the same time.
#
#     .ci/install.sh [--no-install-recommends] PACKAGE...
set -euo pipefail

options=()
if [ "$1" = --no-install-recommends ]; then
    options+=("$1")
    shift
fi
exec {lock}</var/lib/dpkg
flock "$lock"
missing=()
for package in "$@"; do
    # A name without an architecture matches any, because some packages have the architecture `all`.
    dpkg-query --show --showformat='${db:Status-Status}\n' "$package" 2>/dev/null | grep -qx installed || missing+=("$package")
done
[ ${#missing[@]} -gt 0 ] || exit 0
for package in "${missing[@]}"; do
    [[ $package != *:* ]] || dpkg --add-architecture "${package#*:}"
done
export DEBIAN_FRONTEND=noninteractive
# What a package starts must not keep the lock.
apt-get update -qq {lock}>&-
apt-get install -y -qq "${options[@]}" "${missing[@]}" {lock}>&-
