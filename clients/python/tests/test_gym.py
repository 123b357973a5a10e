"""The environment of Gymnasium on the real server. Left out without Gymnasium, which CI has."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from typing import Any

import pytest
from serving import RATE_HZ, REPOSITORY, Server

import hbot

if not os.environ.get("CI"):
    pytest.importorskip("gymnasium", reason="the extra gym is installed in CI")

import gymnasium
import numpy as np
from gymnasium.utils.env_checker import check_env

import hbot.gym
from hbot import turns

EVERY = 5


@pytest.fixture
def env(virtual_server: Server) -> Iterator[Any]:
    """Make the environment at the server in virtual time, with a sphere that nobody holds."""
    with hbot.connect(virtual_server.address) as rig, rig.lease():
        rig.load_scene({"name": "free", "effect": [], "simulate": {}})
    env = made(virtual_server)
    yield env
    env.close()


def made(server: Server) -> Any:
    """Let Gymnasium make the environment."""
    made = gymnasium.make("Hbot-v0", address=server.address, every=EVERY, disable_env_checker=True)
    return made.unwrapped


def test_gymnasiums_own_checker_finds_nothing(env: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env)


def test_a_step_takes_its_ticks_and_its_torque_acts(env: Any) -> None:
    env.reset(seed=3)
    while np.any(env.step(np.zeros(3))[0]["torque"]):
        pass  # The scene that was rendered before fades out.
    observation, info = env.reset(seed=3)
    goal = observation["goal"]
    away = turns.log(turns.times(info["state"].q, turns.conjugate(goal)))
    assert np.linalg.norm(away) == pytest.approx(0.4, abs=1e-5)
    omega = info["state"].omega
    push = np.array([0.0, 0.0, 0.02], np.float32)
    ticks = [info["state"].tick]
    for step in range(40):
        observation, reward, terminated, truncated, info = env.step(push)
        state = info["state"]
        ticks.append(state.tick)
        assert (ticks[-1] - ticks[-2], info["skipped"]) == (EVERY, 0)
        assert (terminated, truncated) == (False, False)
        away = turns.log(turns.times(state.q, turns.conjugate(goal)))
        assert reward == pytest.approx(-np.linalg.norm(away), abs=1e-6)
        # The torque of a step is computed from the state before it, and acts in its last tick.
        assert (state.client.seq, state.client.age_ticks) == (ticks[-2], EVERY)
        assert observation["torque"] == pytest.approx(push, abs=1e-6), step
        time.sleep(0.01)  # Its subject is time: the rig waits.
    # Nothing holds the sphere, and 20 mN m for 0.2 s turn its inertia.
    spun = push[2] * 40 * EVERY * 1e-3 / env.rig.info.render.inertia
    assert state.omega[2] - omega[2] == pytest.approx(spun, rel=0.2)
    again, _ = env.reset(seed=3, options={"goal": state.q})
    assert again["goal"] == pytest.approx(np.array(state.q) * np.sign(state.q[0]), abs=1e-6)


def test_a_reset_that_fails_is_made_good_by_the_next(
    env: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def late(_scene: object) -> None:
        raise hbot.TimedOut("load_scene: no answer for 5.0 s")

    monkeypatch.setattr(env.rig, "load_scene", late)
    with pytest.raises(hbot.TimedOut):
        env.reset(seed=1)
    assert env.rig.refresh().lease.holder is None
    monkeypatch.undo()
    env.reset(seed=1)
    assert env.rig.refresh().scene["name"] == "Gymnasium"


def test_in_real_time_a_slow_program_is_told_what_it_skipped(own_server: Server) -> None:
    env = made(own_server)
    env.reset(seed=1)
    *_, info = env.step(np.zeros(3))
    before, ticks = info["state"].tick, 100
    time.sleep(ticks / RATE_HZ)  # Its subject is time.
    *_, info = env.step(np.zeros(3))
    assert info["skipped"] == info["state"].tick - before - EVERY >= ticks - 2 * EVERY
    later = [env.step(np.zeros(3))[-1]["skipped"] for _ in range(10)]
    assert min(later) < ticks - 2 * EVERY, "it has caught up"
    env.close()


def test_an_episode_ends_at_the_goal_and_a_stop_is_an_error(virtual_server: Server) -> None:
    env = hbot.gym.Env(virtual_server.address, every=EVERY, tolerance=0.25)
    env.reset()
    assert not env.step(np.zeros(3))[2], "the goal is 0.4 rad away"
    env.reset(options={"goal": env.step(np.zeros(3))[-1]["state"].q})
    assert env.step(np.zeros(3))[2]
    with hbot.connect(virtual_server.address) as other:
        other.estop()
    with pytest.raises(hbot.Faulted, match="estop"):
        env.step(np.zeros(3))
    env.rig.reset()
    env.close()
    env.close()
    with pytest.raises(ValueError, match="every is 0"):
        hbot.gym.Env(virtual_server.address, every=0)


def test_the_example_reaches_its_goals_and_the_page_runs(own_server: Server) -> None:
    environment = {**os.environ, "HBOT_SERVER": own_server.address}
    page = (REPOSITORY / "docs" / "clients.md").read_text("utf-8")
    (block,) = re.findall(r"(?s)```python\n(import gymnasium.*?)```", page)
    example = REPOSITORY / "examples" / "gym_turn.py"
    for command in ([str(example)], ["-c", block + "env.close()"]):
        done = subprocess.run(
            [sys.executable, *command], env=environment, capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.count("reached") == (3 if command == [str(example)] else 0), done.stdout
