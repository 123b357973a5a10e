// A controller with four joints on a pseudo-terminal, made with HbotLink.h. It prints the path of
// the terminal's other end and runs until its standard input ends.
#include <HbotLink.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "../../firmware/mps2-cpp/plant.h"

namespace {

uint32_t micros() {
    timespec now = {};
    clock_gettime(CLOCK_MONOTONIC, &now);
    const uint64_t us =
        static_cast<uint64_t>(now.tv_sec) * 1000000u + static_cast<uint64_t>(now.tv_nsec) / 1000u;
    return static_cast<uint32_t>(us);
}

plant::Plant mechanics;

void readJoints(hbot::Reading *readings) {
    mechanics.advance(micros());
    mechanics.read(readings);
}

void driveJoints(const float *torque, bool) { mechanics.drive(torque); }

hbot::Device<plant::Count> device("pty 1.0", plant::Joints, readJoints, driveJoints);

// The pseudo-terminal, as `Device::serve` expects a port.
class Terminal {
public:
    bool open() {
        master_ = posix_openpt(O_RDWR | O_NOCTTY);
        if (master_ < 0 || grantpt(master_) != 0 || unlockpt(master_) != 0) {
            return false;
        }
        // Held open, so that the terminal stays when the host closes it.
        slave_ = ::open(ptsname(master_), O_RDWR | O_NOCTTY);
        termios settings = {};
        if (slave_ < 0 || tcgetattr(slave_, &settings) != 0) {
            return false;
        }
        cfmakeraw(&settings);
        if (tcsetattr(slave_, TCSANOW, &settings) != 0) {
            return false;
        }
        printf("%s\n", ptsname(master_));
        return fflush(stdout) == 0;
    }

    // Waits for bytes, at most a millisecond. Returns false when the standard input has ended.
    bool wait() {
        pollfd ready[] = {{master_, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
        if (poll(ready, 2, 1) > 0 && (ready[0].revents & POLLIN) != 0) {
            const ssize_t length = ::read(master_, bytes_, sizeof bytes_);
            length_ = length > 0 ? static_cast<int>(length) : 0;
            next_ = 0;
        }
        return ready[1].revents == 0;
    }

    int available() const { return length_ - next_; }
    int read() { return bytes_[next_++]; }
    void write(const uint8_t *bytes, size_t length) {
        if (::write(master_, bytes, length) != static_cast<ssize_t>(length)) {
            perror("the terminal takes no answer");
        }
    }

private:
    int master_ = -1;
    int slave_ = -1;
    uint8_t bytes_[512] = {};
    int length_ = 0;
    int next_ = 0;
};

} // namespace

int main() {
    Terminal terminal;
    if (!terminal.open()) {
        perror("no pseudo-terminal");
        return 1;
    }
    device.begin();
    while (terminal.wait()) {
        mechanics.advance(micros());
        device.serve(terminal, micros());
    }
    return 0;
}
