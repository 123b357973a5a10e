"""The teleoperator: actions from states, and feedback as local models."""

from __future__ import annotations

import threading
import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Any

import hbot
from hbot import turns
from lerobot.teleoperators import Teleoperator, TeleoperatorConfig
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

AXES = "xyz"
OLD_PERIODS = 5
"""Periods after which a state is no action any more."""


@TeleoperatorConfig.register_subclass("hbot")
@dataclass(kw_only=True)
class HbotConfig(TeleoperatorConfig):
    """How to connect to the rig."""

    address: str | None = None
    """Address of the server. None: as `hbot.connect`."""
    every: int = 10
    """Ticks from one state to the next, the period. An action is at most five periods old."""
    valid_ms: int = 200
    """Time after which the last feedback ends, 1 to 1000 ms."""


class Hbot(Teleoperator):  # type: ignore[misc]
    """The sphere as a device that commands an orientation and is felt."""

    config_class = HbotConfig
    name = "hbot"

    def __init__(self, config: HbotConfig) -> None:
        """Keep the settings. `connect` opens the connection."""
        super().__init__(config)
        self.config = config
        self._stack: ExitStack | None = None
        self._state: hbot.State | None = None
        self._came_at = 0.0
        self._error: Exception | None = None
        self._came = threading.Event()

    @property
    def action_features(self) -> dict[str, type]:
        """Names and types of an action: turn since `connect`, rad, and rate, rad/s, in frame N."""
        return {f"{what}.{axis}": float for what in ("turn", "rate") for axis in AXES}

    @property
    def feedback_features(self) -> dict[str, type]:
        """Names and types of a feedback: torque in frame N, N m; stiffness and damping."""
        torque = {f"torque.{axis}": float for axis in AXES}
        return {**torque, "stiffness": float, "damping": float}

    @property
    def is_connected(self) -> bool:
        """Whether the connection is open and states come."""
        return self._stack is not None and self._error is None

    @property
    def is_calibrated(self) -> bool:
        """True: a rig has its zeros in its rig file."""
        return True

    def calibrate(self) -> None:
        """Do nothing."""

    def configure(self) -> None:
        """Load a scene without effects, and enable the rig."""
        self.rig.load_scene({"name": "LeRobot", "effect": []})
        self.rig.enable()

    def connect(self, calibrate: bool = True) -> None:
        """Connect to the server, take the lease and enable the rig. The sphere is at turn 0.

        Raises:
            DeviceAlreadyConnectedError: it is connected.
            hbot.HbotError: as `hbot.connect`, `Rig.lease` and `Rig.enable`.
        """
        if self.is_connected:
            raise DeviceAlreadyConnectedError
        if self._stack is not None:
            with suppress(hbot.HbotError):  # It has ended, which the exception would say again.
                self.disconnect()
        self._state = self._error = None
        self._came.clear()
        with ExitStack() as stack:
            self.rig = stack.enter_context(hbot.connect(self.config.address, name="lerobot"))
            stack.enter_context(self.rig.lease())
            self.configure()
            threading.Thread(target=self._read, args=(self.rig,), daemon=True).start()
            self._begin = turns.conjugate(self._newest().q)
            self._stack = stack.pop_all()

    def _read(self, rig: hbot.Rig) -> None:
        """Keep the newest state until the connection ends."""
        try:
            for state in rig.states(self.config.every):
                self._state, self._came_at = state, time.monotonic()
                self._came.set()
        except hbot.HbotError as error:
            # Nobody is told to disconnect: the lease and the enabled rig end with the connection.
            self._error = error
            rig.close()
            self._came.set()

    def _newest(self) -> hbot.State:
        """Return the newest state. In a silence, waits for the next."""
        age = time.monotonic() - self._came_at
        if self._error is None and age > OLD_PERIODS * self.config.every / self.rig.hello.rate_hz:
            self._came.clear()
        if not self._came.wait(self.rig._connection.timeout) or self._error is not None:
            raise self._error or hbot.TimedOut("no state came")
        assert self._state is not None
        if self._state.mode in ("fault", "estop"):
            raise hbot.Faulted(f"the rig is in mode {self._state.mode}", op="lerobot")
        return self._state

    def get_action(self) -> dict[str, float]:
        """Return where the sphere is.

        Raises:
            DeviceNotConnectedError: `connect` was not called.
            hbot.Faulted: the rig is in a fault or an emergency stop.
            hbot.ConnectionLost, hbot.TimedOut: no states come.
        """
        if self._stack is None:
            raise DeviceNotConnectedError
        self._shown = state = self._newest()
        turn = turns.log(turns.times(state.q, self._begin))
        values = {"turn": turn, "rate": state.omega}
        return {
            f"{what}.{axis}": float(value)
            for what, vector in values.items()
            for axis, value in zip(AXES, vector, strict=True)
        }

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Let `feedback` be felt until the next one, at most for `valid_ms`.

        Raises:
            DeviceNotConnectedError: `connect` was not called.
            ValueError: a value is not finite.
        """
        if self._stack is None:
            raise DeviceNotConnectedError
        shown = getattr(self, "_shown", None)
        self.rig.model(
            self.config.valid_ms,
            torque=[float(feedback.get(f"torque.{axis}", 0.0)) for axis in AXES],
            stiffness=float(feedback.get("stiffness", 0.0)),
            damping=float(feedback.get("damping", 0.0)),
            pose=None if shown is None else shown.q,
            soften=True,
            wait=False,
        )

    def disconnect(self) -> None:
        """Give the lease back and close the connection. The torque ramps to zero.

        Raises:
            DeviceNotConnectedError: `connect` was not called.
        """
        if self._stack is None:
            raise DeviceNotConnectedError
        stack, self._stack = self._stack, None
        stack.close()
