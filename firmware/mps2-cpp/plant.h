// Four joints that turn: the mechanics behind the firmware that runs without motors.
//
// Each joint has an inertia and viscous friction, and nothing couples the joints:
//
//     J dw/dt = torque - b w
//
// The numbers are those of the Rust image in firmware/mps2, so that one rig file fits both.

#ifndef PLANT_H
#define PLANT_H

#include <HbotLink.h>

namespace plant {

constexpr uint8_t Joints = 4;
constexpr float TwoPi = 6.28318531f;

struct Axis {
    // Moment of inertia at the joint, kg m².
    float inertia;
    // Viscous friction, N m s/rad.
    float friction;
    // Turns of the encoder for one turn of the joint.
    float gear;
};

constexpr uint32_t CountsPerTurn = 16384;
constexpr Axis Steer = {1.0e-3f, 4.0e-3f, 1.0f};
constexpr Axis Drive = {1.0e-4f, 4.0e-4f, 17.0f};

// The mechanics of all joints.
class Plant {
public:
    // Advances the joints to the time `nowUs`, in microseconds.
    void advance(uint32_t nowUs) {
        // The step is short against the time constant of a joint, J / b = 0.25 s, so this method of
        // first order is stable and accurate enough. After a pause it skips the time in between.
        constexpr uint32_t longestUs = 20000;
        const uint32_t passedUs = nowUs - nowUs_;
        const float dt = 1.0e-6f * static_cast<float>(passedUs < longestUs ? passedUs : longestUs);
        nowUs_ = nowUs;
        for (uint8_t j = 0; j < Joints; j++) {
            const Axis &axis = axisOf(j);
            rate_[j] += (torque_[j] - axis.friction * rate_[j]) / axis.inertia * dt;
            turn(j, rate_[j] * dt * axis.gear / TwoPi * static_cast<float>(CountsPerTurn));
        }
    }

    // Sets the torque at each joint, N m.
    void drive(const float *torque) {
        for (uint8_t j = 0; j < Joints; j++) {
            torque_[j] = torque[j];
        }
    }

    void read(hbot::Reading *readings) const {
        for (uint8_t j = 0; j < Joints; j++) {
            readings[j].count = count_[j];
            readings[j].rate = rate_[j];
            readings[j].temperature = 25.0f;
        }
    }

private:
    // Joints are in the order steer, drive of each wheel.
    static const Axis &axisOf(uint8_t j) {
        static constexpr Axis axes[] = {Steer, Drive};
        return axes[j % 2];
    }

    // Turns the encoder of a joint by `counts`. The part below one count is kept for later, so
    // that a slow joint turns too.
    void turn(uint8_t j, float counts) {
        rest_[j] += counts;
        const int32_t whole = static_cast<int32_t>(rest_[j]);
        rest_[j] -= static_cast<float>(whole);
        count_[j] = static_cast<int32_t>(static_cast<uint32_t>(count_[j]) +
                                         static_cast<uint32_t>(whole));
    }

    uint32_t nowUs_ = 0;
    float torque_[Joints] = {};
    float rate_[Joints] = {};
    float rest_[Joints] = {};
    int32_t count_[Joints] = {};
};

} // namespace plant

#endif
