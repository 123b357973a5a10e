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
built=$(realpath "${HBOT_BUILT:-$target/debug}")
packages=(lintian dpkg-dev groff-base)
[ "${1:-}" != --clean-root ] || packages+=(debootstrap)
.ci/install.sh "${packages[@]}"
[ -n "${HBOT_BUILT:-}" ] || cargo build --workspace --features full --locked --quiet

echo "-- packages"
contrib/package.sh "$built"
# Pages in which man finds a mistake would show it as warnings.
for page in target/deb/*/man/*; do
    warnings=$(LC_ALL=C.UTF-8 groff -man -Tutf8 -ww -z "$page" 2>&1)
    [ -z "$warnings" ] || { echo "$page: $warnings" >&2; exit 1; }
done
lintian --fail-on error --allow-root target/debian/*.deb

echo "-- packages of the last version, where a commit came after it"
copy=$(mktemp -d)
trap 'rm -rf "$copy"' EXIT
git clone --quiet --shared . "$copy"
git -C "$copy" tag "v$("$built/hbot" --version | cut -d ' ' -f 2)"
echo 'name = "Later"' >"$copy/scenes/later.toml"
git -C "$copy" add scenes/later.toml
git -C "$copy" -c user.name=later -c user.email=later@example.org commit --quiet --message later
CARGO_TARGET_DIR=$target "$copy/contrib/package.sh" --last "$built" >/dev/null
(cd "$copy/target/debian" && sha256sum --check --quiet SHA256SUMS)
scenes=$(dpkg --contents "$copy"/target/debian/hbot-panel_*.deb | grep -c 'scenes/.*toml')
[ "$scenes" = "$(git ls-files 'scenes/*.toml' | wc -l)" ] || { echo "$scenes scenes of the last version" >&2; exit 1; }

if [ "${1:-}" = --clean-root ]; then
    echo "-- a clean root"
    contrib/debian/try.sh "$target/tools/bookworm" target/debian/hbot_*.deb
fi

echo "-- crates that are ready to publish"
# Without compiling them: the workspace was just built from the same sources.
cargo publish --dry-run --no-verify --locked --allow-dirty --quiet \
    --package hbot-core --package hbot-link --package hbot-device --package hbot-api

.ci/metrics.sh "$built/hbot"
