"""The exceptions of the package. Every one is an `HbotError`.

An exception class exists for each error code of the server (docs/api.md, "Errors"). The other
classes describe problems of the connection.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar


class HbotError(Exception):
    """Base class of all exceptions that this package raises on its own account."""


class NoServer(HbotError, ConnectionError):
    """No program listens at the address, or the address cannot be reached."""


class ConnectionLost(HbotError, ConnectionError):
    """The connection has ended, or the server has been silent for too long. Connect again."""


class NotTrusted(HbotError, ConnectionError):
    """The TLS handshake failed, or only one of the two sides encrypts."""


class TimedOut(HbotError, TimeoutError):
    """The server did not answer, or sent no state, within the timeout of the connection."""


class ProtocolError(HbotError):
    """The server sent a message that this client cannot read."""


class VirtualTime(HbotError):
    """The server runs in virtual time, which does not wait for a program that streams."""


class IllegalInput(HbotError, ValueError):
    """An address, an environment variable, a scene file or a recording is not legal.

    The message names it and the mistake.
    """


class SubscriptionTaken(HbotError):
    """Another `states()` or `render()` of this connection has replaced this one's subscription."""


class MissingExtra(HbotError, ImportError):
    """A feature needs a package that is not installed.

    The message names the command that installs it.
    """

    @classmethod
    def of(cls, what: str, extra: str, missing: Exception) -> MissingExtra:
        """Return the exception for the feature `what`, which needs the `extra` of this package."""
        return cls(
            f"{what} needs packages ({missing}): in the project's folder, run "
            f"`pip install './clients/python[{extra}]'`"
        )


class Refused(HbotError):
    """The server refused a request. Each error code has a subclass.

    Attributes:
        code: the error code, such as `"busy"`.
        message: the description for people; it names the field and the legal values.
        op: the op that was refused. None if the server could not read it.
        holder: name of the client that holds the lease. Present with `busy`, and perhaps with
            `not_holder`.
        angle: angle between the sphere and a spring's reference, rad. Present with `out_of_range`
            from `enable`.
    """

    code: str = ""
    by_code: ClassVar[dict[str, type[Refused]]] = {}

    def __init__(
        self,
        message: str,
        *,
        op: str | None = None,
        holder: str | None = None,
        angle: float | None = None,
        code: str | None = None,
    ) -> None:
        """Create the exception for one refused request."""
        if code is not None:
            self.code = code
        self.message = message
        self.op = op
        self.holder = holder
        self.angle = angle
        # Many messages of the server begin with the op.
        text = f"{op}: {message.removeprefix(f'op {op}: ')}" if op else message
        super().__init__(f"{text} ({self.code})")

    def with_message(self, message: str) -> Refused:
        """Return the same refusal with another description."""
        return type(self)(message, op=self.op, holder=self.holder, angle=self.angle, code=self.code)

    def __init_subclass__(cls) -> None:
        """Register the class under its error code."""
        Refused.by_code[cls.code] = cls

    @staticmethod
    def of(error: object, op: str | None) -> Refused:
        """Return the exception for the field `error` of an answer.

        An unknown code gives a plain `Refused`.

        Raises:
            ProtocolError: the field is no map.
        """
        if not isinstance(error, Mapping):
            raise ProtocolError(
                f"the server sent {type(error).__name__} in place of the description of an error"
            )
        code = str(error.get("code", ""))
        return Refused.by_code.get(code, Refused)(
            str(error.get("message", "")),
            op=op,
            holder=error.get("holder"),
            angle=error.get("angle"),
            code=code,
        )


class BadRequest(Refused):
    """The message could not be read, or a field is missing, unknown or illegal."""

    code = "bad_request"


class UnsupportedVersion(Refused):
    """The server speaks another version of the messages."""

    code = "unsupported_version"


class Unauthorized(Refused):
    """The token is missing or wrong."""

    code = "unauthorized"


class NotHolder(Refused):
    """Only the holder of the lease may send this op."""

    code = "not_holder"


class Busy(Refused):
    """Another client, named in `holder`, has the lease; or too many connections are open."""

    code = "busy"


class UnknownEffect(Refused):
    """The scene has no effect with this id."""

    code = "unknown_effect"


class OutOfRange(Refused):
    """The value is legal in general, but not for this rig, this effect or this moment."""

    code = "out_of_range"


class Faulted(Refused):
    """The rig is in a fault or an emergency stop, or the cause of it is still there."""

    code = "faulted"


class TooLarge(Refused):
    """The request is too long."""

    code = "too_large"
