#!/usr/bin/env bash
# Changes the code of a crate in one place at a time (a mutant), runs the tests, and lists the mutants that no test
# notices. The tests that compare the hash of all outputs do not take part (.cargo/mutants.toml), because they notice
# every change. docs/reliability.md explains how to read the result.
#
#     contrib/mutants.sh CRATE [OPTIONS OF CARGO-MUTANTS...]
#     contrib/mutants.sh hbot-host --file crates/hbot-host/src/motors.rs
#     contrib/mutants.sh hbot-core --shard 0/8
#
# A whole crate takes hours: one build and one run of the tests for each mutant. --shard K/N runs every N-th mutant, so
# that several machines can share the work. The result is in target/mutants/CRATE/mutants.out: missed.txt lists the mutants
# that no test noticed. The script fails if there is one. It needs cargo-mutants (cargo install --locked cargo-mutants).
set -euo pipefail
cd "$(dirname "$0")/.."
crate=${1:?which crate? for example hbot-core}
shift

# Which tests judge a crate: those of the packages that name its behaviour.
case $crate in
hbot-core) judges=(hbot-core hbot) targets=(--lib --test core --test golden) ;;
hbot-link) judges=(hbot-link hbot-device) targets=(--lib --tests) ;;
hbot-device) judges=(hbot-device) targets=(--lib --tests) ;;
hbot-host) judges=(hbot-host) targets=(--lib --tests) ;;
*) judges=("$crate") targets=(--lib --tests) ;;
esac

# The root package depends on all crates, and its tests build its program. For hbot-core that would be built anew for each
# mutant. So these tests run in a copy of the workspace that contains only what they need.
small_workspace() {
    local tree=$1
    rm -rf "$tree"
    mkdir -p "$tree"/{crates,src,firmware/core-hash}
    # The copies are newer than everything that is built, so nothing of an earlier run, with its mutants, is taken for new.
    cp -r .cargo Cargo.lock rust-toolchain.toml rigs scenes tests "$tree"
    cp -r firmware/core-hash/src "$tree/firmware/core-hash"
    for room in core core-f32 config link device sim testing; do cp -r "crates/hbot-$room" "$tree/crates"; done
    touch "$tree/src/lib.rs"
    sed -E '/^\[package\]/,$d; s/^members = .*/members = ["crates\/*"]/; /^(default-members|exclude) /d
        /^hbot-(api|host|server|record|plot|study) /d' Cargo.toml >"$tree/Cargo.toml"
    cat >>"$tree/Cargo.toml" <<'MANIFEST'
[package]
name = "hbot"
version.workspace = true
edition.workspace = true
autotests = false

[[test]]
name = "core"
path = "tests/core/main.rs"

[[test]]
name = "golden"
path = "tests/golden.rs"

[dependencies]
hbot-core.workspace = true

[dev-dependencies]
hbot-config.workspace = true
hbot-core-f32.workspace = true
hbot-sim.workspace = true
hbot-testing.workspace = true
libm.workspace = true
oorandom.workspace = true
proptest.workspace = true
serde.workspace = true
serde_json.workspace = true
MANIFEST
    # The feature `server` of hbot-testing needs crates that are not there.
    sed -i -E 's/^server = .*/server = []/; /^(hbot-host|hbot-server|tokio) /d' "$tree/crates/hbot-testing/Cargo.toml"
}

# The copies of all runs share one folder of built dependencies.
export CARGO_INCREMENTAL=0 CARGO_PROFILE_DEV_DEBUG=none
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target/mutants/build}
out=$PWD/target/mutants/$crate
mkdir -p "$out"
options=()
for judge in "${judges[@]}"; do options+=("--test-package=$judge"); done
for target in "${targets[@]}"; do options+=("--cargo-test-arg=$target"); done
if [ "$crate" = hbot-core ]; then
    # Its own copy for each run, so that several shards can run on one machine.
    tree=$(mktemp -d)
    trap 'rm -rf "$tree"' EXIT
    small_workspace "$tree"
    options+=("--dir=$tree" --in-place)
fi
cargo mutants --package "$crate" --output "$out" "${options[@]}" "$@"
