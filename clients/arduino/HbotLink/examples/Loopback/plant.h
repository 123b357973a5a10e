// Four simulated joints, each with a motor, an inertia, viscous friction and an encoder. Nothing
// couples them. The numbers are those of hbot's firmware/mps2, so its rig.toml fits this too.

#ifndef PLANT_H
#define PLANT_H

#include <HbotLink.h>

namespace plant {

// Steer and drive of two wheels.
constexpr uint8_t Count = 4;
constexpr hbot::Joint Steer = {16384, 0.93f, 80.0f};
constexpr hbot::Joint Drive = {16384, 0.14f, 80.0f};
constexpr hbot::Joint Joints[Count] = {Steer, Drive, Steer, Drive};

struct Mechanics {
    // Turns of the encoder in one turn of the joint.
    float gear;
    // Moment of inertia at the joint, kg m².
    float inertia;
    // Viscous friction, N m s/rad. It is large, so that a spring is stable even if the host's loop
    // is late by 0.2 s on a busy machine.
    float friction;
};
constexpr Mechanics SteerMechanics = {1.0f, 5.0e-3f, 5.0e-2f};
constexpr Mechanics DriveMechanics = {17.0f, 1.0e-3f, 2.0e-2f};
constexpr Mechanics Of[Count] = {SteerMechanics, DriveMechanics, SteerMechanics, DriveMechanics};

// Temperature that the motors report, in degrees Celsius.
constexpr float Temperature = 25.0f;
// Longest time by which the joints move on at once, in microseconds. A longer gap, such as a halt
// in a debugger, does not move them.
constexpr uint32_t LongestStepUs = 20000;
constexpr float TwoPi = 6.28318531f;

class Plant {
public:
    // Moves the joints on to the time `nowUs`, under the torques that they have.
    void advance(uint32_t nowUs) {
        const uint32_t passedUs = nowUs - nowUs_;
        const uint32_t stepUs = passedUs < LongestStepUs ? passedUs : LongestStepUs;
        nowUs_ = nowUs;
        const float dt = 1.0e-6f * static_cast<float>(stepUs);
        for (uint8_t j = 0; j < Count; j++) {
            rate_[j] += dt * (torque_[j] - Of[j].friction * rate_[j]) / Of[j].inertia;
            const float countsPerRad =
                Of[j].gear * static_cast<float>(Joints[j].countsPerTurn) / TwoPi;
            turn(j, dt * rate_[j] * countsPerRad);
        }
    }

    // Sets the torque at each joint, N m.
    void drive(const float *torque) {
        for (uint8_t j = 0; j < Count; j++) {
            torque_[j] = torque[j];
        }
    }

    void read(hbot::Reading *readings) const {
        for (uint8_t j = 0; j < Count; j++) {
            readings[j].count = count_[j];
            readings[j].rate = rate_[j];
            readings[j].temperature = Temperature;
        }
    }

private:
    // Turns the encoder of a joint by `counts`. The part below one count is kept for later, so
    // that a slow joint turns too.
    void turn(uint8_t j, float counts) {
        fraction_[j] += counts;
        const int32_t whole = static_cast<int32_t>(fraction_[j]);
        fraction_[j] -= static_cast<float>(whole);
        count_[j] = static_cast<int32_t>(static_cast<uint32_t>(count_[j]) +
                                         static_cast<uint32_t>(whole));
    }

    uint32_t nowUs_ = 0;
    float torque_[Count] = {};
    float rate_[Count] = {};
    float fraction_[Count] = {};
    int32_t count_[Count] = {};
};

} // namespace plant

#endif
