// The declarations of CHAI3D 3.2 that cHbotDevice uses, so that it can be compiled and tried without
// CHAI3D. Names, types and signatures are those of CHAI3D's documented interface; the bodies are
// ours and do only what the test needs. With CHAI3D itself this folder must not be on the include
// path.

#ifndef CGenericHapticDeviceH
#define CGenericHapticDeviceH

#include <string>

namespace chai3d {

const bool C_ERROR = false;
const bool C_SUCCESS = true;
const int C_MAX_DOF = 16;

class cVector3d {
public:
    cVector3d() : m{0.0, 0.0, 0.0} {}
    cVector3d(const double a_x, const double a_y, const double a_z) : m{a_x, a_y, a_z} {}
    void set(const double& a_x, const double& a_y, const double& a_z) { *this = cVector3d(a_x, a_y, a_z); }
    void zero() { *this = cVector3d(); }
    const double& operator()(const int a_index) const { return m[a_index]; }

private:
    double m[3];
};

class cMatrix3d {
public:
    cMatrix3d() { identity(); }
    void identity() { set(1, 0, 0, 0, 1, 0, 0, 0, 1); }
    void set(const double& a_m00, const double& a_m01, const double& a_m02, const double& a_m10,
             const double& a_m11, const double& a_m12, const double& a_m20, const double& a_m21,
             const double& a_m22) {
        const double all[9] = {a_m00, a_m01, a_m02, a_m10, a_m11, a_m12, a_m20, a_m21, a_m22};
        for (int k = 0; k < 9; ++k) m[k / 3][k % 3] = all[k];
    }
    const double& operator()(const int a_row, const int a_column) const { return m[a_row][a_column]; }

private:
    double m[3][3];
};

enum cHapticDeviceModel { C_HAPTIC_DEVICE_VIRTUAL, C_HAPTIC_DEVICE_CUSTOM };

struct cHapticDeviceInfo {
    cHapticDeviceModel m_model;
    std::string m_modelName;
    std::string m_manufacturerName;
    double m_maxLinearForce;
    double m_maxAngularTorque;
    double m_maxGripperForce;
    double m_maxLinearStiffness;
    double m_maxAngularStiffness;
    double m_maxGripperLinearStiffness;
    double m_maxLinearDamping;
    double m_maxAngularDamping;
    double m_maxGripperAngularDamping;
    double m_workspaceRadius;
    double m_gripperMaxAngleRad;
    bool m_sensedPosition;
    bool m_sensedRotation;
    bool m_sensedGripper;
    bool m_actuatedPosition;
    bool m_actuatedRotation;
    bool m_actuatedGripper;
    bool m_leftHand;
    bool m_rightHand;
};

class cGenericDevice {
public:
    explicit cGenericDevice(unsigned int a_deviceNumber = 0)
        : m_deviceAvailable(false), m_deviceReady(false), m_deviceNumber(static_cast<int>(a_deviceNumber)) {}
    virtual ~cGenericDevice() {}
    virtual bool open() { return C_ERROR; }
    virtual bool close() { return C_ERROR; }
    bool isDeviceAvailable() { return m_deviceAvailable; }
    bool isDeviceReady() { return m_deviceReady; }

protected:
    bool m_deviceAvailable;
    bool m_deviceReady;
    int m_deviceNumber;
};

class cGenericHapticDevice : public cGenericDevice {
public:
    explicit cGenericHapticDevice(unsigned int a_deviceNumber = 0)
        : cGenericDevice(a_deviceNumber), m_specifications(), m_prevGripperForce(0.0) {}
    virtual bool calibrate(bool = false) { return m_deviceReady; }
    virtual bool getPosition(cVector3d& a_position) {
        a_position.zero();
        return m_deviceReady;
    }
    virtual bool getLinearVelocity(cVector3d& a_linearVelocity) {
        a_linearVelocity = m_linearVelocity;
        return m_deviceReady;
    }
    virtual bool getRotation(cMatrix3d& a_rotation) {
        a_rotation.identity();
        return m_deviceReady;
    }
    virtual bool getJointAnglesRad(double[C_MAX_DOF]) { return C_ERROR; }
    virtual bool getAngularVelocity(cVector3d& a_angularVelocity) {
        a_angularVelocity = m_angularVelocity;
        return m_deviceReady;
    }
    virtual bool getTorque(cVector3d& a_torque) {
        a_torque = m_prevTorque;
        return m_deviceReady;
    }
    virtual bool getUserSwitches(unsigned int& a_userSwitches) {
        a_userSwitches = 0;
        return m_deviceReady;
    }
    cHapticDeviceInfo getSpecifications() { return m_specifications; }
    bool setForceAndTorque(const cVector3d& a_force, const cVector3d& a_torque) {
        return setForceAndTorqueAndGripperForce(a_force, a_torque, 0.0);
    }
    virtual bool setForceAndTorqueAndGripperForce(const cVector3d&, const cVector3d&, const double) {
        return m_deviceReady;
    }

    cHapticDeviceInfo m_specifications;

protected:
    cVector3d m_prevForce;
    cVector3d m_prevTorque;
    double m_prevGripperForce;
    cVector3d m_linearVelocity;
    cVector3d m_angularVelocity;
};

}  // namespace chai3d

#endif
