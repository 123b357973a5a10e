"""Publishes states and markers as streams of the Lab Streaming Layer (LSL). Needs the extra `lsl`.

    python -m hbot.lsl 127.0.0.1:4268

offers two streams until it is interrupted:

`Hbot` (type `Haptics`, double64)
    One sample for each state. The description of the stream names each channel and its unit: tick,
    t, q (w, x, y, z), omega, torque (frame N), energy, and angle, rate and torque of every joint.

`HbotMarkers` (type `Markers`, string)
    One sample for each fault, stop, scene and change of the lease, and for each marker of a client.

Time stamps are those of LSL's own clock, `local_clock()`. `hbot.clock` says how the time of a state
becomes one. A marker of a fault or a scene has the time of its tick; all others that of arrival.

The API of the server has no op for markers. So a client that wants one connects to this program by
TCP (127.0.0.1:4270, option `--markers`) and sends one line of text for each marker.
"""
