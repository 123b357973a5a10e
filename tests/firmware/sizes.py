"""Checks the size of a firmware image, from the linker's map.

    python3 tests/firmware/sizes.py MAP START_UP_OBJECT

The image for four joints has at most 16 KiB of flash and 3 KiB of RAM beyond its start-up code. RAM
contains the stack.
"""

import re
import sys

MOST_FLASH = 16 * 1024
MOST_RAM = 3 * 1024


def main():
    path, start_up = sys.argv[1:]
    with open(path, encoding="utf-8") as file:
        memory_map = file.read().split("Linker script and memory map", 1)[1]
    # A long name of a section is followed by a line break.
    memory_map = re.sub(r"^( ?\.\S+)\n +0x", r"\1 0x", memory_map, flags=re.M)

    def size(section):
        found = re.search(rf"^{re.escape(section)} +0x\w+ +0x(\w+)", memory_map, re.M)
        assert found, f"{path} has no section {section}"
        return int(found[1], 16)

    # The parts of `.text` that come from the object with the start-up code.
    parts = re.findall(r"^ \.(?:text|vectors|rodata|init_array|data)\S* +0x\w+ +0x(\w+) \S*" +
                       re.escape(start_up) + "$", memory_map, re.M)
    start = sum(int(part, 16) for part in parts)
    assert start > 0, f"{path} has no code of {start_up}"
    flash = size(".text") + size(".data") - start
    ram = size(".data") + size(".bss") + size(".stack")
    print(f"{path}: {flash} bytes of flash beyond {start} of start-up code, {ram} bytes of RAM, of "
          f"them {size('.stack')} for the stack")
    assert flash <= MOST_FLASH, f"at most {MOST_FLASH} bytes of flash"
    assert ram <= MOST_RAM, f"at most {MOST_RAM} bytes of RAM"


if __name__ == "__main__":
    main()
