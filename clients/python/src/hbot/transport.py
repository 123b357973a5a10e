"""The byte stream of a connection: TCP, or TLS 1.3 over TCP.

One thread receives, and any thread sends. TLS runs on buffers in memory: so the thread that waits
for bytes holds no lock that a sender needs.
"""

from __future__ import annotations

import contextlib
import os
import selectors
import socket
import ssl
import threading
from pathlib import Path
from typing import TypeAlias

from .errors import IllegalInput, NoServer, NotTrusted

Tls: TypeAlias = str | os.PathLike[str] | ssl.SSLContext
"""What a client trusts: a PEM file, or a context of your own.

A PEM file holds the server's own certificate (pinned: neither its name nor its dates are checked)
or the certificate of an authority (name and dates are checked).
"""

DEFAULT_PORT = 4268
ALERT = b"\x15"
"""First byte of the TLS alert that an encrypted port sends to a client that does not encrypt."""

_PIECE_BYTES = 1 << 16


def split_address(address: str) -> tuple[str, int]:
    """Return host and port of `HOST:PORT`, `HOST`, `[IPV6]:PORT` or `IPV6`.

    The default port is 4268.

    Raises:
        IllegalInput: it is no text, a port alone or a URL, or its port is not from 1 to 65535.
    """
    if not isinstance(address, str):
        raise IllegalInput(f"the address is {address!r}; legal: a text such as '127.0.0.1:4268'")
    host, colon, port = address.rpartition(":")
    if address.isdigit():
        raise IllegalInput(f"{address!r} is a port alone; did you mean '127.0.0.1:{address}'?")
    if "://" in address:
        raise IllegalInput(f"the address is {address!r}; legal: HOST or HOST:PORT, without http://")
    if not colon or (":" in host and not host.endswith("]")):
        return address.strip("[]"), DEFAULT_PORT
    if not port.isdigit() or not 0 < int(port) < 1 << 16:
        raise IllegalInput(f"{address!r}: the port is {port!r}; legal: 1 to 65535")
    return host.strip("[]"), int(port)


class Transport:
    """A connected TCP socket."""

    def __init__(self, address: str, timeout: float) -> None:
        """Connect.

        Args:
            address: `HOST:PORT` or `HOST`.
            timeout: longest time to connect, and later for the socket to take the bytes of one
                `send`, s.

        Raises:
            NoServer: no program listens at the address.
        """
        self.host, port = split_address(address)
        try:
            self._socket = socket.create_connection((self.host, port), timeout=timeout)
        except OSError as error:
            raise NoServer(f"no connection to {address}: {error}") from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._send_lock = threading.RLock()
        self._closed = False
        self._readable = selectors.DefaultSelector()
        self._readable.register(self._socket, selectors.EVENT_READ)
        self._writable = selectors.DefaultSelector()
        self._writable.register(self._socket, selectors.EVENT_WRITE)

    def receive(self, wait: float) -> bytes | None:
        """Return bytes that have arrived, and wait at most `wait` s for them.

        None: none came. Empty: the end.
        """
        if not self._readable.select(wait):
            return None
        return self._socket.recv(_PIECE_BYTES)

    def send(self, data: bytes) -> None:
        """Send all of `data`. Any thread may call this."""
        with self._send_lock:
            self._socket.sendall(data)

    def writable(self) -> bool:
        """Return whether the connection takes a short message at once.

        False while a message is
        being sent. True after the end, where `send` raises.
        """
        if not self._send_lock.acquire(blocking=False):
            return False
        try:
            return self._closed or bool(self._writable.select(0))
        finally:
            self._send_lock.release()

    def shutdown(self) -> None:
        """End the connection. A `receive` that waits returns."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Free the socket. Only the thread that receives calls this, after its last `receive`."""
        with self._send_lock:
            self._closed = True
            self._readable.close()
            self._writable.close()
            self._socket.close()


