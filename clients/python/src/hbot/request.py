"""A request as a value, and the methods of both clients that send it."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any, Concatenate, Generic, ParamSpec, TypeVar, overload

from .scenes import Explain

if TYPE_CHECKING:
    from . import aio
    from .rig import Rig

P = ParamSpec("P")
T = TypeVar("T")


def _as_it_is(error: Exception) -> Exception:
    return error


@dataclass(frozen=True, slots=True)
class Request(Generic[T]):
    """A request whose answer is a `T`."""

    op: str
    fields: dict[str, Any]
    read: Callable[[Any], T]
    """Reads the body of the answer, or None without `wait`."""
    explain: Explain = _as_it_is
    wait: bool = True
    """Whether the client waits for the answer."""


class Op(Generic[P, T]):
    """Turns a function that builds a `Request[T]` into a method that sends it and returns the `T`.

    The method has the parameters and the docstring of the function. That of `aio.Rig` is awaited.
    """

    def __init__(self, build: Callable[Concatenate[Any, P], Request[T]]) -> None:
        """Make the methods of both clients."""
        # `help` shows this text as the type of the result.
        hints = build.__annotations__
        hints["return"] = hints["return"].removeprefix("Request[").removesuffix("]")
        # Errors about arguments say this name. Both classes are called `Rig`.
        build.__qualname__ = f"Rig.{build.__name__}"

        @wraps(build)
        def call(rig: Rig, /, *args: P.args, **kwargs: P.kwargs) -> T:
            return rig._call(build(rig, *args, **kwargs))

        @wraps(build)
        async def call_awaited(rig: aio.Rig, /, *args: P.args, **kwargs: P.kwargs) -> T:
            return await rig._call(build(rig, *args, **kwargs))

        self.call, self.call_awaited = call, call_awaited

    @overload
    def __get__(self, rig: Rig, owner: type[Rig]) -> Callable[P, T]: ...
    @overload
    def __get__(
        self, rig: aio.Rig, owner: type[aio.Rig]
    ) -> Callable[P, Coroutine[Any, Any, T]]: ...
    @overload
    def __get__(self, rig: None, owner: type[Rig]) -> Callable[Concatenate[Rig, P], T]: ...
    @overload
    def __get__(
        self, rig: None, owner: type[aio.Rig]
    ) -> Callable[Concatenate[aio.Rig, P], Coroutine[Any, Any, T]]: ...
    def __get__(self, rig: Any, owner: Any) -> Any:
        """Tell the types only: `Ops` gives its subclasses the methods themselves."""
        return self
