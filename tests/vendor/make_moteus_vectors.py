#!/usr/bin/env python3
"""Makes tests/vendor/moteus.json with the vendor's own Python library (pip install moteus==1.1.1): lines to moteus servos as
its encoder writes them, and lines from them with what its decoder reads there. The tests of hbot-host compare the driver with
both. Floats stand as the bits of IEEE 754 singles.

    python3 -m venv /tmp/moteus && /tmp/moteus/bin/pip install moteus==1.1.1
    /tmp/moteus/bin/python tests/vendor/make_moteus_vectors.py > tests/vendor/moteus.json
"""

import io
import json
import math
import random
import struct

import moteus
from moteus import multiplex as mp
from moteus.fdcanusb_device import FdcanusbDevice, _append_checksum
from moteus.protocol import Register, Writer, parse_reply

FRAMES = 256


def bits(value):
    return struct.unpack("<I", struct.pack("<f", value))[0]


def single(pattern):
    return struct.unpack("<f", struct.pack("<I", pattern))[0]



TURNS = ["home", "uptime", "current"]


def questions(turn):
    """What a command asks for: the home state with the temperature, the time since power-on, or the motor current."""
    query = moteus.QueryResolution()
    query.mode, query.fault, query.voltage = mp.INT8, mp.INT8, mp.IGNORE
    query.position, query.velocity, query.torque = mp.INT32, mp.INT32, mp.INT32
    query.temperature, query.home_state = (mp.INT8, mp.INT8) if turn == "home" else (mp.IGNORE, mp.IGNORE)
    if turn == "current":
        query.q_current = mp.INT32
    query._extra = {Register.COMMAND_TIMEOUT: mp.F32}
    if turn == "uptime":
        query._extra[Register.MILLISECOND_COUNTER] = mp.INT32
    return query


FORMAT = moteus.PositionResolution()
FORMAT.position, FORMAT.kp_scale, FORMAT.kd_scale, FORMAT.ilimit_scale = (mp.INT8,) * 4


class Lines(FdcanusbDevice):
    """The vendor's writer of lines, on a buffer in place of a port."""

    def __init__(self, checksums):
        self._checksum_active = checksums
        self._disable_brs, self._debug_log, self._padding_hex = False, None, "50"
        self._serial = io.BytesIO()

    def line(self, command):
        frame = moteus.transport_device.Frame(
            arbitration_id=command_id(command), data=command.data, dlc=len(command.data),
            is_extended_id=False, is_fd=True, bitrate_switch=True)
        write = self._write_send_frame(frame)
        try:
            write.send(None)
        except StopIteration:
            pass
        line = self._serial.getvalue().decode()
        self._serial = io.BytesIO()
        return line


def command_id(command):
    return command.destination | (0x8000 if command.reply_required else 0)


def lines(command):
    return [Lines(False).line(command), Lines(True).line(command)]


def torque_command(random):
    servo = random.randrange(1, 127)
    torque, most = bits(random.uniform(-3, 3)), bits(random.choice([0.05, 0.93, 1.7, 12.0]))
    if random.random() < 0.1:
        torque = bits(random.choice([0.0, -0.0, 1e-30, -1e30]))
    watchdog = bits(random.choice([1, 20, 50, 1000]) / 1000) & ~0xFFF | random.randrange(0x1000)
    turn = random.choice(TURNS)
    controller = moteus.Controller(id=servo, query_resolution=questions(turn), position_resolution=FORMAT)
    command = controller.make_position(
        position=math.nan, feedforward_torque=single(torque), kp_scale=0, kd_scale=0, maximum_torque=single(most),
        watchdog_timeout=single(watchdog), ilimit_scale=0, query=True)
    return {"id": servo, "torque": torque, "most": most, "watchdog": watchdog, "turn": turn,
            "lines": lines(command)}