class TlsTransport(Transport):
    """A TLS connection."""

    def __init__(self, address: str, timeout: float, context: ssl.SSLContext) -> None:
        """Connect and complete the TLS handshake.

        Raises:
            NoServer: no program listens at the address.
            NotTrusted: the handshake failed.
        """
        super().__init__(address, timeout)
        self._incoming, self._outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
        self._tls = context.wrap_bio(self._incoming, self._outgoing, server_hostname=self.host)
        self._tls_lock = threading.RLock()
        try:
            self._shake_hands(timeout)
        except (OSError, ValueError) as error:
            self.close()
            raise NotTrusted(_explain(error)) from error

    def _shake_hands(self, timeout: float) -> None:
        while True:
            try:
                self._tls.do_handshake()
                return self._flush()
            except ssl.SSLWantReadError:
                self._flush()
            except ssl.SSLError:
                self._flush()  # Tells the server the reason.
                raise
            data = super().receive(timeout)
            if not data:
                raise ConnectionError("the server did not complete the TLS handshake")
            self._incoming.write(data)

    def certificate(self) -> bytes:
        """Return the server's certificate (DER)."""
        return self._tls.getpeercert(binary_form=True) or b""

    def receive(self, wait: float) -> bytes | None:
        """Return decrypted bytes, as `Transport.receive` does.

        None also if a record is not complete yet.
        """
        data = super().receive(wait)
        if data is None:
            return None
        with self._tls_lock:
            if data:
                self._incoming.write(data)
            else:
                self._incoming.write_eof()
            pieces = []
            try:
                while piece := self._tls.read(_PIECE_BYTES):
                    pieces.append(piece)
                ended = True
            except ssl.SSLWantReadError:
                ended = False
            except (ssl.SSLEOFError, ssl.SSLZeroReturnError):
                ended = True
        if self._outgoing.pending:
            self._flush()
        return b"".join(pieces) if pieces or ended else None

    def send(self, data: bytes) -> None:
        """Encrypt and send all of `data`. Any thread may call this."""
        with self._send_lock:
            with self._tls_lock:
                self._tls.write(data)
                records = self._outgoing.read()
            self._socket.sendall(records)

    def _flush(self) -> None:
        with self._send_lock:
            self._socket.sendall(self._outgoing.read())


def open_transport(address: str, tls: Tls | None, timeout: float) -> Transport:
    """Connect to `address`, with TLS unless `tls` is None.

    Raises:
        NoServer: no program listens at the address.
        NotTrusted: the server does not encrypt, or its certificate is not trusted.
    """
    if tls is None:
        return Transport(address, timeout)
    if isinstance(tls, ssl.SSLContext):
        return TlsTransport(address, timeout, tls)
    try:
        authorities = ssl.create_default_context(cafile=Path(tls))
        pinned = _certificates(Path(tls).read_text(encoding="ascii", errors="replace"))
    except (OSError, ValueError) as error:
        raise NotTrusted(
            f"{os.fspath(tls)}: no certificate can be read from it: {error}"
        ) from error
    authorities.minimum_version = ssl.TLSVersion.TLSv1_3
    unchecked = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    unchecked.minimum_version = ssl.TLSVersion.TLSv1_3
    unchecked.check_hostname = False
    unchecked.verify_mode = ssl.CERT_NONE
    # A handshake proves that the server has the key of its certificate. Nothing is sent before the
    # certificate is known to be the pinned one.
    transport = TlsTransport(address, timeout, unchecked)
    if transport.certificate() in pinned:
        return transport
    transport.shutdown()
    transport.close()
    return TlsTransport(address, timeout, authorities)


def _certificates(pem: str) -> list[bytes]:
    """Return the certificates (DER) in a PEM text."""
    begin, end = "-----BEGIN CERTIFICATE-----", "-----END CERTIFICATE-----"
    parts = [part.split(end)[0] for part in pem.split(begin)[1:]]
    return [ssl.PEM_cert_to_DER_cert(f"{begin}{part}{end}") for part in parts]


def _explain(error: Exception) -> str:
    """Return what a failed handshake means, and what to do."""
    if isinstance(error, ssl.SSLCertVerificationError):
        return (
            f"the server's certificate is not trusted: {error.verify_message}; "
            "name the server's own certificate, or that of the authority that signed it"
        )
    if isinstance(error, ssl.SSLError) and error.reason in (
        "WRONG_VERSION_NUMBER",
        "RECORD_LAYER_FAILURE",
    ):
        return "the server does not encrypt: leave out tls="
    return f"no encrypted connection: {error}"
