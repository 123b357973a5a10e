#!/usr/bin/env python3
"""python-can's slcan and cantools with the DBC of ODrive firmware 0.6.10 drive virtual ODrives: heartbeat, version,
position, torque, watchdog, error.

    odrive_client.py PORT
"""

import importlib.util
import pathlib
import sys
import time

import can
import cantools

# Axis 0 steers (0.93 N m at a gear of 1), axis 1 drives (0.14 N m at a gear of 17).
STEER, DRIVE = 0, 1
FOLDER = pathlib.Path(importlib.util.find_spec("odrive_can").submodule_search_locations[0])
DBC = cantools.database.load_file(FOLDER / "dbc" / "odrive-cansimple-0.6.10.dbc")
PATIENCE = 20.0

bus = can.Bus(interface="slcan", channel=sys.argv[1], bitrate=1_000_000, sleep_after_open=0.1)


def say(name, axis, **values):
    message = DBC.get_message_by_name(f"Axis0_{name}")
    bus.send(can.Message(arbitration_id=axis << 5 | message.frame_id & 0x1f, is_extended_id=False,
                         data=message.encode(values)))


def ask(name, axis):
    message = DBC.get_message_by_name(f"Axis0_{name}")
    bus.send(can.Message(arbitration_id=axis << 5 | message.frame_id & 0x1f, is_extended_id=False,
                         is_remote_frame=True, dlc=message.length))


def received():
    """The next message. A line whose bytes a busy machine was too slow to take is damaged, as on a real adapter."""
    try:
        return bus.recv(timeout=0.01)
    except (ValueError, IndexError):
        return None


def answer(what, name, axis):
    """What an axis answers; it is asked again where the answer is lost."""
    asked = 0.0

    def again():
        nonlocal asked
        if time.monotonic() > asked + 0.5:
            asked = time.monotonic()
            ask(name, axis)
    return hear(what, name, axis, meanwhile=again)


def hear(what, name, axis, right=lambda said: True, meanwhile=lambda: None):
    """The next message of this name from this axis that is right."""
    form = DBC.get_message_by_name(f"Axis0_{name}")
    end, said = time.monotonic() + PATIENCE, None
    while time.monotonic() < end:
        meanwhile()
        message = received()
        if message is None or message.arbitration_id != axis << 5 | form.frame_id & 0x1f or message.dlc != 8 \
                or len(message.data) != 8:
            continue
        said = form.decode(bytes(message.data), decode_choices=False)
        if right(said):
            return said
    raise AssertionError(f"{what}: {name} of axis {axis} is {said}")


IDLE, CLOSED_LOOP = 1, 8
WATCHDOG, ESTOP = 1 << 24, 1 << 25

for axis in range(4):
    hear("power-on", "Heartbeat", axis, lambda said: said["Axis_State"] == IDLE)
    version = answer("version", "Get_Version", axis)
    assert (version["Fw_Version_Major"], version["Fw_Version_Minor"]) == (0, 6), version
    assert answer("supply", "Get_Bus_Voltage_Current", axis)["Bus_Voltage"] == 24.0
print("heartbeat and version: four axes")

# Before any torque: a rolling wheel turns hundreds of times a second.
say("Set_Absolute_Position", DRIVE, Position=34.0)
hear("set", "Get_Encoder_Estimates", DRIVE, lambda said: abs(said["Pos_Estimate"] - 34.0) < 1e-3)
print("position: set")


def keep(torque, *states):
    """Feeds the watchdog, and now and then clears errors and asks for states: a busy machine feeds late."""
    asked = 0.0

    def again():
        nonlocal asked
        say("Set_Input_Torque", STEER, Input_Torque=torque)
        if time.monotonic() > asked + 0.2:
            asked = time.monotonic()
            say("Clear_Errors", STEER, Identify=0)
            say("Set_Controller_Mode", STEER, Control_Mode=1, Input_Mode=1)
            for state in states:
                say("Set_Axis_State", STEER, Axis_Requested_State=state)
    return again


def feed():
    say("Set_Input_Torque", STEER, Input_Torque=0.0)


hear("cleared", "Heartbeat", STEER, lambda said: said["Axis_Error"] == 0, keep(0.0))
hear("on", "Heartbeat", STEER, lambda said: said["Axis_State"] == CLOSED_LOOP, keep(0.0, CLOSED_LOOP))
before = hear("where it is", "Get_Encoder_Estimates", STEER, meanwhile=feed)["Pos_Estimate"]
moved = hear("pushed", "Get_Encoder_Estimates", STEER,
             lambda said: said["Pos_Estimate"] > before + 0.01 and said["Vel_Estimate"] > 0, keep(0.2, CLOSED_LOOP))
print(f"torque: it turns from {before:.3f} to {moved['Pos_Estimate']:.3f} turns")

said = hear("left alone", "Heartbeat", STEER, lambda said: said["Axis_State"] == IDLE)
assert said["Axis_Error"] == WATCHDOG, said
assert answer("reason", "Get_Error", STEER)["Disarm_Reason"] == WATCHDOG
say("Set_Axis_State", STEER, Axis_Requested_State=CLOSED_LOOP)
for _ in range(5):
    assert hear("not cleared", "Heartbeat", STEER, meanwhile=feed)["Axis_State"] == IDLE
print("watchdog: it expires, and closed loop is refused until errors are cleared")

hear("on again", "Heartbeat", STEER, lambda said: said["Axis_State"] == CLOSED_LOOP, keep(0.0, CLOSED_LOOP))
say("Estop", STEER)
said = hear("estop", "Heartbeat", STEER, lambda said: said["Axis_State"] == IDLE, feed)
assert said["Axis_Error"] & ESTOP, said
hear("cleared", "Heartbeat", STEER, lambda said: said["Axis_Error"] == 0, keep(0.0))
print("error: an emergency stop, cleared")

bus.shutdown()
