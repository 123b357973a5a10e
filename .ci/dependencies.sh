#!/usr/bin/env bash
# The program of the rig PC links nothing that only the studies need, and without features nothing that only features
# need; what touches motors links nothing that only clients need. No program links what is for tests.
set -euo pipefail
cd "$(dirname "$0")/.."

studies_only=(hbot-study hbot-core-f32 cdshealpix indicatif pulldown-cmark)

# The crates that the program of a package links, one a line. The other arguments are options of cargo.
linked() {
    cargo tree --locked --package "$@" --edges normal --prefix none --format '{p}' | awk '{print $1}' | sort -u
}

# Prints those of the studies' crates that stand in a list.
found() { grep -Fx "$(printf '%s\n' "${studies_only[@]}")" <<<"$1" || true; }

hbot=$(linked hbot)
grep -qFx hbot-server <<<"$hbot" || { echo "hbot does not link hbot-server: is this list its own?" >&2; exit 1; }
wrong=$(found "$hbot")
if [ -n "$wrong" ]; then
    echo "hbot links what only the studies need:" >&2
    echo "$wrong" >&2
    exit 1
fi
echo "hbot links $(wc -l <<<"$hbot") crates, and none of: ${studies_only[*]}"

features_only=(tokio-rustls rustls ring prometheus-client)
wrong=$(grep -Fx "$(printf '%s\n' "${features_only[@]}")" <<<"$hbot" || true)
if [ -n "$wrong" ]; then
    echo "hbot without features links what only features need:" >&2
    echo "$wrong" >&2
    exit 1
fi
echo "hbot without features links none of: ${features_only[*]}"

hbot=$(linked hbot --features full)
for name in "${features_only[@]}"; do
    grep -qFx "$name" <<<"$hbot" || { echo "hbot with all features does not link $name: the check looks for a wrong name" >&2; exit 1; }
done
clients_only=(tokio tokio-rustls rustls prometheus-client hdrhistogram)
host=$(linked hbot-host)
grep -qFx hbot-core <<<"$host" || { echo "hbot-host does not link hbot-core: is this list its own?" >&2; exit 1; }
wrong=$(grep -Fx "$(printf '%s\n' "${clients_only[@]}")" <<<"$host" || true)
if [ -n "$wrong" ]; then
    echo "hbot-host links what only clients need:" >&2
    echo "$wrong" >&2
    exit 1
fi
for name in "${clients_only[@]}"; do
    grep -qFx "$name" <<<"$hbot" || { echo "hbot does not link $name: the check of hbot-host looks for a wrong name" >&2; exit 1; }
done
echo "hbot-host links $(wc -l <<<"$host") crates, and none of: ${clients_only[*]}"

# Who depends on it other than by dev-dependencies, under any feature; a name that does not exist is an error.
tests_only=hbot-testing
users=$(cargo tree --locked --workspace --all-features --invert "$tests_only" --edges normal,build --prefix none --format '{p}' |
    awk '{print $1}' | grep -vFx "$tests_only" || true)
if [ -n "$users" ]; then
    echo "these link $tests_only outside their tests:" >&2
    echo "$users" >&2
    exit 1
fi
echo "no crate links $tests_only outside its tests"

# A name that is written otherwise would pass all of this.
[ "$(found "$(linked hbot-study)" | wc -l)" -eq "${#studies_only[@]}" ] || {
    echo "hbot-study does not link all of: ${studies_only[*]}; the check above looks for wrong names" >&2
    exit 1
}
echo "hbot-study links them all"
