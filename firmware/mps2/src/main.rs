//! A motor controller for four joints on a Cortex-M4F, with hbot's own link on its serial port.
//!
//! It runs in QEMU, so the joints are simulated ([`plant`]). For real joints, replace the plant by
//! your encoders and motor drivers. `rig.toml` is the rig file for it.
//!
//! ```text
//! qemu-system-arm -M mps2-an386 -nographic -serial pty -kernel $(./build.sh)
//! ```
#![no_std]
#![no_main]

mod board;
mod plant;

use cortex_m_rt::entry;
use hbot_device::{Device, Identity};

use board::Board;
use plant::{JOINTS, Plant};

const IDENTITY: Identity = Identity::new(concat!("hbot-mps2 ", env!("CARGO_PKG_VERSION")), &JOINTS).unwrap();

#[entry]
fn main() -> ! {
    let board = Board::start();
    let mut plant = Plant::new(board.now_us());
    let mut device = Device::boot(IDENTITY, board.now_us(), &mut plant);
    loop {
        let now_us = board.now_us();
        plant.advance(now_us);
        device.poll(now_us, &mut plant);
        match board.received() {
            Some(byte) => {
                if let Some(answer) = device.receive(now_us, byte, &mut plant) {
                    send(&board, &answer, &mut device, &mut plant);
                }
            }
            None => board.sleep(),
        }
    }
}

/// Sends an answer. The watchdog works meanwhile: the host can stop reading at any time.
fn send(board: &Board, answer: &[u8], device: &mut Device, plant: &mut Plant) {
    for byte in answer {
        while !board.send(*byte) {
            plant.advance(board.now_us());
            device.poll(board.now_us(), plant);
        }
    }
}

/// Restarts the processor, which switches the motors off. The host sees `UNDESCRIBED`.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}
