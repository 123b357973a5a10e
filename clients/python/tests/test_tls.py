"""Encryption: which servers a client trusts, and what it says if it does not."""

from __future__ import annotations

import asyncio
import ssl
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from serving import Server

import hbot
from hbot.wire import Encoding

TOKEN = "a token that is long enough"


def openssl(folder: Path, arguments: str) -> None:
    """Run openssl in a folder."""
    subprocess.run(["openssl", *arguments.split()], cwd=folder, check=True, capture_output=True)


def self_signed(folder: Path, name: str, alternative: str) -> None:
    """Make the certificate `name`.pem and its key, with the command of docs/api.md."""
    openssl(
        folder,
        "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 3650 "
        f"-subj /CN={name} -addext subjectAltName={alternative} -keyout {name}.key -out {name}.pem",
    )


def signed(folder: Path, alternative: str) -> None:
    """Make leaf.pem and its key, signed by the authority authority.pem."""
    openssl(
        folder,
        "req -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -subj /CN=leaf "
        "-keyout leaf.key -out leaf.csr",
    )
    (folder / "extensions").write_text(f"subjectAltName={alternative}\n")
    openssl(
        folder,
        "x509 -req -in leaf.csr -CA authority.pem -CAkey authority.key -CAcreateserial "
        "-days 30 -extfile extensions -out leaf.pem",
    )


def encrypted(folder: Path, certificate: str) -> Server:
    """Start a server with a token whose port is encrypted."""
    (folder / "token").write_text(TOKEN)
    tls = f'tls = {{ certificate = "{certificate}.pem", key = "{certificate}.key" }}'
    return Server(folder, api=f'token_file = "token"\n{tls}')


@pytest.fixture(scope="module")
def pinned(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Server, Path]]:
    """Start a server whose certificate is self-signed, for a name that no test uses."""
    folder = tmp_path_factory.mktemp("pinned")
    self_signed(folder, "rig", "DNS:rig.local")
    self_signed(folder, "other", "DNS:rig.local")
    server = encrypted(folder, "rig")
    yield server, folder
    server.kill()


@pytest.fixture(scope="module")
def certified(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Server, Path]]:
    """Start a server whose certificate an authority has signed for 127.0.0.1."""
    folder = tmp_path_factory.mktemp("certified")
    self_signed(folder, "authority", "DNS:authority.local")
    signed(folder, "IP:127.0.0.1")
    server = encrypted(folder, "leaf")
    yield server, folder
    server.kill()


def test_a_pinned_server_is_trusted_under_any_name(
    pinned: tuple[Server, Path], encoding: Encoding
) -> None:
    server, folder = pinned
    with hbot.connect(
        server.address, token=folder / "token", tls=folder / "rig.pem", encoding=encoding
    ) as rig:
        with rig.lease(steal=True):
            rig.load_scene({"name": "Nothing", "effect": []})
            rig.enable()
            done = rig.render(lambda state: [-0.01 * w for w in state.omega], duration=0.3)
            assert done.calls > 0
            rig.disable()
        # More than one TLS record.
        assert len(rig.refresh().effects) > 5


def test_aio_over_tls(pinned: tuple[Server, Path], encoding: Encoding) -> None:
    server, folder = pinned

    async def main() -> None:
        async with hbot.aio.connect(
            server.address, token=TOKEN, tls=folder / "rig.pem", encoding=encoding
        ) as rig:
            assert (await rig.ping("x")).data == "x"
            assert len([state async for state in rig.states(duration=0.1)]) == 25

    asyncio.run(main())


def test_another_server_is_not_trusted(pinned: tuple[Server, Path]) -> None:
    server, folder = pinned
    with pytest.raises(hbot.NotTrusted, match="name the server's own certificate"):
        hbot.connect(server.address, token=TOKEN, tls=folder / "other.pem")


def test_an_authority_is_trusted_for_its_names(certified: tuple[Server, Path]) -> None:
    server, folder = certified
    with hbot.connect(server.address, token=TOKEN, tls=str(folder / "authority.pem")) as rig:
        assert rig.ping(1).data == 1
    by_name = server.address.replace("127.0.0.1", "localhost")
    with pytest.raises(hbot.NotTrusted, match=r"[Hh]ostname|name"):
        hbot.connect(by_name, token=TOKEN, tls=folder / "authority.pem")
    hbot.connect(by_name, token=TOKEN, tls=folder / "leaf.pem").close()


def test_a_context_of_your_own(certified: tuple[Server, Path]) -> None:
    server, folder = certified
    context = ssl.create_default_context(cafile=folder / "authority.pem")
    hbot.connect(server.address, token=TOKEN, tls=context).close()


def test_both_sides_must_encrypt(server: Server, pinned: tuple[Server, Path]) -> None:
    encrypting, folder = pinned
    with pytest.raises(hbot.NotTrusted, match="the server encrypts"):
        hbot.connect(encrypting.address, token=TOKEN)
    with pytest.raises(hbot.NotTrusted, match="the server does not encrypt"):
        hbot.connect(server.address, tls=folder / "rig.pem")


def test_a_file_without_a_certificate(server: Server, tmp_path: Path) -> None:
    with pytest.raises(hbot.NotTrusted, match="no certificate"):
        hbot.connect(server.address, tls=tmp_path / "missing.pem")
    (tmp_path / "empty.pem").write_text("nothing")
    with pytest.raises(hbot.NotTrusted, match="no certificate"):
        hbot.connect(server.address, tls=tmp_path / "empty.pem")


def test_the_token_is_not_sent_to_a_server_that_is_not_trusted(tmp_path: Path) -> None:
    """A server that records what it decrypts sees nothing."""
    self_signed(tmp_path, "rig", "DNS:rig.local")
    self_signed(tmp_path, "other", "DNS:rig.local")
    command = ["openssl", "s_server", "-accept", "127.0.0.1:0", "-cert", "other.pem"]
    with subprocess.Popen(
        [*command, "-key", "other.key", "-tls1_3"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as listener:
        assert listener.stdout is not None
        heard = ""
        for line in listener.stdout:
            heard += line
            if line.startswith("ACCEPT"):
                port = line.rsplit(":", 1)[1].strip()
                break
        with pytest.raises(hbot.NotTrusted):
            hbot.connect(f"127.0.0.1:{port}", token=TOKEN, tls=tmp_path / "rig.pem")
        listener.terminate()
        heard += listener.stdout.read()
    assert "ACCEPT" in heard
    assert "hello" not in heard
    assert TOKEN not in heard
