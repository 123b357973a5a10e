"""The environment of Gymnasium on the real server. Left out without Gymnasium, which CI has."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
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


@pytest.fixture(scope="module")
def gym_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Start a server for these tests: they take the simulated hand away and turn the sphere."""
    server = Server(tmp_path_factory.mktemp("gym"))
    yield server
    server.kill()


@pytest.fixture
def server(gym_server: Server) -> Server:
    """Return the server of these tests, settled."""
    gym_server.settle()
    return gym_server


@pytest.fixture
def env(server: Server) -> Iterator[Any]:
    """Make the environment at the shared server."""
    env = gymnasium.make("Hbot-v0", address=server.address, every=EVERY, disable_env_checker=True)
    yield env.unwrapped
    env.close()


def test_gymnasiums_own_checker_finds_nothing(env: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env)


def test_a_step_takes_its_ticks_and_its_torque_acts(env: Any) -> None:
    observation, info = env.reset(seed=3)
    goal = observation["goal"]
    away = turns.log(turns.times(info["state"].q, turns.conjugate(goal)))
    assert np.linalg.norm(away) == pytest.approx(0.4, abs=1e-5)
    push = np.array([0.0, 0.0, 0.02], np.float32)
    ticks, ages, torques = [info["state"].tick], [], []
    for _ in range(40):
        observation, reward, terminated, truncated, info = env.step(push)
        state = info["state"]
        torques.append(observation["torque"])
        ticks.append(state.tick)
        assert ticks[-1] - ticks[-2] == EVERY + info["skipped"]
        assert (terminated, truncated) == (False, False)
        away = turns.log(turns.times(state.q, turns.conjugate(goal)))
        assert reward == pytest.approx(-np.linalg.norm(away), abs=1e-6)
        if state.client is not None:
            ages.append(state.client.age_ticks)
    # A busy machine can leave this program so little time that the torque ends between two steps.
    assert any(torque == pytest.approx(push, abs=1e-6) for torque in torques)
    # The torque of a step is computed from the state before it.
    assert min(ages) == EVERY
    again, _ = env.reset(seed=3, options={"goal": state.q})
    assert again["goal"] == pytest.approx(np.array(state.q) * np.sign(state.q[0]), abs=1e-6)


def test_a_slow_program_gets_the_next_state_and_is_told_what_it_skipped(env: Any) -> None:
    env.reset(seed=1)
    *_, info = env.step(np.zeros(3))
    before, ticks = info["state"].tick, 100
    time.sleep(ticks / RATE_HZ)  # Its subject is time.
    *_, info = env.step(np.zeros(3))
    assert info["skipped"] == info["state"].tick - before - EVERY >= ticks - 2 * EVERY
    later = [env.step(np.zeros(3))[-1]["skipped"] for _ in range(10)]
    assert min(later) < ticks - 2 * EVERY, "it has caught up"


def test_an_episode_ends_at_the_goal_and_a_stop_is_an_error(server: Server) -> None:
    # No orientation is further away than pi, so the first step is at the goal, wherever it turns.
    env = hbot.gym.Env(server.address, every=EVERY, tolerance=3.2)
    env.reset()
    assert env.step(np.zeros(3))[2]
    with hbot.connect(server.address) as other:
        other.estop()
    with pytest.raises(hbot.Faulted, match="estop"):
        for _ in range(100):
            env.step(np.zeros(3))
    env.close()
    env.close()
    with pytest.raises(ValueError, match="every is 0"):
        hbot.gym.Env(server.address, every=0)


def test_the_example_reaches_its_goals_and_the_page_runs(server: Server) -> None:
    environment = {**os.environ, "HBOT_SERVER": server.address}
    page = (REPOSITORY / "docs" / "clients.md").read_text("utf-8")
    (block,) = re.findall(r"(?s)```python\n(import gymnasium.*?)```", page)
    example = REPOSITORY / "examples" / "gym_turn.py"
    for command in ([str(example)], ["-c", block + "env.close()"]):
        done = subprocess.run(
            [sys.executable, *command], env=environment, capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.count("reached") == (3 if command == [str(example)] else 0), done.stdout


def test_virtual_time_is_refused(tmp_path: Path) -> None:
    server = Server(tmp_path, options=["--time", "virtual"])
    try:
        with pytest.raises(hbot.VirtualTime, match=r"hbot\.gym needs a server in real time"):
            hbot.gym.Env(server.address)
    finally:
        server.kill()