def stop_command(random):
    servo, rezero = random.randrange(1, 127), random.random() < 0.3
    watchdog = bits(0.02) & ~0xFFF | random.randrange(0x1000)
    turn = random.choice(TURNS)
    controller = moteus.Controller(id=servo, query_resolution=questions(turn))
    command = controller.make_stop(query=True)
    stop, query = controller.make_stop(query=False).data, controller.make_query().data
    assert command.data == stop + query
    buffer = io.BytesIO()
    writer = Writer(buffer)
    writer.write_int8(mp.WRITE_F32 | 1)
    writer.write_varuint(int(Register.COMMAND_TIMEOUT))
    writer.write_f32(single(watchdog))
    nearest = controller.make_set_output_nearest(position=0.0, query=False).data if rezero else b""
    command.data = stop + buffer.getvalue() + nearest + query
    return {"id": servo, "watchdog": watchdog, "rezero": rezero, "turn": turn, "lines": lines(command)}


def answer(random):
    """An answer as a servo makes it: registers in subframes of replies."""
    servo, buffer = random.randrange(1, 127), io.BytesIO()
    writer = Writer(buffer)

    def block(first, values):
        kinds = [kind for _, kind in values]
        combiner = mp.WriteCombiner(writer, mp.REPLY_BASE, first, kinds)
        for value, kind in values:
            if combiner.maybe_write():
                writer.write(value, kind)

    whole = lambda width: random.choice([-(2 ** (width - 1)), 2 ** (width - 1) - 1, 0, -1, random.randrange(-(2 ** (width - 1)), 2 ** (width - 1))])
    if random.random() < 0.1:
        # A register that this servo does not have.
        buffer.write(bytes([mp.READ_ERROR, 0x70, 1]))
    turn, fault = random.choice(TURNS), (random.choice([0, 33, 39, 99, 102]), mp.INT8)
    # Position, velocity, torque, and the motor current in its turn.
    words = 4 if turn == "current" else 3
    block(0x000, [(random.randrange(16), mp.INT8)] + [(whole(32), mp.INT32) for _ in range(words)])
    if turn != "home":
        block(0x00F, [fault])
    else:
        block(0x00C, [(random.randrange(3), mp.INT8)])
        block(0x00E, [(whole(8), mp.INT8), fault])
    block(0x027, [(single(bits(random.uniform(0, 1))), mp.F32)])
    if turn == "uptime":
        block(0x070, [(whole(32), mp.INT32)])
    assert len(buffer.getvalue()) <= (35 if buffer.getvalue()[0] == mp.READ_ERROR else 32)
    if random.random() < 0.2:
        block(0x100, [(whole(32), mp.INT32)] * 3)
    data = buffer.getvalue()
    length = next(n for n in [8, 12, 16, 20, 24, 32, 48, 64] if n >= len(data))
    data += b"\x50" * (length - len(data))
    line = "rcv {:X} {} E B F".format(servo << 8, data.hex().upper())
    if random.random() < 0.5:
        line = _append_checksum(line.encode()).decode()
    # Raw values: what the driver reads before it scales them.
    raw = {}
    for subframe in mp.parse_frame(data):
        if isinstance(subframe, mp.RegisterSubframe) and subframe.type == mp.SubframeType.RESPONSE:
            raw[subframe.register] = bits(subframe.value) if subframe.resolution == mp.F32 else subframe.value
    scaled = parse_reply(data)
    assert set(scaled) == set(raw)
    turns = scaled[Register.POSITION]
    return {"id": servo, "line": line, "registers": {f"{key:#05x}": value for key, value in raw.items()},
            "turns": None if math.isnan(turns) else turns}


if __name__ == "__main__":
    source = random.Random(1)
    vectors = {
        "torque": [torque_command(source) for _ in range(FRAMES)],
        "stop": [stop_command(source) for _ in range(FRAMES)],
        "answers": [answer(source) for _ in range(FRAMES)],
    }
    print("{")
    for at, (name, rows) in enumerate(vectors.items()):
        body = ",\n".join("    " + json.dumps(row) for row in rows)
        print(f'  "{name}": [\n{body}\n  ]' + ("," if at < len(vectors) - 1 else ""))
    print("}")
