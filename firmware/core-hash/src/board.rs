//! The start of the image, its output and its end, on a Cortex-M with semihosting.

use cortex_m_semihosting::debug::{EXIT_FAILURE, EXIT_SUCCESS, exit};
use cortex_m_semihosting::hprintln;

#[cortex_m_rt::entry]
fn main() -> ! {
    let hashes = crate::hashes();
    for (width, [first, all], _) in hashes {
        hprintln!("{} 0x{:016X} 0x{:016X}", width, first, all);
    }
    end(hashes.iter().all(|(_, hash, golden)| hash == golden))
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    hprintln!("{}", info);
    end(false)
}

/// Ends the emulator with exit code 0 if `good` is true, and 1 otherwise.
fn end(good: bool) -> ! {
    exit(if good { EXIT_SUCCESS } else { EXIT_FAILURE });
    loop {}
}
