"""An Hbot as an environment of Gymnasium. Needs the extra `gym`.

    import gymnasium, hbot.gym

    env = gymnasium.make("Hbot-v0", address="127.0.0.1:4268", every=10, max_episode_steps=200)
    observation, info = env.reset(seed=1)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

The task is to turn the sphere to a goal, which is drawn at each reset. The action is the torque on
the sphere. A step ends `every` ticks after the one before. A server in virtual time waits for the
program between two steps, so what happens does not depend on how quick the program is. In real time
the rig does not wait: if the program was too late, the step ends with the next state, and
`info["skipped"]` counts the ticks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from typing import Any

from . import turns
from .connection import no_state
from .errors import Faulted, MissingExtra, OutOfRange, TimedOut
from .events import State
from .opening import connect
from .scenes import Scene

try:
    import gymnasium
    import numpy as np
    from gymnasium import spaces
except ImportError as missing:
    raise MissingExtra.of("hbot.gym", "gym", missing) from missing

Array = Any
"""An array of numpy."""
Reward = Callable[[State, turns.Quaternion, Array], float]
ENABLING_S = 5.0
"""Longest time until an enabled rig is active, s."""
NOTHING: Scene = {"name": "Gymnasium", "effect": [], "simulate": {}}
"""No effect, and no hand that holds the sphere of a simulated rig."""


def turn(goal: Iterable[float], q: Iterable[float]) -> Array:
    """Return the rotation vector in frame N that turns the orientation `q` to `goal`, rad."""
    return np.array(turns.log(turns.times(goal, turns.conjugate(q))), np.float32)


def minus_angle(state: State, goal: turns.Quaternion, _action: Array) -> float:
    """Return minus the angle from the sphere to the goal, rad."""
    return -float(np.linalg.norm(turn(goal, state.q)))


class Env(gymnasium.Env[dict[str, Array], Array]):
    """A rig that is turned to goals.

    Observation (a map of arrays of float32, in frame N): `q`, the orientation `(w, x, y, z)` with
    w >= 0; `omega`, rad/s; `torque`, the applied torque, N m; `goal`, the orientation wanted, as
    `q`. Action (float32): the torque on the sphere, N m, at most `info.limits.torque` per axis. It
    adds to that of the scene, and ends two steps after the last action.

    `info` of `reset` and `step`: `state`, the whole state; in a step also `skipped`.

    Attributes:
        rig: the connection. The lease is taken by the first reset, and given back by `close`.
    """

    metadata = {"render_modes": []}  # noqa: RUF012, the base class has the same.

    def __init__(
        self,
        address: str | None = None,
        *,
        every: int = 10,
        scene: Scene = NOTHING,
        goal_angle: float = 0.4,
        reward: Reward = minus_angle,
        tolerance: float | None = None,
        **options: Any,
    ) -> None:
        """Connect to the server at `address`. None: as `hbot.connect`.

        Args:
            address: of the server.
            every: ticks in a step, from 1 to a quarter of a second.
            scene: what the server renders meanwhile. By default nothing.
            goal_angle: turn from the orientation at the reset to the goal, rad.
            reward: reward of a step, from the state after it, the goal and the action.
            tolerance: angle to the goal at which an episode terminates, rad. None: it does not.
            options: further arguments of `hbot.connect`.

        Raises:
            NoServer, Refused, IllegalInput: as `hbot.connect`.
            ValueError: `every` is not legal.
        """
        self._stack = ExitStack()
        self.render_mode = None
        self.rig = self._stack.enter_context(connect(address, **{"name": "gym", **options}))
        try:
            rate = self.rig.hello.rate_hz
            if not 1 <= every <= rate / 4:
                raise ValueError(f"every is {every}; legal: 1 to {rate / 4:.0f} ticks")
        except BaseException:
            self.close()
            raise
        self._every, self._scene, self._goal_angle = every, scene, goal_angle
        self._reward, self._tolerance = reward, tolerance
        self._valid_ms = math.ceil(2000 * every / rate)
        self._held = False
        self._states: Any = None
        limits = self.rig.info.limits
        unit = spaces.Box(-1.0, 1.0, (4,))
        rate_of_turn = spaces.Box(-limits.speed, limits.speed, (3,))
        self._torques = spaces.Box(-limits.torque, limits.torque, (3,))
        self._ranges: dict[str, Any] = {
            "q": unit,
            "omega": rate_of_turn,
            "torque": self._torques,
            "goal": unit,
        }
        self.action_space, self.observation_space = self._torques, spaces.Dict(self._ranges)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Array], dict[str, Any]]:
        """Draw a goal, and enable the rig if it is not. The sphere stays where it is.

        Args:
            seed: of the goals.
            options: `{"goal": quaternion}` chooses the goal.

        Raises:
            Busy: another client has the lease.
            Faulted: the rig is in a fault or an emergency stop.
            OutOfRange: the sphere is too far from the reference of the scene.
        """
        super().reset(seed=seed)
        if not self._held:
            with ExitStack() as stack:
                stack.enter_context(self.rig.lease())
                try:
                    self.rig.advance(1)
                except OutOfRange:  # The server runs in real time.
                    self._states, self._wait = stack.enter_context(
                        self.rig._subscription(self._every)
                    )
                self.rig.load_scene(self._scene)
                self._stack.enter_context(stack.pop_all())
            self._held = True
        self.rig.enable()
        begun = self._next()
        self._state = begun
        while self._state.mode != "active":
            self._state = self._next()
            if self._state.t > begun.t + ENABLING_S:
                raise TimedOut(f"the rig is in mode {self._state.mode}, not active")
        axis = self.np_random.normal(size=3)
        turn = axis * (self._goal_angle / max(float(np.linalg.norm(axis)), 1e-9))
        goal = (options or {}).get("goal", turns.times(turns.exp(turn), self._state.q))
        w, x, y, z = (float(part) for part in goal)
        self._goal = (w, x, y, z)
        return self._observation(), {"state": self._state}

    def step(self, action: Array) -> tuple[dict[str, Array], float, bool, bool, dict[str, Any]]:
        """Let the torque `action` act, N m, and return what holds `every` ticks later.

        Raises:
            Faulted: the rig went into a fault or an emergency stop.
            NotHolder: another client has taken the lease.
            ConnectionLost, TimedOut: no state came.
        """
        wanted = np.clip(np.asarray(action, dtype=float), self._torques.low, self._torques.high)
        before = self._state
        if self._states is not None:
            self._states.newest(0.0)  # States from before this torque do not show what it does.
        self.rig.torque(
            wanted.tolist(), self._valid_ms, tick=before.tick, seq=before.tick, wait=False
        )
        self._state = self._next()
        skipped = self._state.tick - before.tick - self._every
        reward = float(self._reward(self._state, self._goal, wanted))
        there = self._tolerance is not None and (
            -minus_angle(self._state, self._goal, wanted) <= self._tolerance
        )
        info = {"state": self._state, "skipped": skipped}
        return self._observation(), reward, there, False, info

    def close(self) -> None:
        """Give the lease back and close the connection. The torque ramps to zero."""
        self._stack.close()

    def _next(self) -> State:
        """Return the newest state that was not returned before."""
        if self._states is None:
            state = self.rig.advance(self._every)
        else:
            state, _ = self._states.newest(self._wait)
            if state is None:
                raise no_state(self._wait)
        if not self.rig._connection.holds_lease:
            raise self.rig._connection.not_holder("gym", self.rig._connection.holder)
        if state.mode in ("fault", "estop"):
            raise Faulted(f"the rig is in mode {state.mode}: {state.fault or 'a stop'}", op="gym")
        found: State = state
        return found

    def _observation(self) -> dict[str, Array]:
        def upper(q: Any) -> Array:
            return np.array(q) * (-1.0 if q[0] < 0.0 else 1.0)

        state = self._state
        values = {
            "q": upper(state.q),
            "omega": state.omega,
            "torque": state.torque,
            "goal": upper(self._goal),
        }
        return {
            name: np.clip(np.array(values[name], np.float32), space.low, space.high)
            for name, space in self._ranges.items()
        }


gymnasium.register("Hbot-v0", entry_point=Env, nondeterministic=True)
