// Runs an Arduino sketch on this machine: its `Serial` is a pseudo-terminal. Prints the path of the
// terminal's other end, and runs until its standard input ends.
#include "Arduino.h"

#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

SerialPort Serial;

namespace {

int terminal = -1;
uint8_t bytes[512];
int length, next;

bool openTerminal() {
    terminal = posix_openpt(O_RDWR | O_NOCTTY);
    if (terminal < 0 || grantpt(terminal) != 0 || unlockpt(terminal) != 0) {
        return false;
    }
    // Held open, so that the terminal stays when the host closes it.
    const int held = open(ptsname(terminal), O_RDWR | O_NOCTTY);
    termios settings = {};
    if (held < 0 || tcgetattr(held, &settings) != 0) {
        return false;
    }
    cfmakeraw(&settings);
    if (tcsetattr(held, TCSANOW, &settings) != 0) {
        return false;
    }
    printf("%s\n", ptsname(terminal));
    return fflush(stdout) == 0;
}

// Waits for bytes, at most a millisecond. Returns false when the standard input has ended.
bool wait() {
    pollfd ready[] = {{terminal, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
    if (poll(ready, 2, 1) > 0 && (ready[0].revents & POLLIN) != 0) {
        const ssize_t got = read(terminal, bytes, sizeof bytes);
        length = got > 0 ? static_cast<int>(got) : 0;
        next = 0;
    }
    return ready[1].revents == 0;
}

} // namespace

uint32_t micros() {
    timespec now = {};
    clock_gettime(CLOCK_MONOTONIC, &now);
    const uint64_t us =
        static_cast<uint64_t>(now.tv_sec) * 1000000u + static_cast<uint64_t>(now.tv_nsec) / 1000u;
    return static_cast<uint32_t>(us);
}

// A pseudo-terminal has no baud rate.
void SerialPort::begin(unsigned long) {}

int SerialPort::available() { return length - next; }

int SerialPort::read() { return bytes[next++]; }

// The bytes that can be written without waiting.
int SerialPort::availableForWrite() {
    pollfd ready = {terminal, POLLOUT, 0};
    // A terminal that can be written to takes an answer at least.
    return poll(&ready, 1, 0) > 0 && (ready.revents & POLLOUT) != 0 ? 128 : 0;
}

size_t SerialPort::write(const uint8_t *from, size_t count) {
    const ssize_t written = ::write(terminal, from, count);
    if (written != static_cast<ssize_t>(count)) {
        perror("the terminal takes no answer");
    }
    return written > 0 ? static_cast<size_t>(written) : 0;
}

int main() {
    if (!openTerminal()) {
        perror("no pseudo-terminal");
        return 1;
    }
    setup();
    while (wait()) {
        loop();
    }
    return 0;
}
