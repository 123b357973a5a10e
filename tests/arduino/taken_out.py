"""Takes each duty of docs/link.md out of HbotLink.h, one at a time. The named test must then fail.

    python3 tests/arduino/taken_out.py FOLDER

FOLDER takes the changed headers and the programs. Prints a table of the duties and the tests that
failed without them.
"""

import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

HEADER = "clients/arduino/HbotLink/src/HbotLink.h"

# What is taken out, its text in the header, what replaces it, and the start of the name of a test
# that must fail.
DUTIES = [
    ("an answer repeats the sequence of its command",
     "encodeFeedback(command.sequence,", "encodeFeedback(command.sequence + 1,",
     "conversation: a description for each"),
    ("joints are sampled for each command",
     "        read_(readings);\n", "", "conversation: a description for each"),
    ("bits without a name are sent as 0",
     "        reading.flags = reading.flags & (IndexSeen | OverCurrent | OverTemperature);\n", "",
     "conversation: bits without a name"),
    ("a name has at most 32 bytes",
     "length < MaxFirmwareBytes && firmware", "firmware", "conversation: a name of more"),
    ("a line that is never silent does not hold the loop",
     "waiting > 0 && unsent_ == 0; waiting--",
     "port.available() > 0 && waiting < 100000; waiting++",
     "conversation: a port is served"),
    ("1: as many torques as joints",
     "command.joints == N;", "command.joints <= N;", "duty 1: a command with another number"),
    ("1: torques are finite",
     "valid = valid && detail::isFinite(command.torque[j]);", "", "duty 1: a command with a torque"),
    ("1: the CRC of a frame is right",
     "return Heard::Crc;", "break;", "duty 1: a damaged frame"),
    ("1: an invalid command does not restart the watchdog",
     "        case Heard::Command:\n", "        case Heard::Command:\n            commandUs_ = nowUs;\n",
     "duty 1: invalid commands"),
    ("1: a Describe does not restart the watchdog",
     "            described_ = true;\n", "            described_ = true;\n            commandUs_ = nowUs;\n",
     "duty 1: invalid commands"),
    ("1: noise does not restart the watchdog",
     "            refused_++;\n", "            refused_++;\n            commandUs_ = nowUs;\n",
     "duty 1: invalid commands"),
    ("2: the watchdog expires",
     "nowUs - commandUs_ >= watchdogUs_", "watchdogUs_ == 0", "duty 2: the watchdog ends torque"),
    ("2: it expires when its time has passed, not later",
     "nowUs - commandUs_ >= watchdogUs_", "nowUs - commandUs_ > watchdogUs_",
     "duty 2: the watchdog ends torque"),
    ("2: the microseconds wrap",
     "nowUs - commandUs_ >= watchdogUs_", "nowUs >= commandUs_ + watchdogUs_",
     "duty 2: the watchdog works when"),
    ("2: a valid command restarts it",
     "        commandUs_ = nowUs;\n", "", "duty 2: each valid command restarts"),
    ("2: with its own time",
     "command.watchdogMs) * 1000u", "command.watchdogMs % 1000u) * 1000u",
     "duty 2: each valid command restarts"),
    ("2: a time of 0 has expired at once",
     "        watch(nowUs); // A time of 0 has expired now.\n", "", "duty 2: a watchdog time of 0"),
    ("2: torque ends at that time, without another command",
     "        if (on_ && !givesTorque()) {\n            release();\n        }\n", "",
     "duty 2: the watchdog ends torque"),
    ("2: no byte is taken while an answer waits",
     "waiting > 0 && unsent_ == 0; waiting--", "waiting > 0; waiting--",
     "duty 2: a host that stops reading"),
    ("2: only what the port takes is written",
     "free < unsent_ ? free : unsent_;", "unsent_ + 0 * free;", "duty 2: a host that stops reading"),
    ("2: the flag WATCHDOG_EXPIRED",
     "(expired_ ? WatchdogExpired : 0)", "0", "duty 2: after it"),
    ("2: no torque after it",
     "enable_ && !expired_ &&", "enable_ &&", "duty 2: after it"),
    ("2: enable true does not clear it",
     "            expired_ = false;\n", "        }\n        {\n            expired_ = false;\n",
     "duty 2: after it"),
    ("2: enable false clears it",
     "            expired_ = false;\n", "", "duty 2: after it"),
    ("2: a late command does not bring torque back",
     "        poll(nowUs);\n        switch", "        switch", "duty 2: a command that comes too late"),
    ("enable false frees the joints",
     "        enable_ = command.enable;\n", "        enable_ = enable_ || command.enable;\n",
     "enable false: the joints are free"),
    ("3: zero torque after boot",
     "void begin() { release(); }", "void begin() {}", "duty 3: after boot"),
    ("3: no torque before a Describe",
     "!fault_ && described_;", "!fault_;", "duty 3: before a Describe"),
    ("3: the flag UNDESCRIBED",
     "(described_ ? 0 : Undescribed)", "0", "duty 3: before a Describe"),
    ("3: a Describe clears it",
     "            described_ = true;\n", "", "duty 3: before a Describe"),
    ("4: no torque in a fault",
     "!expired_ && !fault_ &&", "!expired_ &&", "duty 4: a fault ends torque"),
    ("4: torque ends at once",
     "            fault_ = true;\n            release();\n", "            fault_ = true;\n",
     "duty 4: a fault ends torque"),
    ("4: torque ends if driving finds a fault",
     "        // Not `else`: `drive_` may have reported a fault.\n        if (!givesTorque()) {", "        else {",
     "duty 4: a fault that is found"),
    ("4: the flag FAULT",
     "(fault_ ? Fault : 0)", "0", "duty 4: a fault ends torque"),
    ("4: it stays while its cause is there",
     "            fault_ = faultPresent_;\n", "            fault_ = false;\n", "duty 4: it stays until"),
    ("4: it stays until enable is false",
     "        if (faultPresent_ && !fault_) {\n",
     "        fault_ = fault_ && faultPresent_;\n        if (faultPresent_ && !fault_) {\n",
     "duty 4: it stays until"),
    ("4: enable false clears it",
     "            fault_ = faultPresent_;\n", "", "duty 4: it stays until"),
    ("4: ENABLED only if the power stage is ready",
     "givesTorque() && ready_ ?", "givesTorque() ?", "duty 4: a power stage"),
    ("5: torque is clipped",
     "            torque = torque > 0.0f ? joint.peakTorque : -joint.peakTorque;\n", "",
     "duty 5: no torque beyond the peak"),
    ("5: a peak torque is 0 or more",
     "            if (!(joints_[j].peakTorque > 0.0f)) {", "            if (false) {",
     "duty 5: a peak torque below zero"),
    ("5: the flag OVERCURRENT",
     "reading.flags | OverCurrent)", "reading.flags)", "duty 5: no torque beyond the peak"),
    ("5: a hot joint has no torque",
     "            torque = 0.0f;\n", "", "duty 5: a joint that is too hot"),
    ("5: the flag OVERTEMPERATURE",
     "reading.flags | OverTemperature)", "reading.flags)", "duty 5: a joint that is too hot"),
    ("5: an unknown temperature is too hot",
     "!(reading.temperature < joint.maxTemperature)", "reading.temperature >= joint.maxTemperature",
     "duty 5: a joint that is too hot"),
    ("frames: an accepted frame has no byte left over",
     "fields(body) && body.atEnd()", "fields(body)", "line: a body that is not"),
    ("frames: a varint fits its type",
     " || (width - shift < 8 && next >> (width - shift) != 0)", "", "line: a body that is not"),
    ("frames: a command has at most 16 torques",
     " || joints > MaxJoints)", ")", "line: a body that is not"),
    ("frames: `describe` has no byte left over",
     "return body.atEnd() ? Heard::Describe : Heard::Body;", "return Heard::Describe;",
     "vectors: every frame to refuse"),
    ("frames: enable is 0 or 1",
     " || enable > 1 ||", " ||", "vectors: every frame to refuse"),
    ("frames: a frame that is too long is dropped up to the next zero",
     "            skipping_ = true;\n", "            length_ = 0;\n", "line: a frame is decoded in pieces"),
    ("frames: empty frames mean nothing",
     "skipping_ || length == 0", "skipping_", "line: a frame is decoded in pieces"),
    ("frames: a run of 254 bytes has no zero after it",
     "if (full_) {", "if (full_ && value != 0) {", "vectors: a zero anywhere"),
]


