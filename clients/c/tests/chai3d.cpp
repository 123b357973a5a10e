// The CHAI3D device against a running server, whose address is the argument. CHAI3D itself is
// replaced by declarations; see chai3d/declarations.

#include <cmath>

#include "CHbotDevice.h"
#include "check.hpp"

namespace {

using namespace chai3d;

struct Silent : cHbotDevice {
    using cHbotDevice::cHbotDevice;
    // The server sends no more states, and answers as before.
    void hush() { m_client->unsubscribe(); }
};

}  // namespace

int main(int, char** argv) {
    cVector3d v;
    cMatrix3d r;
    unsigned int switches = 1;
    cHbotDevice nowhere("127.0.0.1:1");
    CHECK(nowhere.isDeviceAvailable() && !nowhere.open() && !nowhere.isDeviceReady());
    CHECK(!nowhere.getLastError().empty());
    CHECK(!nowhere.getRotation(r) && !nowhere.setForceAndTorque(v, v));

    cHbotDevicePtr device = cHbotDevice::create(argv[1]);
    // Calls a method of the device that must succeed.
    const auto does = [&](bool success) {
        if (!success) std::fprintf(stderr, "the device: %s\n", device->getLastError().c_str());
        return success;
    };
    CHECK(does(device->open()) && device->isDeviceReady() && does(device->calibrate()));
    CHECK(!device->open());
    const cHapticDeviceInfo info = device->getSpecifications();
    CHECK(info.m_modelName == "Hbot prototype" && info.m_maxAngularTorque > 0.1);
    CHECK(info.m_actuatedRotation && info.m_sensedRotation && !info.m_sensedPosition && !info.m_actuatedPosition);
    CHECK(device->getPosition(v) && v(0) == 0.0 && device->getUserSwitches(switches) && switches == 0);

    // A torque about CHAI3D's x, with damping, so that the sphere turns slowly: x is -n2.
    hbot::Client watch(argv[1]);
    watch.subscribe();
    const double damping = 0.02, push = 0.02;  // N m s/rad, N m
    hbot_state state{};
    CHECK(eventually([&] {
        cVector3d omega;
        CHECK(does(device->getAngularVelocity(omega)));
        const cVector3d torque(push - damping * omega(0), -damping * omega(1), -damping * omega(2));
        CHECK(does(device->setForceAndTorque(cVector3d(1.0, 2.0, 3.0), torque)));
        if (const auto newest = watch.latest_state()) state = *newest;
        // The rig applies the push about -n2 and turns that way. The damping takes up to the half.
        return state.torque[1] < -0.5 * push && std::fabs(state.torque[0]) < 0.25 * push &&
               std::fabs(state.torque[2]) < 0.25 * push && state.omega[1] < -0.02 && omega(0) > 0.02;
    }));

    // The rotation of the device is that of the sphere: its columns are the converted sphere axes.
    // Its own quaternion is compared in frame N, at a state that both have seen within some ticks.
    CHECK(eventually([&] {
        CHECK(device->getRotation(r));
        const auto newest = watch.latest_state();
        if (!newest) return false;
        const double w = newest->q[0], x = newest->q[1], y = newest->q[2], z = newest->q[3];
        // The sphere axis s2 in frame N.
        const double s2[3] = {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)};
        // The sphere's axis -s2 is CHAI3D's x of the sphere; -n2, n1, n3 are its rows. The sphere
        // turns at at most 0.8 rad/s: 0.01 is the turn of 12 ticks.
        return std::fabs(r(0, 0) - s2[1]) < 0.01 && std::fabs(r(1, 0) + s2[0]) < 0.01 &&
               std::fabs(r(2, 0) + s2[2]) < 0.01;
    }));

    hbot::Client stop(argv[1]);
    stop.estop();
    CHECK(eventually([&] { return !device->setForceAndTorque(v, v); }));
    CHECK(device->getLastError().find("mode estop") != std::string::npos);
    CHECK(device->close() && !device->isDeviceReady() && !device->close());
    stop.acquire();
    stop.reset();
    stop.release();

    // Nothing looks well after another client has taken the lease, or when states stay away.
    hbot::Options patient;
    patient.timeout = hbot::Milliseconds{3000};
    Silent second(argv[1], patient);
    CHECK(second.open() && second.setForceAndTorque(v, v));
    stop.acquire(true);
    CHECK(eventually([&] { return !second.setForceAndTorque(v, v); }));
    CHECK(!second.setForceAndTorque(v, v) && second.getRotation(r));
    CHECK(second.getLastError().find("the lease is lost: c++") == 0);
    second.hush();
    CHECK(eventually([&] { return !second.getRotation(r); }));
    CHECK(!second.getAngularVelocity(v) && second.getLastError().find("no state within 3000 ms") == 0);
    std::puts("chai3d: all true");
}
