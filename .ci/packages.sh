#!/usr/bin/env bash
# The Debian packages: made from the programs that the tests have built, and checked by lintian. Then the crates that are
# ready to publish, and the metrics page. HBOT_BUILT names a folder with the programs hbot and hbot-gui, if they are
# built already.
#
#     .ci/packages.sh                 what .ci/run does
#     .ci/packages.sh --clean-root    also installs, runs and purges hbot in a clean root. That takes a minute more, and
#                                     needs the right to mount, which a container may not have
set -euo pipefail
cd "$(dirname "$0")/.."

target=${CARGO_TARGET_DIR:-$PWD/target}
built=${HBOT_BUILT:-$target/debug}
packages=(lintian dpkg-dev groff-base)
[ "${1:-}" != --clean-root ] || packages+=(debootstrap)
.ci/install.sh "${packages[@]}"
export PATH=$PATH:$target/tools/bin
command -v cargo-deb >/dev/null || CARGO_PROFILE_DEV_DEBUG=none CARGO_TARGET_DIR=$target/tools/build \
    cargo install cargo-deb --version 3.8.0 --locked --debug --no-default-features --quiet --root "$target/tools"
[ -n "${HBOT_BUILT:-}" ] || cargo build --workspace --features full --locked --quiet

echo "-- packages"
contrib/package.sh "$built"
# Pages in which man finds a mistake would show it as warnings.
for page in target/deb/*/man/*; do
    warnings=$(LC_ALL=C.UTF-8 groff -man -Tutf8 -ww -z "$page" 2>&1)
    [ -z "$warnings" ] || { echo "$page: $warnings" >&2; exit 1; }
done
lintian --fail-on error --allow-root target/debian/*.deb

if [ "${1:-}" = --clean-root ]; then
    echo "-- a clean root"
    contrib/debian/try.sh "$target/tools/bookworm" target/debian/hbot_*.deb
fi

echo "-- crates that are ready to publish"
# Without compiling them: the workspace was just built from the same sources.
cargo publish --dry-run --no-verify --locked --allow-dirty --quiet \
    --package hbot-core --package hbot-link --package hbot-device --package hbot-api

.ci/metrics.sh "$built/hbot"
