#include "CHbotDevice.h"

#include <stdexcept>

namespace chai3d {

namespace {

// Longest time that setForceAndTorqueAndGripperForce() waits for a state. Ten ticks of a rig at
// 1 kHz: a loop that gets none goes on with the last one.
constexpr hbot::Milliseconds TICKS_WAITED{10};

// Says why the rig makes no torque, and what brings it back.
std::string notRendering(const hbot_state& a_state) {
    std::string text = std::string("the rig does not render: mode ") + hbot_mode_name(a_state.mode);
    if (a_state.fault != HBOT_FAULT_NONE) text += std::string(", fault ") + hbot_fault_name(a_state.fault);
    return text + (a_state.mode == HBOT_MODE_IDLE ? "; `hbot enable` switches the torque on"
                                                  : "; `hbot info` says why and what is next");
}

cVector3d toChai3d(const double (&a_axial)[3]) {
    const hbot::Vec3 v = hbot::axial_to(HBOT_AXES_CHAI3D, {a_axial[0], a_axial[1], a_axial[2]});
    return cVector3d(v[0], v[1], v[2]);
}

}  // namespace

cHbotDevice::cHbotDevice(const std::string& a_address, const hbot::Options& a_options,
                         const std::string& a_scene)
    : m_address(a_address), m_options(a_options), m_scene(a_scene), m_state() {
    m_deviceAvailable = true;
    m_deviceReady = false;
    m_specifications = cHapticDeviceInfo();
    m_specifications.m_model = C_HAPTIC_DEVICE_CUSTOM;
    m_specifications.m_manufacturerName = "hbot";
    m_specifications.m_modelName = "Hbot";
    m_specifications.m_sensedRotation = true;
    m_specifications.m_actuatedRotation = true;
    m_specifications.m_leftHand = true;
    m_specifications.m_rightHand = true;
    // CHAI3D divides by it. It is the radius of the prototype's sphere, m, until open().
    m_specifications.m_workspaceRadius = 0.102;
}

cHbotDevice::~cHbotDevice() {
    if (m_deviceReady) close();
}

// Runs the body of a method of an open device. An error becomes the text of getLastError().
template <typename Body>
bool cHbotDevice::guarded(Body&& a_body) {
    const std::lock_guard<std::mutex> lock(m_mutex);
    if (!m_client) {
        m_error = "the device is not open";
        return C_ERROR;
    }
    try {
        return a_body();
    } catch (const std::exception& error) {
        m_error = error.what();
        return C_ERROR;
    }
}

bool cHbotDevice::open() {
    {
        const std::lock_guard<std::mutex> lock(m_mutex);
        if (m_client) {
            m_error = "the device is open already";
            return C_ERROR;
        }
        try {
            m_client.emplace(m_address, m_options);
        } catch (const std::exception& error) {
            m_error = error.what();
            return C_ERROR;
        }
    }
    const bool opened = guarded([&] {
        const hbot_info info = m_client->info();
        m_specifications.m_modelName = info.rig;
        m_specifications.m_maxAngularTorque = info.max_torque;
        m_specifications.m_maxAngularStiffness = info.stable_stiffness;
        m_specifications.m_maxAngularDamping = info.stable_damping;
        m_specifications.m_workspaceRadius = info.sphere_radius;
        m_client->acquire();
        m_client->load_scene_toml(m_scene);
        m_client->enable();
        m_client->subscribe();
        const std::optional<hbot_state> state = m_client->next_state(m_options.timeout);
        if (!state) throw std::runtime_error("the rig has sent no state");
        m_state = *state;
        m_heard = std::chrono::steady_clock::now();
        m_lost.clear();
        return C_SUCCESS;
    });
    const std::lock_guard<std::mutex> lock(m_mutex);
    if (!opened) m_client.reset();
    m_deviceReady = opened;
    return opened;
}

bool cHbotDevice::close() {
    const bool disabled = guarded([&] {
        m_client->disable();
        return C_SUCCESS;
    });
    const std::lock_guard<std::mutex> lock(m_mutex);
    m_client.reset();
    m_deviceReady = false;
    return disabled;
}

bool cHbotDevice::calibrate(bool) {
    return guarded([&] {
        refresh(hbot::Milliseconds{0});
        if (m_state.mode == HBOT_MODE_UNREFERENCED) {
            throw std::runtime_error("the zeros of the steer joints are not known yet");
        }
        return C_SUCCESS;
    });
}

// Takes the newest state. Waits for one if none has arrived, and fails if the last one is too old.
void cHbotDevice::refresh(hbot::Milliseconds a_timeout) {
    const std::optional<hbot_state> state = m_client->latest_state(a_timeout);
    const auto now = std::chrono::steady_clock::now();
    if (state) {
        m_state = *state;
        m_heard = now;
    } else if (now - m_heard > m_options.timeout) {
        throw std::runtime_error("no state within " + std::to_string(m_options.timeout.count()) +
                                 " ms: the server's loop does not run, or the connection is cut");
    }
}

// Reads the events that have arrived. Fails from the moment at which the lease is another client's,
// because the rig then refuses every torque.
void cHbotDevice::checkLease() {
    while (const std::optional<hbot_event> event = m_client->next_event()) {
        if (event->kind != HBOT_EVENT_KIND_LEASE) continue;
        const std::string holder = event->session ? event->text : "nobody";
        m_lost = event->mine ? "" : "the lease is lost: " + holder + " commands the rig";
    }
    if (!m_lost.empty()) throw std::runtime_error(m_lost);
}

bool cHbotDevice::getPosition(cVector3d& a_position) {
    a_position.zero();
    return m_deviceReady;
}

bool cHbotDevice::getLinearVelocity(cVector3d& a_linearVelocity) {
    a_linearVelocity.zero();
    return m_deviceReady;
}

bool cHbotDevice::getRotation(cMatrix3d& a_rotation) {
    return guarded([&] {
        refresh(hbot::Milliseconds{0});
        const hbot::Quat n{m_state.q[0], m_state.q[1], m_state.q[2], m_state.q[3]};
        const auto [w, x, y, z] = hbot::quaternion_to(HBOT_AXES_CHAI3D, n);
        a_rotation.set(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),    //
                       2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),    //
                       2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y));
        return C_SUCCESS;
    });
}

