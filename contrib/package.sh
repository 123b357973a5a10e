#!/usr/bin/env bash
# Makes the Debian packages hbot and hbot-panel in target/debian. It needs dpkg-dev and Python, and installs cargo-deb into
# target/tools if there is none. docs/install.md describes the packages.
#
#     contrib/package.sh               builds both programs with all features and all optimisation first
#     contrib/package.sh target/debug  takes the programs from this folder; build them with `--features full`
#     contrib/package.sh --last        does the first with the last version, the newest tag v* before the present commit,
#                                      and adds SHA256SUMS. A folder after it is taken as above
set -euo pipefail
cd "$(dirname "$0")/.."

version() { sed -n '/^\[workspace.package\]/,/^$/s/^version = "\(.*\)"/\1/p' "$1/Cargo.toml"; }
fail() { echo "$*" >&2; exit 1; }
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")

if [ "${1:-}" = --last ]; then
    shift
    tag=$(git describe --tags --abbrev=0 --match 'v[0-9]*' 2>/dev/null) ||
        fail "no version has a tag yet; the present one gets its tag by: git tag v$(version .)"
    tree=$(mktemp -d)
    trap 'rm -rf "$tree"' EXIT
    git -c advice.detachedHead=false clone --quiet --depth 1 --branch "$tag" "file://$PWD" "$tree"
    [ "v$(version "$tree")" = "$tag" ] || fail "the tag $tag is on version $(version "$tree") of Cargo.toml"
    [ $# -eq 0 ] || set -- "$(realpath "$1")"
    CARGO_TARGET_DIR=$target "$tree/contrib/package.sh" "$@"
    mkdir -p target/debian
    rm -f target/debian/*
    cp "$tree"/target/debian/*.deb target/debian/
    cd target/debian
    sha256sum -- *.deb | tee SHA256SUMS
    exit
fi

if [ $# -gt 0 ]; then
    built=$(realpath "$1")
else
    cargo build --release --locked --package hbot --package hbot-gui --features full
    built=$target/release
fi
for program in hbot hbot-gui; do
    said=$("$built/$program" --version)
    [ "$said" = "$program $(version .)" ] || fail "$built/$program is $said, and the sources are version $(version .)"
done

export PATH=$PATH:$target/tools/bin
command -v cargo-deb >/dev/null || CARGO_PROFILE_DEV_DEBUG=none CARGO_TARGET_DIR=$target/tools/build \
    cargo install cargo-deb --version 3.8.0 --locked --debug --no-default-features --quiet --root "$target/tools"

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
    # The script calls the program as it is called here: by its name.
    (exec -a hbot "$built/hbot" completions "$shell") >"target/deb/hbot/hbot.$shell"
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
