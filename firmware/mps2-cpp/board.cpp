#include "board.h"

void uartReceived();
void millisecondPassed();

namespace {

volatile uint32_t &at(uintptr_t address) { return *reinterpret_cast<volatile uint32_t *>(address); }

// CMSDK UART 0 (Arm DDI 0479, "APB UART").
constexpr uintptr_t UartData = 0x40004000u;
constexpr uintptr_t UartState = 0x40004004u;
constexpr uintptr_t UartControl = 0x40004008u;
constexpr uintptr_t UartInterrupt = 0x4000400Cu;
constexpr uintptr_t UartDivider = 0x40004010u;
constexpr uint32_t TransmitFull = 1, ReceiveFull = 2;

// The system timer of the processor, and the interrupt controller (Armv7-M).
constexpr uintptr_t TimerControl = 0xE000E010u;
constexpr uintptr_t TimerReload = 0xE000E014u;
constexpr uintptr_t TimerValue = 0xE000E018u;
constexpr uintptr_t InterruptEnable = 0xE000E100u;

// A counter of the board that wraps at 32 bits. It counts once in `Prescaler` + 1 cycles (Arm DAI
// 0386, section 4.3).
constexpr uintptr_t Counter = 0x40028018u;
constexpr uintptr_t Prescaler = 0x4002801Cu;

// Clock of the processor and the board, Hz.
constexpr uint32_t ClockHz = 25000000;

volatile uint8_t received[256];
// The places wrap at 256, as the buffer does.
volatile uint8_t head, tail;

} // namespace

void uartReceived() {
    at(UartInterrupt) = 2; // The interrupt is taken.
    while ((at(UartState) & ReceiveFull) != 0) {
        const uint8_t next = static_cast<uint8_t>(at(UartData));
        const uint8_t place = head;
        // With a full buffer the byte is lost, and with it one frame, which its CRC shows.
        if (static_cast<uint8_t>(place + 1) != tail) {
            received[place] = next;
            head = static_cast<uint8_t>(place + 1);
        }
    }
}

// The timer only wakes the main loop, which polls the watchdog.
void millisecondPassed() {}

namespace board {

void begin() {
    at(Prescaler) = ClockHz / 1000000 - 1;
    at(TimerReload) = ClockHz / 1000 - 1;
    at(TimerValue) = 0;
    at(TimerControl) = 7; // On, with interrupt, from the processor's clock.
    at(UartDivider) = 16; // The fastest; an emulated line has no baud rate.
    at(UartControl) = 1 | 2 | 8; // Send, receive, interrupt when a byte has come.
    at(InterruptEnable) = 1; // Interrupt 0.
}

uint32_t micros() { return at(Counter); }

void sleep() {
    // With interrupts masked, a byte that comes after the check still wakes the processor.
    asm volatile("cpsid i" ::: "memory");
    if (head == tail) {
        asm volatile("wfi" ::: "memory");
    }
    asm volatile("cpsie i" ::: "memory");
}

int Uart::available() const { return static_cast<uint8_t>(head - tail); }

int Uart::read() {
    const uint8_t place = tail;
    const uint8_t byte = received[place];
    tail = static_cast<uint8_t>(place + 1);
    return byte;
}

int Uart::availableForWrite() const { return (at(UartState) & TransmitFull) == 0 ? 1 : 0; }

void Uart::write(const uint8_t *bytes, size_t length) {
    for (size_t i = 0; i < length; i++) {
        while ((at(UartState) & TransmitFull) != 0) {
        }
        at(UartData) = bytes[i];
    }
}

} // namespace board