bool cHbotDevice::getAngularVelocity(cVector3d& a_angularVelocity) {
    return guarded([&] {
        refresh(hbot::Milliseconds{0});
        m_angularVelocity = toChai3d(m_state.omega);
        a_angularVelocity = m_angularVelocity;
        return C_SUCCESS;
    });
}

bool cHbotDevice::getUserSwitches(unsigned int& a_userSwitches) {
    a_userSwitches = 0;
    return m_deviceReady;
}

bool cHbotDevice::setForceAndTorqueAndGripperForce(const cVector3d& a_force, const cVector3d& a_torque,
                                                   const double a_gripperForce) {
    return guarded([&] {
        m_prevForce = a_force;
        m_prevTorque = a_torque;
        m_prevGripperForce = a_gripperForce;
        const hbot::Vec3 torque =
            hbot::axial_from(HBOT_AXES_CHAI3D, {a_torque(0), a_torque(1), a_torque(2)});
        hbot_stream stream{};
        stream.tick = m_state.tick;
        m_client->torque(torque, stream);
        refresh(TICKS_WAITED);
        checkLease();
        if (m_state.mode != HBOT_MODE_ENABLING && m_state.mode != HBOT_MODE_ACTIVE) {
            throw std::runtime_error(notRendering(m_state));
        }
        return C_SUCCESS;
    });
}

std::string cHbotDevice::getLastError() const {
    const std::lock_guard<std::mutex> lock(m_mutex);
    return m_error;
}

}  // namespace chai3d
