"""An Arduino sketch on a pseudo-terminal, driven by the server at 1 kHz.

    python3 tests/firmware/on_terminal.py PROGRAM [SECONDS]

PROGRAM is a sketch with tests/arduino/board/on_terminal.cpp.
"""

import subprocess
import sys
import tempfile

from bench import Client, Server, Spring


def main():
    program = sys.argv[1]
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 10.0
    with tempfile.TemporaryDirectory() as folder:
        device = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                  text=True)
        try:
            port = device.stdout.readline().strip()
            with Server("firmware/mps2/rig.toml", port, folder,
                        "--rate", "1000") as server:
                with Client(server.address()) as client:
                    assert client.call("info")["rig"]["rate_hz"] == 1000.0
                    spring = Spring(client)
                    spring.follow(seconds)
                    stats = client.call("stats")
        finally:
            device.stdin.close()
            assert device.wait(60) == 0, "the controller's process found an error"
    assert spring.reached >= 3 and spring.most > 0.01, vars(spring)
    assert stats["corrupt_frames"] == 0 and stats["foreign_frames"] == 0, stats
    print(f"a spring for {seconds:.0f} s at 1 kHz: {spring.reached} orientations reached, "
          f"{spring.most:.3f} N m at most; {stats['missed_ticks']} of {stats['ticks']} ticks "
          f"without a new reading, {spring.deadlines} faults deadline, no damaged frame")


if __name__ == "__main__":
    main()
