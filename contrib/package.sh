#!/usr/bin/env bash
# Makes the Debian packages hbot and hbot-panel in target/debian. It needs cargo-deb (`cargo install cargo-deb`), dpkg-dev
# and Python. docs/install.md describes the packages.
#
#     contrib/package.sh               builds both programs with all features and all optimisation first
#     contrib/package.sh target/debug  takes the programs from this folder; build them with `--features full`
set -euo pipefail
cd "$(dirname "$0")/.."

if [ $# -gt 0 ]; then
    built=$(realpath "$1")
else
    cargo build --release --locked --package hbot --package hbot-gui --features full
    built=$(realpath "${CARGO_TARGET_DIR:-target}")/release
fi

# cargo-deb takes programs from the folder `release` of a target folder.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/release"
ln -s "$built/hbot" "$built/hbot-gui" "$work/release"

rm -rf target/deb
mkdir -p target/deb/hbot/man target/deb/hbot-panel/man target/debian
"$built/hbot" man target/deb/hbot/man
"$built/hbot-gui" --man >target/deb/hbot-panel/man/hbot-gui.1
for shell in bash zsh fish; do
    "$built/hbot" completions "$shell" >"target/deb/hbot/hbot.$shell"
    "$built/hbot-gui" --completions "$shell" >"target/deb/hbot-panel/hbot-gui.$shell"
done
contrib/licences.py hbot | gzip -9n >target/deb/hbot/licences.gz
contrib/licences.py hbot-gui | gzip -9n >target/deb/hbot-panel/licences.gz

# Equal sources and compilers give equal packages: files carry the time of the last change.
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct 2>/dev/null || date +%s)
export SOURCE_DATE_EPOCH
rm -f target/debian/*.deb
for package in hbot hbot-gui; do
    CARGO_TARGET_DIR=$work cargo deb --quiet --locked --no-build --strip --package "$package" --output "$PWD/target/debian/"
done
ls -l target/debian/*.deb
