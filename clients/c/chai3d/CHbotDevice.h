// An Hbot as a haptic device of CHAI3D 3.2: rotation, angular velocity and torque.
//
// CHAI3D's axes: x points towards the person, y to the right, z up. Frame N: n1 right, n2 away from
// the person, n3 up. So x is -n2, y is n1 and z is n3; hbot.hpp converts (docs/axes.md).

#ifndef CHbotDeviceH
#define CHbotDeviceH

#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "devices/CGenericHapticDevice.h"
#include "hbot.hpp"

namespace chai3d {

class cHbotDevice;
typedef std::shared_ptr<cHbotDevice> cHbotDevicePtr;

class cHbotDevice : public cGenericHapticDevice {
public:
    // Describes a device at an address. The connection begins with open(). `a_scene` is the text of a
    // scene file that the rig renders in addition to the torques of the program; the default scene
    // is empty.
    explicit cHbotDevice(const std::string& a_address = "127.0.0.1:4268", const hbot::Options& a_options = {},
                         const std::string& a_scene = "name = \"CHAI3D\"\n");
    ~cHbotDevice() override;
    static cHbotDevicePtr create(const std::string& a_address = "127.0.0.1:4268",
                                 const hbot::Options& a_options = {}) {
        return std::make_shared<cHbotDevice>(a_address, a_options);
    }

    // Connects, takes the lease, loads the scene and enables the rig: its torque rises within 0.5 s.
    // The specifications are known after it.
    bool open() override;
    // Disables the rig and ends the connection.
    bool close() override;
    // Succeeds if the zeros of the steer joints are known. The rig finds them itself.
    bool calibrate(bool a_forceCalibration = false) override;

    // The methods below that need a state fail if none has come within the timeout of the options.

    // The sphere does not move: zero.
    bool getPosition(cVector3d& a_position) override;
    bool getLinearVelocity(cVector3d& a_linearVelocity) override;
    bool getRotation(cMatrix3d& a_rotation) override;
    // As the rig has measured it, rad/s. CHAI3D's own estimate is not used.
    bool getAngularVelocity(cVector3d& a_angularVelocity) override;
    // An Hbot has no switches: 0.
    bool getUserSwitches(unsigned int& a_userSwitches) override;

    // Streams the torque, N m, and waits for the next state, which paces the haptic loop to the
    // rig's ticks. Forces are ignored. Fails if the rig does not render (after a fault, an emergency
    // stop or a disable), and after another client has taken the lease.
    bool setForceAndTorqueAndGripperForce(const cVector3d& a_force, const cVector3d& a_torque,
                                          const double a_gripperForce) override;

    // Why the last call failed.
    std::string getLastError() const;

private:
    template <typename Body>
    bool guarded(Body&& a_body);
    void refresh(hbot::Milliseconds a_timeout);
    void checkLease();

    const std::string m_address;
    const hbot::Options m_options;
    const std::string m_scene;
    hbot_state m_state;
    // When m_state came.
    std::chrono::steady_clock::time_point m_heard;
    // Who has the lease instead of this device. Empty while it has it.
    std::string m_lost;
    std::string m_error;

protected:
    // A derived class can send more over the same connection.
    //
    // CHAI3D's haptic thread and its graphic thread call the same device.
    mutable std::mutex m_mutex;
    std::optional<hbot::Client> m_client;
};

}  // namespace chai3d

#endif
