//! The parts of the board that the firmware uses: a serial port, a clock, and sleep.
//!
//! Registers: Arm, *Cortex-M System Design Kit Technical Reference Manual* (DDI 0479), section 4.3
//! for the serial port, and *Application Note AN386* (DAI 0386), section 4.3 for the counter.

use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering::Relaxed};

use cortex_m::peripheral::NVIC;
use cortex_m::peripheral::syst::SystClkSource;

/// Frequency of the processor, Hz.
const CLOCK_HZ: u32 = 25_000_000;
/// Bit rate of the serial port. An emulator ignores it.
const BAUD: u32 = 1_000_000;

/// A register of the board, at its address.
struct Register(usize);

impl Register {
    fn read(&self) -> u32 {
        // SAFETY: all registers below are aligned words that exist on this board, and reading them
        // does not touch memory that Rust uses.
        unsafe { (self.0 as *const u32).read_volatile() }
    }

    fn write(&self, value: u32) {
        // SAFETY: as for `read`. None of the registers starts a transfer to memory.
        unsafe { (self.0 as *mut u32).write_volatile(value) }
    }
}

/// The byte that was received, or that is to be sent.
const UART_DATA: Register = Register(0x4000_4000);
const UART_STATE: Register = Register(0x4000_4004);
const UART_CONTROL: Register = Register(0x4000_4008);
/// Writing a bit clears the interrupt of that bit.
const UART_INTERRUPT: Register = Register(0x4000_400C);
/// Divides the processor's clock to the bit rate.
const UART_DIVIDER: Register = Register(0x4000_4010);
/// Counts up freely and wraps at 32 bits.
const COUNTER: Register = Register(0x4002_8018);
/// The counter counts once in this number of clock cycles, plus one.
const PRESCALER: Register = Register(0x4002_801C);

const STATE_SEND_FULL: u32 = 1 << 0;
const STATE_RECEIVED: u32 = 1 << 1;
const CONTROL_SEND: u32 = 1 << 0;
const CONTROL_RECEIVE: u32 = 1 << 1;
const CONTROL_RECEIVE_INTERRUPT: u32 = 1 << 3;
const INTERRUPT_RECEIVED: u32 = 1 << 1;

/// The serial port's interrupt for received bytes, the first of the board.
#[derive(Clone, Copy)]
struct Received;

// SAFETY: the number is that of the interrupt in `__INTERRUPTS`.
unsafe impl cortex_m::interrupt::InterruptNumber for Received {
    fn number(self) -> u16 {
        0
    }
}

/// The interrupt handlers of the board, by number.
// SAFETY: cortex-m-rt expects the table under this name and in this section.
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
pub static __INTERRUPTS: [extern "C" fn(); 1] = [received];

/// Bytes that have arrived: written by the interrupt handler, read by the main loop. It holds any
/// command twice.
static RING: [AtomicU8; 256] = [const { AtomicU8::new(0) }; 256];
static WRITTEN: AtomicUsize = AtomicUsize::new(0);
static READ: AtomicUsize = AtomicUsize::new(0);

/// Takes a byte from the serial port. A byte for which there is no room is lost, and its frame is
/// then refused.
extern "C" fn received() {
    UART_INTERRUPT.write(INTERRUPT_RECEIVED);
    while UART_STATE.read() & STATE_RECEIVED != 0 {
        let byte = UART_DATA.read() as u8;
        let written = WRITTEN.load(Relaxed);
        if written.wrapping_sub(READ.load(Relaxed)) < RING.len() {
            RING[written % RING.len()].store(byte, Relaxed);
            WRITTEN.store(written.wrapping_add(1), Relaxed);
        }
    }
}

/// The interrupt of the processor's timer, every millisecond. It only wakes the main loop.
#[cortex_m_rt::exception]
fn SysTick() {}

/// The board, with its serial port and its clocks running.
pub struct Board(());

impl Board {
    /// Starts the clocks and the serial port.
    pub fn start() -> Self {
        PRESCALER.write(CLOCK_HZ / 1_000_000 - 1);
        if let Some(mut core) = cortex_m::Peripherals::take() {
            core.SYST.set_clock_source(SystClkSource::Core);
            core.SYST.set_reload(CLOCK_HZ / 1000 - 1);
            core.SYST.clear_current();
            core.SYST.enable_interrupt();
            core.SYST.enable_counter();
        }
        UART_DIVIDER.write(CLOCK_HZ / BAUD);
        UART_CONTROL.write(CONTROL_SEND | CONTROL_RECEIVE | CONTROL_RECEIVE_INTERRUPT);
        // SAFETY: the handler uses nothing but atomic numbers and the port's own registers.
        unsafe { NVIC::unmask(Received) };
        Self(())
    }

    /// Returns the time in microseconds of a clock that wraps at 32 bits.
    pub fn now_us(&self) -> u32 {
        COUNTER.read()
    }

    /// Returns the next byte that has arrived.
    pub fn received(&self) -> Option<u8> {
        let read = READ.load(Relaxed);
        if read == WRITTEN.load(Relaxed) {
            return None;
        }
        let byte = RING[read % RING.len()].load(Relaxed);
        READ.store(read.wrapping_add(1), Relaxed);
        Some(byte)
    }

    /// Sends a byte. Returns false if the port is busy.
    pub fn send(&self, byte: u8) -> bool {
        let free = UART_STATE.read() & STATE_SEND_FULL == 0;
        if free {
            UART_DATA.write(byte.into());
        }
        free
    }

    /// Sleeps until a byte arrives, but not longer than a millisecond.
    pub fn sleep(&self) {
        // With interrupts masked, a byte that arrives between the check and the instruction still
        // ends the sleep. Its handler runs after the mask is lifted.
        cortex_m::interrupt::free(|_| {
            if READ.load(Relaxed) == WRITTEN.load(Relaxed) {
                cortex_m::asm::wfi();
            }
        });
    }
}
