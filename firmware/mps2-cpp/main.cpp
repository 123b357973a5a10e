// A controller of four joints for the emulated board mps2-an386 (Cortex-M4F). Its UART 0 is the
// line to the host. It sleeps between bytes.

#include <HbotLink.h>

#include "board.h"
#include "plant.h"

namespace {

plant::Plant mechanics;

void readJoints(hbot::Reading *readings) {
    mechanics.advance(board::micros());
    mechanics.read(readings);
}

void driveJoints(const float *torque, bool) { mechanics.drive(torque); }

hbot::Device<plant::Count> device("hbot-mps2-cpp 0.1.0", plant::Joints, readJoints,
                                  driveJoints);

} // namespace

int main() {
    board::Uart uart;
    board::begin();
    device.begin();
    for (;;) {
        mechanics.advance(board::micros());
        device.serve(uart, board::micros());
        if (!device.isSending()) {
            board::sleep();
        }
    }
}
