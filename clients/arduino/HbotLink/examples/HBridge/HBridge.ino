// Two brushed motors on H-bridges (direction and PWM pins) with quadrature encoders: steer and
// drive of one wheel. The pins are those of your board; all encoder pins need interrupts.

#include <HbotLink.h>

constexpr int Motors = 2;
constexpr float TwoPi = 6.28318531f;

struct Wiring {
    uint8_t a, b, direction, pwm;
};
const Wiring wiring[Motors] = {{2, 3, 4, 5}, {6, 7, 8, 9}};
// Pin that is low while the H-bridges report a fault.
constexpr uint8_t FaultPin = 10;
// Pin that switches the H-bridges on. With a PWM of 0 alone, many H-bridges brake the motors.
constexpr uint8_t EnablePin = 11;

// A motor and its gear, from the data sheet.
struct Motor {
    float countsPerTurn;   // counts of the encoder in one turn of the motor: 4 for each line
    float gear;            // turns of the motor for one turn of the joint
    float torquePerAmpere; // N m/A at the motor; equal to its V s/rad
    float resistance;      // ohm
};
const Motor motors[Motors] = {{2048.0f, 19.0f, 0.012f, 2.0f}, {2048.0f, 19.0f, 0.012f, 2.0f}};
constexpr float Supply = 12.0f; // V

const hbot::Joint joints[Motors] = {{2048, 0.4f, 0.0f}, {2048, 0.4f, 0.0f}};

// Encoders. Each edge of A or B is a count; `before` holds the last two bits.
volatile int32_t counts[Motors];
volatile uint8_t before[Motors];

template <int J> void edge() {
    static const int8_t step[16] = {0, -1, 1, 0, 1, 0, 0, -1, -1, 0, 0, 1, 0, 1, -1, 0};
    const uint8_t now =
        static_cast<uint8_t>(digitalRead(wiring[J].a) << 1 | digitalRead(wiring[J].b));
    counts[J] = counts[J] + step[before[J] << 2 | now];
    before[J] = now;
}

// Rates of the motors, rad/s: differences over a millisecond, smoothed over about four.
float rate[Motors];

void measureRates() {
    static int32_t last[Motors];
    static uint32_t lastUs;
    const uint32_t passedUs = micros() - lastUs;
    if (passedUs < 1000) {
        return;
    }
    lastUs += passedUs;
    for (int j = 0; j < Motors; j++) {
        const int32_t now = counts[j];
        const float turns = static_cast<float>(now - last[j]) / motors[j].countsPerTurn;
        last[j] = now;
        rate[j] += 0.25f * (turns * TwoPi / (1.0e-6f * static_cast<float>(passedUs)) - rate[j]);
    }
}

void readJoints(hbot::Reading *readings) {
    for (int j = 0; j < Motors; j++) {
        readings[j].count = counts[j];
        readings[j].rate = rate[j] / motors[j].gear;
        // The current and the temperature are not measured, and stay 0.
    }
}

void driveJoints(const float *torque, bool on) {
    for (int j = 0; j < Motors; j++) {
        // The voltage that makes this torque at this rate. `peakTorque` limits the current at the
        // present rate only: the driver must limit the current too.
        const Motor &motor = motors[j];
        const float amperes = torque[j] / (motor.torquePerAmpere * motor.gear);
        const float volts = amperes * motor.resistance + motor.torquePerAmpere * rate[j];
        float duty = on ? volts / Supply : 0.0f;
        digitalWrite(wiring[j].direction, duty < 0.0f ? HIGH : LOW);
        duty = duty < 0.0f ? -duty : duty;
        analogWrite(wiring[j].pwm, static_cast<int>(255.0f * (duty < 1.0f ? duty : 1.0f)));
    }
    digitalWrite(EnablePin, on ? HIGH : LOW);
}

hbot::Device<Motors> device("h-bridge 1.0", joints, readJoints, driveJoints);

template <int J> void beginMotor() {
    pinMode(wiring[J].direction, OUTPUT);
    pinMode(wiring[J].pwm, OUTPUT);
    pinMode(wiring[J].a, INPUT_PULLUP);
    pinMode(wiring[J].b, INPUT_PULLUP);
    attachInterrupt(digitalPinToInterrupt(wiring[J].a), edge<J>, CHANGE);
    attachInterrupt(digitalPinToInterrupt(wiring[J].b), edge<J>, CHANGE);
}

void setup() {
    pinMode(EnablePin, OUTPUT);
    digitalWrite(EnablePin, LOW);
    pinMode(FaultPin, INPUT_PULLUP);
    beginMotor<0>();
    beginMotor<1>();
    Serial.begin(3000000);
    device.begin();
}

void loop() {
    measureRates();
    const bool fault = digitalRead(FaultPin) == LOW;
    device.setCondition(fault ? hbot::Condition::Fault : hbot::Condition::Ready);
    device.serve(Serial, micros());
}
