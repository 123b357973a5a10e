"""The blocking client."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, TypeVar

from . import ops
from .answers import Changed, Controller, Loaded, Pong, Stats
from .callbacks import call_back
from .connection import MAX_EVENTS, MAX_STATES, Connection, Send, ignore, no_state
from .errors import ConnectionLost, HbotError, NotHolder, TimedOut
from .events import Event, LostEvent, Mode, State
from .info import Hello, Info
from .mailbox import Mailbox
from .models import Impedance, Model, Plane
from .rendering import Computed, Rendered, Rendering
from .scenes import Scene

T = TypeVar("T")
Torque = Callable[[State], Sequence[float] | Model | Computed | None]
"""Computes a torque on the sphere (three numbers in frame N, N m) or a local model from a state.

`Computed` also names the tick of an older state that it used. None: send no torque this time.
"""


class Rig:
    """A connection to a server. Any thread may call its methods.

    A thread of the package reads the connection as bytes arrive. So the server sees a quick reader
    and a heartbeat however slow the program is. What the program does not take in time is dropped,
    the oldest first; `lost` counts it, and a `LostEvent` tells it.

    Attributes:
        hello: the server's answer to the first message.
        info: the answer to `info` at the time of connecting or of the last `refresh`. Later changes
            are not in it: `refresh().scene` is the running scene.
    """

    def __init__(
        self, connection: Connection, on_event: Callable[[Event], None] | None = None
    ) -> None:
        """Use an open connection. Programs call `connect` instead."""
        self._connection = connection
        self._events: Mailbox[Event] = Mailbox(MAX_EVENTS)
        self._on_event = on_event
        self.hello: Hello = connection.hello
        connection.start(self._events)
        try:
            self.info: Info = self._call(ops.info())
        except BaseException:
            connection.close()
            raise
        if on_event is not None:
            threading.Thread(target=self._call_back, name="hbot-events", daemon=True).start()

    def __enter__(self) -> Rig:
        """Return the connection itself."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Close the connection."""
        self.close()

    def __str__(self) -> str:
        """Say the rig's name, SIMULATED or LIVE, the mode and the scene. Asks the server for them.

        After the connection has ended, it says what was last known.
        """
        with contextlib.suppress(HbotError):
            self.refresh()
        return str(self.info)

    def close(self) -> None:
        """Close the connection. The server frees the lease, and this client's torque ends."""
        self._connection.close()

    @property
    def lost(self) -> LostEvent:
        """What this program was too slow to take or to send, since it connected."""
        return self._connection.lost

    def refresh(self) -> Info:
        """Ask for `info` again. Returns it and stores it in the attribute `info`."""
        self.info = self._call(ops.info())
        return self.info

    def stats(self) -> Stats:
        """Return how long things took, and how often events happened, since the server began."""
        return self._call(ops.stats())

    def controllers(self) -> tuple[Controller, ...]:
        """Return what the motor controller of each joint reports, in the order of the joints.

        Current, temperature, complaints and firmware; a value that it does not report is None.
        """
        return self._call(ops.controllers())

    def acquire(self, steal: bool = False) -> None:
        """Take the lease, the right to command. `lease` does this for the time of a `with` block.

        Args:
            steal: take the lease also from another client.

        Raises:
            Busy: another client, named in `holder`, has the lease.
        """
        self._call(ops.acquire(steal))

    def release(self) -> None:
        """Give the lease back. This client's torque ramps to zero, and the scene continues."""
        self._call(ops.release())

    @contextmanager
    def lease(self, steal: bool = False) -> Iterator[None]:
        """Hold the lease inside a `with` block.

        It is given back at the end, also after an exception.

        Raises:
            Busy: another client, named in `holder`, has the lease, and `steal` is false.
        """
        self.acquire(steal)
        try:
            yield
        except BaseException:
            # The exception of the block says more. The server frees the lease of a lost connection.
            with contextlib.suppress(HbotError):
                self._finish(ops.release())
            raise
        with contextlib.suppress(NotHolder):  # Another client has taken it.
            self.release()

    def load_scene(self, scene: Scene) -> Loaded:
        """Replace the scene. The change is blended in. `info.scene` is that of before.

        Args:
            scene: path of a scene file (TOML), or the name of a ready-made scene such as `"hinge"`,
                which the server knows; or a map of the structure of a scene file. Recorded paths
                (CSV) that a scene file names are read from this machine.

        Raises:
            OSError, IllegalInput: a file cannot be read; the message names it.
            BadRequest, OutOfRange: the scene is not legal; the message names every mistake, with
                its line and column if the scene is a file.
            TooLarge: the scene has more than 65536 bytes. `encoding="msgpack"` needs fewer.
            NotHolder: this client does not hold the lease.
        """
        return self._call(ops.load_scene(scene))

    def set(self, effect: str, /, **parameters: Any) -> Changed:
        """Change parameters of an effect while the loop runs. Returns warnings about the scene.

        docs/effects.md lists them with their units.

        Raises:
            UnknownEffect, BadRequest, OutOfRange, NotHolder: the server refused the change.
        """
        return self._call(ops.change(effect, parameters))

    def torque(
        self,
        torque: Iterable[float],
        valid_ms: int,
        *,
        tick: int | None = None,
        seq: int | None = None,
        wait: bool = True,
    ) -> None:
        """Send one torque, which is added to that of the scene. `render` sends a stream of them.

        Args:
            torque: three numbers in frame N, N m, acting on the sphere.
            valid_ms: time from its arrival until it ends, 1 to 1000 ms. Then it ramps to zero over
                20 ms.
            tick: the tick of the state from which it was computed.
            seq: a number of your choice. States return it as `state.client.seq`.
            wait: wait for the answer. Without, a refusal comes as a `RefusedEvent`; if another
                client has taken the lease, the next call raises `NotHolder`.
        """
        self._stream(ops.torque(torque, valid_ms, tick, seq), wait)

    def model(
        self,
        valid_ms: int,
        *,
        torque: Iterable[float] = (0.0, 0.0, 0.0),
        stiffness: Impedance = 0.0,
        damping: Impedance = 0.0,
        pose: Iterable[float] | None = None,
        planes: Sequence[Plane] = (),
        blend_ms: int | None = None,
        soften: bool = False,
        tick: int | None = None,
        seq: int | None = None,
        wait: bool = True,
    ) -> float | None:
        """Send one local model: a torque, and how it changes as the sphere turns.

        `render` sends a stream of them if its function returns a `Model`, with the same fields.

        Args:
            torque: torque at the pose in frame N, N m.
            stiffness: N m/rad: a number, one for each axis of frame N, or a symmetric 3x3 matrix.
            damping: N m s/rad, as `stiffness`.
            pose: quaternion about which the stiffness acts. None: that of the state with the number
                `tick`, or that at arrival.
            planes: at most eight half-spaces, such as contacts.
            blend_ms: time in which the torque of before blends into this one, 0 to 200 ms. None:
                the time since the last model, at most 50 ms.
            soften: render what the loop does not keep stable with less stiffness, do not refuse it.
            valid_ms: time from its arrival until it ends, 1 to 1000 ms. Then it ramps to zero over
                20 ms.
            tick: the tick of the state from which it was computed.
            seq: a number of your choice. States return it as `state.client.seq`.
            wait: wait for the answer. Without, a refusal comes as a `RefusedEvent`; if another
                client has taken the lease, the next call raises `NotHolder`.

        Returns the fraction of the stiffness that is rendered: 1, or less if the model allows the
        server to soften it. Without `wait`, None.

        Raises:
            OutOfRange: the loop does not keep the model stable, or `tick` is too old.
        """
        model = Model(torque, stiffness, damping, pose, planes, blend_ms, soften)
        request = ops.model(model, valid_ms, tick, seq)
        if wait:
            return self._call(request)
        self._connection.post(request.op, request.fields)
        return None

    def reference(
        self,
        effect: str,
        q: Iterable[float],
        *,
        omega: Iterable[float] | None = None,
        valid_ms: int | None = None,
        tick: int | None = None,
        seq: int | None = None,
        wait: bool = True,
    ) -> None:
        """Move the reference of an effect, at most at the rig's `limits.reference_rate`.

        Args:
            effect: id of the effect.
            q: quaternion `(w, x, y, z)`, which rotates sphere axes into N.
            omega: angular velocity of the reference in frame N, rad/s.
            valid_ms: time after which `omega` ends, 1 to 1000 ms. The server's default is 100.
            tick: the tick of the state from which it was computed.
            seq: a number of your choice.
            wait: wait for the answer. Without, a refusal comes as a `RefusedEvent`; if another
                client has taken the lease, the next call raises `NotHolder`.
        """
        self._stream(ops.reference(effect, q, omega, valid_ms, tick, seq), wait)

    def align(
        self,
        q: Iterable[float],
        weight: float | None = None,
        *,
        sigma: Iterable[float] | None = None,
        t: float | None = None,
    ) -> float:
        """Correct the server's orientation by one that was measured from outside.

        Args:
            q: the measured orientation `(w, x, y, z)`.
            weight: fraction of the difference that the server takes over, 0 to 1. Required without
                `sigma`. With `sigma`, its variances are divided by the weight, which is 1 by
                default.
            sigma: standard deviations of the error about the axes of frame N, rad. The server
                then weighs the measurement by its own uncertainty, and ignores one that is too far
                away.
            t: time of the measurement since the loop began, s. None: the time of arrival.

        Returns:
            The difference before the correction, rad.
        """
        return self._call(ops.align(q, weight, t, sigma))

    def align_direction(
        self,
        body: Iterable[float],
        world: Iterable[float],
        sigma: float,
        *,
        t: float | None = None,
    ) -> float:
        """Correct the server's orientation by a measured direction, such as that of gravity.

        Args:
            body: the direction in the sphere's axes.
            world: the same direction in frame N. Gravity is `(0, 0, -1)`.
            sigma: standard deviation of the error about each axis across the direction, rad.
            t: time of the measurement since the loop began, s. None: the time of arrival.

        Returns:
            The angle between the direction and the server's own before the correction, rad.
        """
        return self._call(ops.align_direction(body, world, sigma, t))

    def hand(
        self,
        q: Iterable[float] | None,
        *,
        over_ms: int | None = None,
        stiffness: float | None = None,
        damping: float | None = None,
        inertia: float | None = None,
        wait: bool = True,
    ) -> None:
        """Let the hand of a simulated rig turn the sphere. A real rig has none and refuses.

        Args:
            q: the orientation `(w, x, y, z)` to which the hand turns. None: it lets go.
            over_ms: time in which its target turns there. None: 50 ms.
            stiffness: spring of the grip, N m/rad. None: 3.
            damping: damping of the grip, N m s/rad. None: 0.05.
            inertia: inertia that the hand adds to the sphere, kg m². None: 0.002.
            wait: wait for the answer. Without, a refusal comes as a `RefusedEvent`; if another
                client has taken the lease, the next call raises `NotHolder`.
        """
        self._stream(ops.hand(q, over_ms, stiffness, damping, inertia), wait)

    def enable(self) -> Mode:
        """Begin to render, with a soft start of 0.5 s. Returns the mode.

        Raises:
            OutOfRange: an effect is too far from its rest; `angle` says how far, rad.
            Faulted: the rig is in a fault. `reset` it first.
        """
        return self._call(ops.enable())

    def disable(self) -> Mode:
        """End rendering, with a ramp of 50 ms. Needs no lease. Returns the mode."""
        return self._call(ops.disable())

    def reset(self) -> Mode:
        """Leave a fault or an emergency stop after its cause is gone. Returns the mode."""
        return self._call(ops.reset())

    def estop(self) -> Mode:
        """Stop the motors in the next tick. Needs no lease. Returns the mode."""
        return self._call(ops.estop())

    def advance(self, ticks: int) -> State:
        """Let a simulated rig in virtual time run `ticks` ticks, 1 to 1000000, and then wait.

        Returns the state of the last of them. A torque or a model that was sent before with
        `wait=False` acts in all of them. From the first call until the lease is given back, time
        passes only here, and by one tick for each other call that waits for the loop.

        Raises:
            OutOfRange: the server runs in real time.
            NotHolder: this client does not hold the lease.
        """
        return self._call(ops.advance(ticks))

    def ping(self, data: Any = None) -> Pong:
        """Test the connection. Returns `data` as it came back, and the last tick."""
        return self._call(ops.ping(data))

    def states(self, every: int = 1, duration: float | None = None) -> Iterator[State]:
        """Iterate over states.

        A connection has one subscription: a later `states` or `render` ends this one.

        If the program is more than 4096 states behind, the oldest are dropped; `lost.states` counts
        them.

        Args:
            every: ticks from one state to the next, 1 to 1000000.
            duration: time of the rig until the iteration ends, s. None: no end.

        Raises:
            TimedOut: no state came within the timeout of the connection.
            ConnectionLost: the connection has ended.
        """
        with self._subscription(every) as (states, wait):
            end: int | None = None
            while (state := states.get(wait)) is not None:
                if end is None and duration is not None:
                    end = state.tick + round(duration * self.hello.rate_hz)
                if end is not None and state.tick >= end:
                    return
                yield state
            raise no_state(wait)

    def render(
        self, torque: Torque, *, every: int = 1, valid_ms: int = 20, duration: float | None = None
    ) -> Rendered:
        """Compute torques from states and stream them.

        Needs the lease; the rig must be enabled to feel it. If it is not when this begins, the
        logger `hbot` logs a warning.

        The function always gets the newest state. If it is slow, older states are skipped and
        counted. The torque ends by itself `valid_ms` after the last message (and 20 ms of ramp),
        whatever happens to this program.

        Args:
            torque: computes the torque on the sphere in frame N, N m, or a `Model`, from a state. A
                function that returns the torque or model of an older state returns
                `hbot.Computed(torque, tick)` with that state's tick, so that
                `state.client.age_ticks` is true. None: send nothing this time.
            every: ticks from one state to the next, 1 to 1000000.
            valid_ms: how long each torque is valid, 1 to 1000 ms. Choose several periods of
                `every`.
            duration: time of the rig until this returns, s. None: no end.

        Raises:
            NotHolder: this client does not hold the lease, or another client has taken it.
            Faulted: the rig went into a fault or an emergency stop.
            TimedOut, ConnectionLost: no state came.
            ValueError, TypeError: the torque is not three finite numbers.
        """
        rendering = Rendering(self._connection, every, valid_ms, duration)
        with self._subscription(every) as (states, wait):
            while True:
                state, skipped = states.newest(wait)
                if state is None:
                    raise no_state(wait)
                if not rendering.goes_on(state, skipped):
                    break
                rendering.send(state, torque(state))
        return rendering.result

    def events(self, duration: float | None = None) -> Iterator[Event]:
        """Iterate over the events that were not taken yet, since the connection began.

        Args:
            duration: longest time to wait for each event, s. 0: only events that have arrived.
                None: no end.

        Raises:
            ConnectionLost: the connection has ended, after the last event.
            ValueError: `connect` was given `on_event`, which gets the events instead.
        """
        if self._on_event is not None:
            raise ValueError("on_event gets the events of this connection")
        while (event := self._events.get(duration)) is not None:
            yield event

    def _call_back(self) -> None:
        """Pass events to the program's function until the connection ends.

        Runs in a separate thread.
        """
        assert self._on_event is not None
        try:
            while (event := self._events.get(None)) is not None:
                call_back(self._on_event, event)
        except ConnectionLost:
            pass  # The program's next call raises it.

    def _call(self, request: ops.Request[T], send: Send | None = None) -> T:
        answers: queue.SimpleQueue[tuple[Any, Exception | None]] = queue.SimpleQueue()
        send = send or self._connection.request
        send(request.op, request.fields, lambda body, error: answers.put((body, error)))
        try:
            body, error = answers.get(timeout=self._connection.timeout)
        except queue.Empty:
            raise TimedOut(f"{request.op}: no answer for {self._connection.timeout} s") from None
        if error is not None:
            raise request.explain(error)
        return request.read(body)

    def _finish(self, request: ops.Request[None], send: Send | None = None) -> None:
        """Send the request that ends a block, and wait for its answer unless the server is silent.

        A block that ends because the server is silent would otherwise take as long again.
        """
        if self._connection.silent:
            (send or self._connection.request)(request.op, request.fields, ignore)
        else:
            self._call(request, send)

    def _stream(self, request: ops.Request[None], wait: bool) -> None:
        if wait:
            self._call(request)
        else:
            self._connection.post(request.op, request.fields)

    @contextmanager
    def _subscription(self, every: int) -> Iterator[tuple[Mailbox[State], float]]:
        """Subscribe for the time of a block.

        Returns the states, and the longest time to wait for one, s.
        """
        states: Mailbox[State] = Mailbox(MAX_STATES)
        try:
            self._call(ops.subscribe(every), partial(self._connection.subscribe, states))
            yield states, self._connection.timeout + every / self.hello.rate_hz
        finally:
            with contextlib.suppress(ConnectionLost, TimedOut):
                self._finish(ops.unsubscribe(), partial(self._connection.unsubscribe, states))
