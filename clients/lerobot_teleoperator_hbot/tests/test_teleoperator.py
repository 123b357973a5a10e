"""The teleoperator, made by LeRobot's own factory, on a real server. Needs LeRobot."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from pathlib import Path

import hbot
import pytest
from lerobot.teleoperators import Teleoperator, TeleoperatorConfig, make_teleoperator_from_config
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError
from lerobot.utils.import_utils import register_third_party_plugins
from serving import Server, eventually


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    """Start a server."""
    server = Server(tmp_path)
    yield server
    server.kill()


@pytest.fixture
def teleoperator(server: Server, tmp_path: Path) -> Iterator[Teleoperator]:
    """Let LeRobot find and make the teleoperator by its name."""
    register_third_party_plugins()
    config = TeleoperatorConfig.get_choice_class("hbot")(
        id="test", calibration_dir=tmp_path / "calibration", address=server.address
    )
    made = make_teleoperator_from_config(config)
    yield made
    if made.is_connected:
        made.disconnect()


def test_what_is_turned_is_the_action_and_what_is_sent_is_felt(teleoperator: Teleoperator) -> None:
    assert isinstance(teleoperator, Teleoperator)
    with pytest.raises(DeviceNotConnectedError):
        teleoperator.get_action()
    with pytest.raises(DeviceNotConnectedError):
        teleoperator.send_feedback({})
    teleoperator.connect()
    with pytest.raises(DeviceAlreadyConnectedError):
        teleoperator.connect()
    action = teleoperator.get_action()
    assert action.keys() == teleoperator.action_features.keys()
    rig = teleoperator.rig
    # The hand of the simulated rig turns by 0.3 rad about the third axis, and holds.
    q = teleoperator._shown.q
    half = hbot.turns.exp((0.0, 0.0, 0.3))
    rig.hand(hbot.turns.times(half, q), over_ms=300, stiffness=50.0, damping=0.5)
    eventually(
        lambda: abs(teleoperator.get_action()["turn.z"] - 0.3) < 0.02, "the action is 0.3 rad"
    )
    assert abs(teleoperator.get_action()["turn.x"]) < 0.02
    eventually(lambda: teleoperator._newest().mode == "active", "the soft start is over")

    def felt(**feedback: float) -> float:
        teleoperator.get_action()
        named = {name.replace("_", "."): value for name, value in feedback.items()}
        teleoperator.send_feedback(named)
        return float(teleoperator._newest().torque[2])

    # The torque is felt as it is sent, because the hand holds the sphere.
    eventually(lambda: abs(felt(torque_z=0.1) - 0.1) < 0.01, "a torque of 0.1 N m is felt")
    # A spring pulls back to where it was attached: the last action was 0.3 rad.
    rig.hand(hbot.turns.times(hbot.turns.exp((0.0, 0.0, 0.4)), q), stiffness=50.0, damping=0.5)
    attached = teleoperator.get_action()["turn.z"]

    def pulled() -> bool:
        teleoperator.send_feedback({"stiffness": 1.0, "damping": 0.02})
        state = teleoperator._newest()
        away = hbot.turns.log(hbot.turns.times(state.q, teleoperator._begin))[2] - attached
        return away > 0.05 and abs(float(state.torque[2]) + away) < 0.02

    eventually(pulled, "a stiffness of 1 N m/rad pulls back")
    assert set(teleoperator.feedback_features) >= {"torque.x", "stiffness", "damping"}
    with hbot.connect(teleoperator.config.address) as other:
        other.estop()
    eventually(lambda: teleoperator._state.mode == "estop", "the state tells the stop")
    with pytest.raises(hbot.Faulted):
        teleoperator.get_action()
    teleoperator.disconnect()
    assert not teleoperator.is_connected
    with pytest.raises(DeviceNotConnectedError):
        teleoperator.disconnect()


def test_a_silence_is_no_action(server: Server, teleoperator: Teleoperator) -> None:
    teleoperator.connect()
    teleoperator.get_action()
    server.signal(signal.SIGSTOP)
    time.sleep(0.5)  # Its subject is time: the last state is old now.
    with pytest.raises(hbot.TimedOut):
        teleoperator.get_action()
    server.kill()
    eventually(lambda: not teleoperator.is_connected, "it notices the end")
    with pytest.raises(hbot.HbotError):
        teleoperator.get_action()
    with pytest.raises(hbot.NoServer):
        teleoperator.connect()
