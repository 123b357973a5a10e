"""Uses the installed package in an environment without any other package, as .ci/python.sh does."""

from __future__ import annotations

import importlib
import sys
import tempfile
from pathlib import Path

from serving import SCENES, Server

import hbot


def main() -> None:
    """Start a server and render on it."""
    package = Path(hbot.__file__).parent
    assert package.is_relative_to(sys.prefix), f"{package} is not the installed package"
    assert (package / "py.typed").exists(), "type checkers find the types"
    said = ""
    try:
        importlib.import_module("hbot.mcap")
    except hbot.MissingExtra as missing:
        said = str(missing)
    assert "pip install './clients/python[mcap]'" in said, "an extra that is missing is named"
    with tempfile.TemporaryDirectory() as folder:
        server = Server(Path(folder))
        try:
            with hbot.connect(server.address, name="installed") as rig, rig.lease():
                rig.load_scene(SCENES / "spring.toml")
                rig.enable()
                done = rig.render(lambda state: [-0.01 * w for w in state.omega], duration=0.2)
                rig.disable()
        finally:
            server.kill()
    assert done.calls > 0
    print(f"installed in {package}: {done}")


if __name__ == "__main__":
    main()
