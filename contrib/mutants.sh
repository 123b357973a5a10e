#!/usr/bin/env bash
# Changes the code of a crate in one place at a time (a mutant), runs the tests, and lists the mutants that no test
# notices. The tests that compare the hash of all outputs do not take part (.cargo/mutants.toml), because they notice
# every change. CONTRIBUTING.md explains how to read the result.
#
#     contrib/mutants.sh CRATE [OPTIONS OF CARGO-MUTANTS...]
#     contrib/mutants.sh hbot-host --file crates/hbot-host/src/rig/motors.rs
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
hbot-core) judges=(hbot-core hbot-testing) targets=(--lib --test core --test golden) ;;
hbot-link) judges=(hbot-link hbot-device) targets=(--lib --tests) ;;
hbot-device) judges=(hbot-device) targets=(--lib --tests) ;;
hbot-host) judges=(hbot-host) targets=(--lib --tests) ;;
hbot-sim) judges=(hbot-sim hbot-testing) targets=(--lib --test sim --test golden) ;;
*) judges=("$crate") targets=(--lib --tests) ;;
esac

# The copies of all runs share one folder of built dependencies.
export CARGO_INCREMENTAL=0 CARGO_PROFILE_DEV_DEBUG=none
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target/mutants/build}
out=$PWD/target/mutants/$crate
mkdir -p "$out"
options=()
for judge in "${judges[@]}"; do options+=("--test-package=$judge"); done
for target in "${targets[@]}"; do options+=("--cargo-test-arg=$target"); done
cargo mutants --package "$crate" --output "$out" "${options[@]}" "$@"
