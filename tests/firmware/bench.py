"""A server on the port of a firmware, and a client that commands it. Standard library only."""

import json
import math
import os
import socket
import subprocess
import time

# Longest time for which a test waits for a condition, s. It is far longer than any of them takes,
# so that a busy machine does not fail a test.
PATIENCE = 60.0

# How often a rig that faults with `deadline` is enabled again.
ATTEMPTS = 20


def until(what, found):
    """Calls `found` until it returns something true, and returns that. Fails after PATIENCE."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        result = found()
        if result:
            return result
        time.sleep(0.01)
    raise AssertionError(f"not within {PATIENCE} s: {what}")


def angle_between(a, b):
    """Returns the angle between two orientations, rad. Both are unit quaternions [w, x, y, z]."""
    return 2.0 * math.acos(min(1.0, abs(sum(x * y for x, y in zip(a, b)))))


class Server:
    """An `hbot server` that drives the controller on `port`, with the rig file `rig`.

    The program is HBOT, or the one that `cargo test` has built. Its output and its flight logs go
    to `folder`.
    """

    def __init__(self, rig, port, folder, *options):
        self.log = os.path.join(folder, "server.log")
        program = os.environ.get("HBOT", "target/debug/hbot")
        with open(self.log, "w", encoding="utf-8") as log:
            self.process = subprocess.Popen(
                [program, "server", "--rig", rig, "--port", port, "--listen", "127.0.0.1:0",
                 *options],
                stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                env=dict(os.environ, XDG_STATE_HOME=folder))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(PATIENCE)

    def said(self):
        """Returns what the server has printed so far."""
        with open(self.log, encoding="utf-8") as log:
            return log.read()

    def address(self):
        """Waits until the server listens, and returns its port number."""
        def listens():
            assert self.process.poll() is None, f"the server has ended:\n{self.said()}"
            lines = [line.split() for line in self.said().splitlines(keepends=True)
                     if line.endswith("\n")]
            return next((words[1] for words in lines if words[:1] == ["listen"]), None)
        return int(until("the server listens", listens).rsplit(":", 1)[1])


class Client:
    """A client of the TCP API, in JSON. It keeps every state and every fault that it has seen."""

    def __init__(self, address):
        self.socket = socket.create_connection(("127.0.0.1", address), timeout=PATIENCE)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.lines = self.socket.makefile("r", encoding="utf-8", newline="\n")
        self.last_id = 0
        self.faults = []
        self.call("hello", version=1, name="a test")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def receive(self):
        """Returns the next message of the server."""
        line = self.lines.readline()
        assert line, "the server has closed the connection"
        message = json.loads(line)
        if message.get("event") == "fault":
            self.faults.append(message)
        return message

    def request(self, op, **fields):
        """Sends a request and returns the whole answer, which has `ok` or `error`."""
        self.last_id += 1
        request = {"id": self.last_id, "op": op, **fields}
        self.socket.sendall(json.dumps(request).encode() + b"\n")
        while True:
            message = self.receive()
            if message.get("id") == self.last_id:
                return message

    def call(self, op, **fields):
        """Sends a request and returns what the server answers. Fails if it refuses the request."""
        answer = self.request(op, **fields)
        assert "ok" in answer, f"{op}: {answer}"
        return answer["ok"]

    def state(self, what, found):
        """Waits for a state that `found` accepts, and returns it."""
        last = None
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            message = self.receive()
            if message.get("event") == "state":
                last = message
                if found(message):
                    return message
        raise AssertionError(f"not within {PATIENCE} s: {what}; faults {self.faults}; last {last}")


def spring(reference):
    """Returns a scene with a spring towards `reference`."""
    return {"name": "A spring", "effect": [
        {"id": "spring", "kind": "spring", "stiffness": 1.0, "damping": 0.02,
         "reference": reference}]}


class Deadline(Exception):
    """The loop lost ten ticks in a row: the fault `deadline`.

    The loop needs its share of the processor, which a busy machine does not give it. So this fault
    is about the machine and not about the firmware. A test resets it and counts it.
    """


class Spring:
    """A client that holds the rig with a spring and moves the spring's reference."""

    # 0.2 rad about each axis, to both sides.
    TARGETS = [[math.cos(0.1)] + [sign * math.sin(0.1) if k == axis else 0.0 for k in range(3)]
               for axis in range(3) for sign in (1.0, -1.0)]

    def __init__(self, client):
        self.client = client
        self.moves = 0
        self.reached = 0
        self.most = 0.0
        self.deadlines = 0
        client.call("acquire")
        client.call("subscribe", every=10)
        client.state("a rig with known zeros", is_ready)
        client.call("load_scene", scene={"name": "A spring", "effect": [
            {"id": "spring", "kind": "spring", "stiffness": 1.0, "damping": 0.02}]})
        self.start()

    def start(self):
        """Leaves a fault, whose cause must go away, and enables the spring where the sphere is."""
        for _ in range(ATTEMPTS):
            until("the rig can be reset", lambda: "ok" in self.client.request("reset"))
            here = self.client.state("a state", lambda _: True)["q"]
            self.client.call("set", effect="spring", reference=here)
            try:
                if "error" in (answer := self.client.request("enable")):
                    # Any other reason than a fault `deadline` that came after the reset.
                    assert answer["error"]["code"] == "faulted", answer
                self.client.state("an active rig", is_active)
                return
            except Deadline:
                self.deadlines += 1
        raise AssertionError(f"{ATTEMPTS} faults deadline, one after the other")

    def follow(self, seconds):
        """Moves the spring from orientation to orientation. The sphere must follow.

        Goes on for `seconds`, and until the sphere has reached three more orientations. Counts
        the orientations that the sphere has reached, and keeps the largest torque, N m.
        """
        end = time.monotonic() + seconds
        enough = self.reached + 3
        while time.monotonic() < end or self.reached < enough:
            target = self.next_target()
            try:
                self.client.state(f"the sphere at {target}", lambda state: self.at(target, state))
                self.reached += 1
            except Deadline:
                self.deadlines += 1
                self.start()

    def pull(self):
        """Moves the spring and returns when there is torque."""
        try:
            self.next_target()
            self.client.state("torque", lambda state: is_active(state) and torque(state) > 0.01)
        except Deadline:
            self.deadlines += 1
            self.start()
            self.pull()

    def next_target(self):
        """Moves the spring to the next orientation, and returns that."""
        self.moves += 1
        target = self.TARGETS[self.moves % len(self.TARGETS)]
        self.client.call("set", effect="spring", reference=target)
        return target

    def at(self, target, state):
        """Returns true if the active sphere is at `target`."""
        self.most = max(self.most, torque(state))
        # The way is 0.2 rad or more. The joints have no friction that could hold them away from it.
        return is_active(state) and angle_between(state["q"], target) < 0.02


def torque(state):
    """Returns the size of the torque on the sphere, N m."""
    return math.hypot(*state["torque"])


def is_ready(state):
    """Returns true if the rig can be enabled, perhaps after a reset. Fails in any other fault."""
    assert state["fault"] in (None, "deadline"), state
    return state["mode"] in ("idle", "fault")


def is_active(state):
    """Returns true if the rig renders, and false if it is about to. Fails in any fault."""
    if state["fault"] == "deadline":
        raise Deadline
    assert state["mode"] in ("idle", "enabling", "active"), state
    return state["mode"] == "active"
