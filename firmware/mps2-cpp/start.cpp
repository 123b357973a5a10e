// Start-up code for a Cortex-M4F: the vector table, and what runs before `main`.

#include <stdint.h>

int main();
void uartReceived();
void millisecondPassed();

extern "C" {
// Set by image.ld.
extern uint32_t stackTop[], dataStart[], dataEnd[], dataImage[], bssStart[], bssEnd[];
extern void (*initStart[])();
extern void (*initEnd[])();

[[noreturn]] void reset();
[[noreturn]] void fault();
}

namespace {

volatile uint32_t &at(uintptr_t address) { return *reinterpret_cast<volatile uint32_t *>(address); }

} // namespace

// Starts the processor anew. The controller then comes up without torque and is not described,
// which the host sees (docs/link.md, "Seeing a reboot").
void fault() {
    at(0xE000ED0Cu) = 0x05FA0004u; // SYSRESETREQ in AIRCR.
    for (;;) {
    }
}

void reset() {
    at(0xE000ED88u) |= 0x00F00000u; // CPACR: the floating point unit is on.
    asm volatile("dsb\n isb" ::: "memory");
    const uint32_t *from = dataImage;
    for (uint32_t *to = dataStart; to != dataEnd; to++) {
        *to = *from++;
    }
    for (uint32_t *to = bssStart; to != bssEnd; to++) {
        *to = 0;
    }
    for (void (**init)() = initStart; init != initEnd; init++) {
        (*init)();
    }
    main();
    fault();
}

namespace {

union Vector {
    void (*handler)();
    const uint32_t *stack;
    constexpr Vector(void (*function)()) : handler(function) {}
    constexpr Vector(const uint32_t *top) : stack(top) {}
};

// 16 exceptions of the processor, then the interrupts of the board: 0 is UART 0, received.
__attribute__((section(".vectors"), used)) const Vector vectors[] = {
    stackTop, reset, fault, fault, fault, fault, fault, fault,
    fault,     fault, fault, fault, fault, fault, fault, millisecondPassed,
    uartReceived};

} // namespace
