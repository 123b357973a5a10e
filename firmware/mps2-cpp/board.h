// The parts of the board mps2-an386 that the image uses: UART 0 (CMSDK) and the system timer.

#ifndef BOARD_H
#define BOARD_H

#include <stddef.h>
#include <stdint.h>

namespace board {

// Switches on the UART and a timer that interrupts 1000 times a second.
void begin();

// Returns the time in microseconds. It wraps at 32 bits.
uint32_t micros();

// Sleeps until a byte comes, but not longer than a millisecond.
void sleep();

// UART 0, as `hbot::Device::serve` expects a port. Received bytes wait in a buffer of 256 bytes, of
// which the interrupt fills and the main loop empties its own end.
class Uart {
public:
    int available() const;
    int read();
    // Returns 1 if a byte can be written without waiting, and 0 otherwise.
    int availableForWrite() const;
    void write(const uint8_t *bytes, size_t length);
};

} // namespace board

#endif
