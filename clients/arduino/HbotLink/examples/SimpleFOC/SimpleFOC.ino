// Two brushless motors with SimpleFOC (simplefoc.com) and AS5147 encoders: steer and drive of one
// wheel. The pins are those of your board; 10 to 13 are its SPI, which reads the encoders.

#include <HbotLink.h>
#include <SimpleFOC.h>

constexpr int Motors = 2;
constexpr float TwoPi = 6.28318531f;

// Counts that the encoder has in one turn; the key counts_per_turn of the rig file.
constexpr float CountsPerTurn = 16384.0f;
// Turns of the motor for one turn of the joint; the key gear of the rig file.
const float gear[Motors] = {1.0f, 17.0f};
// Torque of the motor, N m/A, from its data sheet.
const float torquePerAmpere[Motors] = {0.093f, 0.0082f};
// What motor and driver stand for any time, A.
constexpr float MostAmperes = 5.0f;

BLDCMotor steer(11), drive(7);
BLDCDriver3PWM steerDriver(9, 5, 6, 8), driveDriver(3, 22, 23, 7);
MagneticSensorSPI steerSensor(AS5147_SPI, 2), driveSensor(AS5147_SPI, 4);
LowsideCurrentSense steerCurrent(0.01f, 50.0f, A0, A1), driveCurrent(0.01f, 50.0f, A2, A3);
BLDCMotor *const motors[Motors] = {&steer, &drive};

const hbot::Joint joints[Motors] = {{16384, 0.46f, 0.0f}, {16384, 0.14f, 0.0f}};

void readJoints(hbot::Reading *readings) {
    for (int j = 0; j < Motors; j++) {
        BLDCMotor &motor = *motors[j];
        // SimpleFOC turns the angle and the rate into the direction of a positive current; the
        // count must have the same sign. Turns and angle are taken separately, because a float
        // cannot hold both.
        const int32_t sign = motor.sensor_direction == Direction::CCW ? -1 : 1;
        const float part = motor.sensor->getMechanicalAngle() / TwoPi * CountsPerTurn;
        const int32_t turns =
            motor.sensor->getFullRotations() * static_cast<int32_t>(CountsPerTurn);
        readings[j].count = sign * (turns + static_cast<int32_t>(part));
        readings[j].rate = motor.shaft_velocity / gear[j];
        readings[j].current = motor.current.q;
    }
}

void driveJoints(const float *torque, bool on) {
    for (int j = 0; j < Motors; j++) {
        BLDCMotor &motor = *motors[j];
        const float amperes = torque[j] / (torquePerAmpere[j] * gear[j]);
        motor.target = constrain(amperes, -MostAmperes, MostAmperes);
        if (on && !motor.enabled) {
            // The motor must not start with the current of before it was switched off.
            motor.current_sp = 0.0f;
            motor.PID_current_q.reset();
            motor.PID_current_d.reset();
            motor.enable();
        } else if (!on && motor.enabled) {
            motor.disable();
        }
    }
}

hbot::Device<Motors> device("simplefoc 1.0", joints, readJoints, driveJoints);

// Returns false if the motor is not ready.
bool begin(BLDCMotor &motor, BLDCDriver3PWM &driver, MagneticSensorSPI &sensor,
           LowsideCurrentSense &current) {
    sensor.init();
    motor.linkSensor(&sensor);
    driver.voltage_power_supply = 24.0f;
    driver.init();
    motor.linkDriver(&driver);
    current.linkDriver(&driver);
    current.init();
    motor.linkCurrentSense(&current);
    motor.controller = MotionControlType::torque;
    motor.torque_controller = TorqueControlType::foc_current;
    motor.current_limit = MostAmperes;
    motor.init();
    // With both of these known, initFOC does not turn the motor at boot, which docs/link.md
    // forbids. SimpleFOC's example find_sensor_offset_and_direction prints them; put your own here.
    motor.zero_electric_angle = 1.57f;
    motor.sensor_direction = Direction::CW;
    current.skip_align = true;
    const bool ready = motor.initFOC() != 0;
    motor.disable();
    return ready;
}

void setup() {
    Serial.begin(3000000);
    const bool steerReady = begin(steer, steerDriver, steerSensor, steerCurrent);
    const bool driveReady = begin(drive, driveDriver, driveSensor, driveCurrent);
    device.begin();
    if (!steerReady || !driveReady) {
        device.setCondition(hbot::Condition::Fault);
    }
}

void loop() {
    device.serve(Serial, micros());
    for (BLDCMotor *motor : motors) {
        motor->loopFOC();
        motor->move();
    }
}
