#!/usr/bin/env python3
"""The vendor's own client, unchanged, drives virtual moteus servos: query, zero, torque, watchdog, fault.
Then the vendor's moteus_tool, unchanged, asks them, stops one and moves its zero.

    moteus_client.py PORT
"""

import asyncio
import json
import math
import subprocess
import sys

import moteus
from moteus import Mode, Register

# Servo 1 steers (0.93 N m at a gear of 1), servo 2 drives (0.14 N m at a gear of 17).
STEER, DRIVE = 1, 2


def torque(value, **more):
    return dict(position=math.nan, kp_scale=0.0, kd_scale=0.0, ilimit_scale=0.0, feedforward_torque=value,
                query=True, **more)


async def state(servo, mode, what):
    """The servo's state, which must be in this mode."""
    values = (await servo.query()).values
    assert values[Register.MODE] == mode, f"{what}: {values}"
    return values


async def main(port):
    transport = moteus.Fdcanusb(port)
    query = moteus.QueryResolution()
    query._extra = {Register.MODEL_NUMBER: moteus.INT32, Register.REGISTER_MAP_VERSION: moteus.INT32,
                    Register.COMMAND_TIMEOUT: moteus.F32, Register.MILLISECOND_COUNTER: moteus.INT32}
    servos = {id: moteus.Controller(id=id, transport=transport, query_resolution=query) for id in range(1, 5)}
    steer = servos[STEER]

    for id, servo in servos.items():
        await servo.set_stop()
        values = await state(servo, Mode.STOPPED, f"servo {id} after a stop")
        assert values[Register.REGISTER_MAP_VERSION] == 5 and values[Register.FAULT] == 0, values
        assert values[Register.VOLTAGE] == 24.0 and abs(values[Register.POSITION]) <= 0.5, values
    print("query: four servos answer")

    # Before any torque: a rolling wheel turns hundreds of times a second.
    drive = servos[DRIVE]
    values = (await drive.query()).values
    assert values[Register.VELOCITY] == 0.0, values
    where = values[Register.POSITION]
    await drive.set_output_exact(position=where + 5.3)
    moved = (await drive.query()).values[Register.POSITION]
    assert abs(moved - where - 5.3) < 1e-4, (where, moved)
    await drive.set_output_nearest(position=0.0)
    nearest = (await drive.query()).values[Register.POSITION]
    assert abs(nearest) <= 0.5 and abs((moved - nearest) - round(moved - nearest)) < 1e-4, (moved, nearest)
    print("zero: set exactly, and to the nearest turn")

    before = (await steer.query()).values[Register.POSITION]
    for _ in range(20):
        await steer.set_position(**torque(0.2, watchdog_timeout=0.5))
        await asyncio.sleep(0.005)
    values = await state(steer, Mode.POSITION, "pushing")
    assert abs(values[Register.TORQUE] - 0.2) < 1e-3, values
    assert values[Register.POSITION] > before and values[Register.VELOCITY] > 0, (before, values)
    assert abs(values[Register.COMMAND_TIMEOUT] - 0.5) < 1e-6, values
    await steer.set_position(**torque(5.0, maximum_torque=0.1, watchdog_timeout=0.5))
    values = await state(steer, Mode.POSITION, "within the largest torque")
    assert abs(values[Register.TORQUE] - 0.1) < 1e-3 and values[Register.FAULT] == 102, values
    print("torque: it pushes, turns, and keeps the largest torque")

    await steer.set_position(**torque(0.0, watchdog_timeout=0.05))
    await asyncio.sleep(0.2)
    values = await state(steer, Mode.TIMEOUT, "200 ms after a command of 50 ms")
    assert values[Register.TORQUE] == 0.0, values
    await steer.set_position(**torque(0.2, watchdog_timeout=0.5))
    await state(steer, Mode.TIMEOUT, "a command does not end a time-out")
    await steer.set_stop()
    await state(steer, Mode.STOPPED, "a stop does")
    print("watchdog: it expires, stays so, and a stop ends it")

    stream = moteus.Stream(steer, use_flow_control=False)
    assert float(await stream.command(b"conf get servo.timeout_mode", allow_any_response=True)) == 0
    await stream.command(b"conf set servopos.position_min 1000")
    await steer.set_position(**torque(0.1, watchdog_timeout=0.5))
    values = await state(steer, Mode.FAULT, "outside of its limits")
    assert values[Register.FAULT] == 39, values
    await stream.command(b"conf set servopos.position_min nan")
    await steer.set_stop()
    values = await state(steer, Mode.STOPPED, "a stop clears the fault")
    assert values[Register.FAULT] == 0, values
    print("fault: 39 outside of servopos limits, cleared by a stop")

    # The tool stops this one, and must find the whole turns again after its own zero.
    await steer.set_position(**torque(0.1, watchdog_timeout=math.nan))
    await state(steer, Mode.POSITION, "before the tool")
    transport.close()


def tool(port, *action):
    """What moteus_tool prints for servo STEER."""
    command = [sys.executable, "-m", "moteus.moteus_tool", "--fdcanusb", port, "-t", str(STEER), *action]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=30).stdout


async def look(port):
    transport = moteus.Fdcanusb(port)
    values = (await moteus.Controller(id=STEER, transport=transport).query()).values
    transport.close()
    return values


def resting(port):
    """The position in turns at which the servo has come to rest."""
    before = math.nan
    for _ in range(60):
        values = asyncio.run(look(port))
        if abs(values[Register.POSITION] - before) < 1e-3:
            return values[Register.POSITION]
        before = values[Register.POSITION]
    raise AssertionError(f"it does not come to rest: {values}")


def tools(port):
    tool(port, "--stop")
    values = asyncio.run(look(port))
    assert values[Register.MODE] == Mode.STOPPED and values[Register.TORQUE] == 0.0, values
    info = json.loads(tool(port, "--info"))
    assert info["model"] == "4" and info["serial_number"] == "A" * 15 + "B", info
    assert info["uuid"] == "68626f74-0000-0000-0000-000000000001", info
    settings = dict(line.split() for line in tool(port, "--dump-config").splitlines() if line)
    assert (settings["servo.timeout_mode"], settings["id.id"]) == ("0", "1"), settings
    assert settings["motor_position.output.offset"] == "0", settings
    # The tools take a second each, and a wheel that still rolls would have turned further.
    before = resting(port)
    tool(port, "--zero-offset")
    after = asyncio.run(look(port))
    assert abs(after[Register.POSITION]) < 2e-2 + abs(after[Register.VELOCITY]), (before, after)
    settings = dict(line.split() for line in tool(port, "--dump-config").splitlines() if line)
    offset = float(settings["motor_position.output.offset"])
    away = offset + before
    assert abs(away - round(away)) < 2e-2 + abs(after[Register.VELOCITY]), (before, offset)
    print("moteus_tool: --stop, --info, --dump-config, --zero-offset")


asyncio.run(main(sys.argv[1]))
tools(sys.argv[1])
