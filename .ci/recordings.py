"""Reads a recording with the reader of MCAP's authors and checks every topic.

Arguments: the file, and the number of ticks of the run.
"""

import sys
from collections import defaultdict

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

EVERY_TICK = {
    "/hbot/state": "hbot.State",
    "/hbot/joints": "foxglove.JointState",
    "/tf": "foxglove.FrameTransforms",
    "/hbot/torque": "hbot.Torque",
}
OTHERS = {"/hbot/event": "foxglove.Log", "/hbot/scene": "hbot.Scene", "/hbot/exact": "hbot.Exact"}

path, ticks = sys.argv[1], int(sys.argv[2])
times, schemas, states, runs = defaultdict(list), {}, [], 0
with open(path, "rb") as file:
    reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
    summary = reader.get_summary()
    metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    for schema, channel, message, decoded in reader.iter_decoded_messages():
        times[channel.topic].append(message.log_time)
        schemas[channel.topic] = schema.name
        if channel.topic == "/hbot/state":
            states.append(decoded)
            stamp = decoded.timestamp.seconds * 10**9 + decoded.timestamp.nanos
            assert stamp == message.log_time, (stamp, message.log_time)
        if channel.topic == "/hbot/exact":
            runs += decoded.WhichOneof("record") == "run"
        if channel.topic == "/tf":
            assert [t.child_frame_id for t in decoded.transforms][:1] == ["sphere"], decoded

assert schemas == EVERY_TICK | OTHERS, schemas
for topic in EVERY_TICK:
    assert len(times[topic]) == ticks, (topic, len(times[topic]))
    assert all(a < b for a, b in zip(times[topic], times[topic][1:])), topic
for topic in OTHERS:
    assert all(a <= b for a, b in zip(times[topic], times[topic][1:])), topic
assert runs == ticks, runs
assert [state.tick for state in states] == list(range(ticks))
assert any(abs(state.torque.x) > 0 for state in states)
counts = summary.statistics.channel_message_counts
assert sum(counts.values()) == sum(map(len, times.values())), counts
about = metadata["hbot"]
assert about["format"] and about["version"] and about["rate_hz"] == "1000", about
print(f"{path}: {sum(counts.values())} messages on {len(schemas)} topics, {ticks} ticks")
