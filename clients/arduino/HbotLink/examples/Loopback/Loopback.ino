// Four simulated joints: try the whole way to the rig PC with a bare board, without motors.
//
//     hbot rig scan --rig rig.toml --port /dev/ttyACM0
//     hbot server --rig rig.toml --port /dev/ttyACM0
//
// docs/firmware.md of hbot has the rig file. Replace the two functions by those of your hardware.

#include <HbotLink.h>

#include "plant.h"

plant::Plant mechanics;

void readJoints(hbot::Reading *readings) {
    mechanics.advance(micros());
    mechanics.read(readings);
}

void driveJoints(const float *torque, bool) { mechanics.drive(torque); }

hbot::Device<plant::Count> device("loopback 1.0", plant::Joints, readJoints, driveJoints);

void setup() {
    Serial.begin(3000000);
    device.begin();
}

void loop() {
    mechanics.advance(micros());
    device.serve(Serial, micros());
}
