// The part of SimpleFOC 2.3 that the example uses, declared only. It shows that the example is well
// formed; it does not show that it fits another version of the library.
#ifndef SIMPLEFOC_H
#define SIMPLEFOC_H

#include <stdint.h>

enum Direction : int8_t { CW = 1, CCW = -1, UNKNOWN = 0 };
enum MotionControlType : uint8_t { torque, velocity, angle };
enum TorqueControlType : uint8_t { voltage, dc_current, foc_current };

class Sensor {
public:
    virtual float getMechanicalAngle();
    virtual int32_t getFullRotations();
};

struct MagneticSensorSPIConfig_s {};
extern MagneticSensorSPIConfig_s AS5147_SPI;
class MagneticSensorSPI : public Sensor {
public:
    MagneticSensorSPI(MagneticSensorSPIConfig_s config, int chipSelect);
    void init();
};

class BLDCDriver {
public:
    float voltage_power_supply;
};
class BLDCDriver3PWM : public BLDCDriver {
public:
    BLDCDriver3PWM(int a, int b, int c, int enable);
    int init();
};

class CurrentSense {
public:
    bool skip_align;
    void linkDriver(BLDCDriver *driver);
};
class LowsideCurrentSense : public CurrentSense {
public:
    LowsideCurrentSense(float shunt, float gain, int a, int b);
    int init();
};

struct DQCurrent_s {
    float d, q;
};
class PIDController {
public:
    void reset();
};
class BLDCMotor {
public:
    explicit BLDCMotor(int polePairs);
    int init();
    int initFOC();
    void enable();
    void disable();
    void loopFOC();
    void move();
    void linkSensor(Sensor *sensor);
    void linkDriver(BLDCDriver *driver);
    void linkCurrentSense(CurrentSense *sense);
    float target, shaft_velocity, current_limit, zero_electric_angle, current_sp;
    PIDController PID_current_q, PID_current_d;
    DQCurrent_s current;
    int8_t enabled;
    Direction sensor_direction;
    MotionControlType controller;
    TorqueControlType torque_controller;
    Sensor *sensor;
};

#endif
