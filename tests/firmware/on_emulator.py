"""The firmware images on emulated boards, driven by the server. All images run at the same time.

    python3 tests/firmware/on_emulator.py [--seconds N] ELF...

For each image: a spring for N seconds in total (60 if not given), with a reset of the board after a
third of it and a pause of the board after two thirds. No timing is asserted.
"""

import argparse
import json
import os
import signal
import socket
import subprocess
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor

from bench import Client, Deadline, Server, Spring, until
from link import WATCHDOG_EXPIRED, Line

RIG = "firmware/mps2/rig.toml"
# From the rig file: the number of joints, and the watchdog time of a command, s.
JOINTS = 4
WATCHDOG = 1.0


class Board:
    """An emulated mps2-an386 that runs the image `elf`. Its UART 0 is a pseudo-terminal."""

    def __init__(self, elf, folder):
        control = os.path.join(folder, "control")
        log = os.path.join(folder, "qemu.log")
        with open(log, "w", encoding="utf-8") as output:
            self.process = subprocess.Popen(
                ["qemu-system-arm", "-M", "mps2-an386", "-kernel", elf, "-display", "none",
                 "-monitor", "none", "-serial", "pty", "-qmp", f"unix:{control},server=on,wait=off"],
                stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT)

        def port():
            assert self.process.poll() is None, open(log, encoding="utf-8").read()
            with open(log, encoding="utf-8") as output:
                words = output.read().split()
            return next((word for word in words if word.startswith("/dev/pts/")), None)
        self.port = until("the emulator has a terminal", port)
        until("the emulator can be controlled", lambda: os.path.exists(control))
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.connect(control)
        self.lines = self.socket.makefile("r", encoding="utf-8")
        assert "QMP" in json.loads(self.lines.readline())
        self.order("qmp_capabilities")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()
        self.process.terminate()
        self.process.wait()

    def order(self, command):
        """Sends a command to the emulator and waits for its answer (QEMU's protocol QMP)."""
        self.socket.sendall(json.dumps({"execute": command}).encode() + b"\n")
        while True:
            answer = json.loads(self.lines.readline())
            assert "error" not in answer, answer
            if "return" in answer:
                return


def expect_fault(client, cause):
    """Waits for a fault, which must be of `cause`. From then on there must be no torque."""
    def faulted(state):
        if state["fault"] == "deadline":
            raise Deadline
        assert state["fault"] in (None, cause), client.faults
        return state["mode"] == "fault"
    state = client.state(f"the fault {cause}", faulted)
    for _ in range(5):
        assert state["mode"] == "fault" and state["torque"] == [0.0, 0.0, 0.0], state
        assert all(joint["torque"] == 0.0 for joint in state["joints"]), state
        state = client.state("the next state", lambda _: True)


def reset_board(board, client, spring):
    """A board that starts anew in a run has forgotten its description: `controller_fault`."""
    spring.pull()
    board.order("system_reset")
    expect_fault(client, "controller_fault")


def pause_board(board, server, client, spring):
    """A board that stands still is a lost link. When it goes on, its watchdog expires.

    The clock of an emulated board stands still with it. So the server stands still too while the
    board goes on, and what it has sent meanwhile is dropped: the board hears nobody. The test asks
    the board itself, because a server in a fault only sends commands with `enable` false.
    """
    spring.pull()
    board.order("stop")
    try:
        expect_fault(client, "link_lost")
        server.process.send_signal(signal.SIGSTOP)
        os.waitpid(server.process.pid, os.WUNTRACED)
        with Line(board.port) as line:
            line.drop()
            board.order("cont")
            # Time itself is the subject: three times the watchdog time, by the board's clock.
            time.sleep(3 * WATCHDOG)
            flags = line.ask_with_torque(1, JOINTS)
        assert flags == WATCHDOG_EXPIRED, f"controller flags {flags:#06x} after the pause"
    finally:
        board.order("cont")
        server.process.send_signal(signal.SIGCONT)


class Runs:
    """Runs of the server on one board. Adds up what they found."""

    def __init__(self, elf, folder):
        self.board = Board(elf, folder)
        self.folder = folder
        self.totals = dict.fromkeys(
            ("reached", "deadlines", "ticks", "missed_ticks", "corrupt_frames"), 0)
        self.most = 0.0

    def run(self, course):
        """Runs a server and calls `course(server, client, spring)`."""
        with Server(RIG, self.board.port, self.folder) as server, \
                Client(server.address()) as client:
            spring = Spring(client)
            course(server, client, spring)
            found = {**client.call("stats"), "reached": spring.reached,
                     "deadlines": spring.deadlines}
        self.most = max(self.most, spring.most)
        for name in self.totals:
            self.totals[name] += found[name]


def repeat_at_deadline(spring, disturb):
    """Calls `disturb` until no fault `deadline` comes in between."""
    while True:
        try:
            return disturb()
        except Deadline:
            spring.deadlines += 1
            spring.start()


def exercise(elf, seconds):
    """Runs the whole test with one image, and returns what it found as a line of text."""
    with tempfile.TemporaryDirectory() as folder:
        runs = Runs(elf, folder)
        board = runs.board

        def until_reset(_, client, spring):
            spring.follow(seconds / 3)
            repeat_at_deadline(spring, lambda: reset_board(board, client, spring))

        def with_a_pause(server, client, spring):
            spring.follow(seconds / 3)
            repeat_at_deadline(spring, lambda: pause_board(board, server, client, spring))
            spring.start()
            spring.follow(seconds / 3)

        with board:
            runs.run(until_reset)
            # The joints have forgotten their zeros, so the server begins anew.
            runs.run(with_a_pause)
    totals = runs.totals
    assert totals["reached"] >= 3 and runs.most > 0.01, f"{totals}, {runs.most} N m"
    return (f"{elf}: a spring for {seconds:.0f} s, {totals['reached']} orientations reached, "
            f"{runs.most:.3f} N m at most; a reset was controller_fault, a pause link_lost and an "
            f"expired watchdog. {totals['missed_ticks']} of {totals['ticks']} ticks without a new "
            f"reading, {totals['corrupt_frames']} damaged frames, {totals['deadlines']} faults "
            "deadline")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("elf", nargs="+")
    arguments = parser.parse_args()
    with ThreadPoolExecutor(len(arguments.elf)) as pool:
        runs = [pool.submit(exercise, elf, arguments.seconds) for elf in arguments.elf]
        for run in runs:
            print(run.result())


if __name__ == "__main__":
    main()
