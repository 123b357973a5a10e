#!/usr/bin/env python3
"""Prints the licences of all libraries from crates.io that a program of the workspace with all features contains.

    contrib/licences.py hbot

Each library is listed with its version and the licence that its manifest names. The texts of its licence files follow,
each distinct text once. Exits with 1 if a library names no licence.
"""

import hashlib
import json
import pathlib
import subprocess
import sys


def cargo(*arguments):
    return subprocess.run(["cargo", *arguments], check=True, capture_output=True, text=True).stdout


def main(package):
    tree = cargo("tree", "--locked", "--package", package, "--features", "full", "--edges", "normal", "--prefix", "none", "--format", "{p}")
    linked = {tuple(line.split()[:2]) for line in tree.splitlines()}
    metadata = json.loads(cargo("metadata", "--locked", "--format-version", "1"))
    crates = [crate for crate in metadata["packages"]
              if crate["source"] and (crate["name"], "v" + crate["version"]) in linked]
    texts, users = {}, {}
    for crate in sorted(crates, key=lambda crate: (crate["name"], crate["version"])):
        name = f"{crate['name']} {crate['version']}"
        if not (crate["license"] or crate["license_file"]):
            sys.exit(f"{name} names no licence")
        print(f"{name}: {crate['license'] or crate['license_file']}")
        folder = pathlib.Path(crate["manifest_path"]).parent
        for file in sorted(folder.iterdir()):
            if file.is_file() and file.name.upper().startswith(("LICENSE", "LICENCE", "COPYING", "NOTICE", "UNLICENSE")):
                text = file.read_text(encoding="utf-8", errors="replace").strip()
                digest = hashlib.sha256(" ".join(text.split()).encode()).hexdigest()
                texts.setdefault(digest, text)
                users.setdefault(digest, []).append(name)
    for digest, text in texts.items():
        print(f"\n{'=' * 80}\n{', '.join(dict.fromkeys(users[digest]))}\n{'=' * 80}\n\n{text}")


if __name__ == "__main__":
    main(*sys.argv[1:])