# The sanitizers and the optimiser only cost time here. A change can leave something unused, which is
# no matter here.
FLAGS = ["-O0", "-g0", "-fno-sanitize=all", "-Wno-error"]


def build(output, *arguments, header="clients/arduino/HbotLink/src"):
    """Builds with the header in the folder `header`."""
    result = subprocess.run(["tests/arduino/build.sh", output, *arguments, *FLAGS], check=False,
                            env=dict(os.environ, HEADER_FOLDER=header), capture_output=True,
                            text=True)
    assert result.returncode == 0, f"{header}: {result.stderr}"


def try_without(index, folder):
    """Builds and runs a test without one duty. Returns the row of the table, or raises."""
    what, old, new, expected = DUTIES[index]
    with open(HEADER, encoding="utf-8") as file:
        header = file.read()
    assert header.count(old) == 1, f"{what}: the header has {header.count(old)} times {old!r}"
    place = os.path.join(folder, f"without_{index}")
    os.makedirs(place, exist_ok=True)
    with open(os.path.join(place, "HbotLink.h"), "w", encoding="utf-8") as file:
        file.write(header.replace(old, new))
    program = os.path.join(place, "tests")
    source = "vectors" if expected.split(":")[0] in ("vectors", "line") else "duties"
    build(program, f"tests/arduino/{source}.cpp", f"{folder}/plain_main.o",
          f"{folder}/plain_page.o", header=place)
    run = subprocess.run([program, f"--test-case={expected}*"], capture_output=True, text=True,
                         timeout=60, check=False)
    failed = re.search(r"test cases: +1 \| +0 passed \| +1 failed", run.stdout)
    assert failed, f"without `{what}`, `{expected}...` did not fail:\n{run.stdout}{run.stderr}"
    return f"| {what} | {expected}... |"


def main():
    folder = sys.argv[1]
    for name in ("main", "page"):
        build(f"{folder}/plain_{name}.o", "-c", f"tests/arduino/{name}.cpp")
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        rows = list(pool.map(lambda index: try_without(index, folder), range(len(DUTIES))))
    print("| taken out of the header | the test that failed |\n|---|---|")
    print("\n".join(rows))
    print(f"{len(rows)} duties and parts of them, each with a test that fails without it")


if __name__ == "__main__":
    main()
