#!/usr/bin/env python3
"""Makes tests/vendor/odrive.json with software that is not hbot's: cantools with the DBC of ODrive firmware 0.6.10, which the
package odrive-can carries, says what the bytes of a message are, and python-can's slcan how its line looks. The tests of
hbot-host compare the driver with both. Floats stand as the bits of IEEE 754 singles.

    python3 -m venv /tmp/odrive && /tmp/odrive/bin/pip install cantools==45.1.0 python-can==4.6.1 pyserial==3.5
    /tmp/odrive/bin/pip install --no-deps odrive-can==2.1.0
    /tmp/odrive/bin/python tests/vendor/make_odrive_vectors.py > tests/vendor/odrive.json
"""

import importlib.util
import json
import math
import pathlib
import random
import struct

import can
import cantools
from can.interfaces.slcan import slcanBus

EACH = 40
random.seed(17)
folder = pathlib.Path(importlib.util.find_spec("odrive_can").submodule_search_locations[0])
DBC = cantools.database.load_file(folder / "dbc" / "odrive-cansimple-0.6.10.dbc")
# A port that gives back what is written to it.
bus = slcanBus("loop://", sleep_after_open=0)
port = bus.serialPortOrig
port.reset_input_buffer()
# A busy machine takes more than the millisecond of the adapter.
port.timeout = 1


def bits(value):
    return struct.unpack("<I", struct.pack("<f", value))[0]


def single():
    """A number as motors have them, and now and then the ends of the range."""
    odd = [0.0, -0.0, 1e-30, -1e30, math.inf, 1.0]
    value = random.choice(odd) if random.random() < 0.1 else random.uniform(-1, 1) * 10 ** random.randint(-4, 4)
    return struct.unpack("<f", struct.pack("<f", value))[0]


def frame(name, axis, values):
    message = DBC.get_message_by_name(f"Axis0_{name}")
    return can.Message(arbitration_id=axis << 5 | message.frame_id & 0x1f, is_extended_id=False,
                       data=message.encode(values, strict=False) if values is not None else b"",
                       is_remote_frame=values is None, dlc=message.length)


def written(message):
    """The line that python-can writes."""
    bus.send(message)
    return port.read(port.in_waiting).decode()


def read(line):
    """What cantools makes of a line that python-can has read, as integers and the bits of floats."""
    port.write(line.encode())
    message = bus.recv(timeout=1)
    form = DBC.get_message_by_frame_id(message.arbitration_id & 0x1f)
    said = form.decode(bytes(message.data), decode_choices=False)
    floats = {signal.name: signal.is_float for signal in form.signals}
    return {name: bits(value) if floats[name] else value for name, value in said.items()}


def to_axes():
    for _ in range(EACH):
        torque, position = single(), single()
        yield "InputTorque", bits(torque), frame("Set_Input_Torque", axis(), {"Input_Torque": torque})
        yield "AbsolutePosition", bits(position), frame("Set_Absolute_Position", axis(), {"Position": position})
        state = random.choice([1, 8])
        yield "AxisState", state, frame("Set_Axis_State", axis(), {"Axis_Requested_State": state})
        for name, message in [("Estop", "Estop"), ("ClearErrors", "Clear_Errors"), ("TorqueMode", "Set_Controller_Mode")]:
            values = {"Estop": {}, "Clear_Errors": {"Identify": 0},
                      "Set_Controller_Mode": {"Control_Mode": 1, "Input_Mode": 1}}[message]
            yield name, 0, frame(message, axis(), values)
        asked = random.choice(["Version", "Error", "Iq", "Temperature", "Bus_Voltage_Current"])
        yield f"Ask {asked}", 0, frame(f"Get_{asked}", axis(), None)


def from_axes():
    word = lambda: random.getrandbits(32)
    byte = lambda: random.getrandbits(8)
    for _ in range(EACH):
        yield "Heartbeat", {"Axis_Error": word(), "Axis_State": byte(), "Procedure_Result": byte(), "Trajectory_Done_Flag": 0}
        yield "Get_Encoder_Estimates", {"Pos_Estimate": single(), "Vel_Estimate": single()}
        yield "Get_Error", {"Active_Errors": word(), "Disarm_Reason": word()}
        yield "Get_Iq", {"Iq_Setpoint": single(), "Iq_Measured": single()}
        yield "Get_Temperature", {"FET_Temperature": single(), "Motor_Temperature": single()}
        yield "Get_Bus_Voltage_Current", {"Bus_Voltage": single(), "Bus_Current": single()}
        form = DBC.get_message_by_name("Axis0_Get_Version")
        yield "Get_Version", {signal.name: byte() for signal in form.signals}


def axis():
    return random.randrange(64)


def rows(all):
    return "[\n    " + ",\n    ".join(json.dumps(row) for row in all) + "\n  ]"


commands = [{"command": name, "value": value, "axis": message.arbitration_id >> 5, "line": written(message)}
            for name, value, message in to_axes()]
messages = []
for name, values in from_axes():
    line = written(message := frame(name, axis(), values))
    messages.append({"message": name, "axis": message.arbitration_id >> 5, "line": line, "says": read(line)})
print(f'{{\n  "commands": {rows(commands)},\n  "messages": {rows(messages)}\n}}')
bus.shutdown()
