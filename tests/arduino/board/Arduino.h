// The part of Arduino's functions that the examples use. `on_terminal.cpp` implements those that
// the example Loopback needs; the others are declared only, so that the examples can be compiled.
#ifndef ARDUINO_H
#define ARDUINO_H

#include <stddef.h>
#include <stdint.h>

constexpr uint8_t LOW = 0, HIGH = 1, OUTPUT = 1, INPUT_PULLUP = 2;
constexpr int CHANGE = 3;
constexpr uint8_t A0 = 14, A1 = 15, A2 = 16, A3 = 17;

// A macro as Arduino's, which evaluates its arguments more than once.
#define constrain(value, low, high) \
    ((value) < (low) ? (low) : ((value) > (high) ? (high) : (value)))

uint32_t micros();
void pinMode(uint8_t pin, uint8_t mode);
void digitalWrite(uint8_t pin, uint8_t level);
int digitalRead(uint8_t pin);
void analogWrite(uint8_t pin, int value);
int digitalPinToInterrupt(uint8_t pin);
void attachInterrupt(int interrupt, void (*handler)(), int mode);

class SerialPort {
public:
    void begin(unsigned long baud);
    int available();
    int read();
    int availableForWrite();
    size_t write(const uint8_t *bytes, size_t length);
};
extern SerialPort Serial;

void setup();
void loop();

#endif
