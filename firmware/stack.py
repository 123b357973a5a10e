#!/usr/bin/env python3
"""Measures how much RAM a firmware image uses, with its stack, while it talks to a host.

    firmware/stack.py ELF BOTTOM TOP

BOTTOM and TOP are the symbols of the ELF file at which the stack's memory begins and ends. The image
runs in QEMU, whose memory is zero at the start. So the stack has reached down to the lowest word that
is not zero. Prints the greatest size of the stack, in bytes.
"""

import os
import re
import select
import subprocess
import sys
import tempfile
import time
import tty

# Seconds to wait for an answer of the emulator. No requirement on its speed.
PATIENCE = 60


def vector(name):
    """Returns the bytes of a frame in docs/link.md."""
    page = os.path.join(os.path.dirname(__file__), "../docs/link.md")
    with open(page, encoding="utf-8") as text:
        section = text.read().split(f"### `{name}`")[1]
    return bytes.fromhex(section.split("frame")[1].split("```")[0])


def symbols(elf):
    """Returns the addresses of all symbols of an ELF file."""
    lines = subprocess.check_output(["arm-none-eabi-nm", elf], text=True).splitlines()
    return {words[-1]: int(words[0], 16) for words in map(str.split, lines) if len(words) == 3}


def ask(port, frame):
    """Sends a frame and returns the answer, without its delimiter."""
    os.write(port, frame)
    answer, deadline = b"", time.monotonic() + PATIENCE
    while not answer.endswith(b"\0"):
        if not select.select([port], [], [], max(0, deadline - time.monotonic()))[0]:
            raise SystemExit(f"no answer to {frame.hex(' ')}")
        answer += os.read(port, 4096)
    return answer.strip(b"\0")


def talk(port):
    """Sends everything that a controller can receive."""
    ask(port, vector("describe"))
    for _ in range(50):
        os.write(port, b"\xAA" * 400 + b"\0" + vector("command_wrap"))
        ask(port, vector("command_enable"))
        ask(port, vector("command_disable"))


def memory(qemu, address, length):
    """Returns the emulator's memory."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "memory")
        qemu.stdin.write(f'pmemsave {address} {length} "{path}"\nquit\n')
        qemu.stdin.flush()
        qemu.wait(PATIENCE)
        with open(path, "rb") as file:
            return file.read()


def main():
    elf, bottom, top = sys.argv[1:]
    at = symbols(elf)
    qemu = subprocess.Popen(
        ["qemu-system-arm", "-M", "mps2-an386", "-display", "none", "-serial", "pty", "-monitor", "stdio",
         "-kernel", elf],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        line = next(line for line in qemu.stdout if "/dev/pts/" in line)
        port = os.open(re.search(r"/dev/pts/\d+", line).group(), os.O_RDWR | os.O_NOCTTY)
        tty.setraw(port)
        talk(port)
        content = memory(qemu, at[bottom], at[top] - at[bottom])
    finally:
        qemu.kill()
    used = len(content.lstrip(b"\0"))
    if used == len(content):
        raise SystemExit(f"the stack uses all of its {used} bytes, or more")
    print(used)


main()
