//! The motor controllers' side of hbot's serial line, for firmware. The simulated rig uses the same
//! code. The crate needs neither the standard library nor an allocator.
//!
//! You write two functions for your hardware, [`Joints::read`] and [`Joints::drive`]. A [`Device`]
//! does everything else that `docs/link.md` requires of a motor controller: it decodes and checks
//! commands, answers them, limits the torque and the heat of each joint, and switches the joints
//! off when the watchdog expires, when the hardware has a fault, and after boot.
//!
//! # An example
//!
//! This is a complete firmware for two joints. Only `board` is missing: the functions of your
//! microcontroller and its motor drivers.
//!
//! ```
//! use hbot_device::{Device, Identity, Joint, JointReading, Joints};
//! # use hbot_link::{Command, ToController, encode};
//! # use std::cell::RefCell;
//! # #[derive(Default)]
//! # struct Board { input: RefCell<Vec<u8>>, sent: RefCell<usize>, amperes: RefCell<[f32; 2]> }
//! # impl Board {
//! #     fn encoder(&self, _: usize) -> i32 { 0 }
//! #     fn rate(&self, _: usize) -> f32 { 0.0 }
//! #     fn temperature(&self, _: usize) -> f32 { 25.0 }
//! #     fn enable_drivers(&self, _: bool) {}
//! #     fn set_current(&self, j: usize, amperes: f32) { self.amperes.borrow_mut()[j] = amperes; }
//! #     fn micros(&self) -> u32 { 0 }
//! #     fn has_power(&self) -> bool { !self.input.borrow().is_empty() }
//! #     fn serial_read(&self) -> Option<u8> { self.input.borrow_mut().pop() }
//! #     fn serial_write(&self, bytes: &[u8]) { *self.sent.borrow_mut() += bytes.len(); }
//! # }
//!
//! const STEER: Joint = Joint { counts_per_turn: 16384, peak: 0.93, max_temperature: 80.0 };
//! const DRIVE: Joint = Joint { counts_per_turn: 16384, peak: 0.14, max_temperature: 80.0 };
//! const IDENTITY: Identity = Identity::new("my rig 1.0", &[STEER, DRIVE]).unwrap();
//!
//! const NM_PER_AMPERE: f32 = 0.05; // torque of a motor after its gear, for each ampere
//! const MOST_AMPERES: f32 = 10.0; // what the drivers and the motors stand
//!
//! struct Motors<'a> {
//!     board: &'a Board,
//! }
//!
//! impl Joints for Motors<'_> {
//!     fn read(&mut self, readings: &mut [JointReading]) {
//!         for (j, reading) in readings.iter_mut().enumerate() {
//!             reading.count = self.board.encoder(j);
//!             reading.rate = self.board.rate(j); // rad/s of the joint
//!             reading.temperature = self.board.temperature(j); // of the motor
//!         }
//!     }
//!
//!     fn drive(&mut self, torque: &[f32], on: bool) {
//!         for (j, torque) in torque.iter().enumerate() {
//!             let amperes = torque / NM_PER_AMPERE;
//!             self.board.set_current(j, amperes.clamp(-MOST_AMPERES, MOST_AMPERES));
//!         }
//!         self.board.enable_drivers(on);
//!     }
//! }
//!
//! fn firmware(board: &Board) {
//!     let mut motors = Motors { board };
//!     let mut device = Device::boot(IDENTITY, board.micros(), &mut motors);
//!     while board.has_power() {
//!         // Without this call the watchdog could not expire while no bytes arrive.
//!         device.poll(board.micros(), &mut motors);
//!         if let Some(byte) = board.serial_read()
//!             && let Some(answer) = device.receive(board.micros(), byte, &mut motors)
//!         {
//!             board.serial_write(&answer); // must not wait for the host: see run()
//!         }
//!     }
//! }
//! # let board = Board::default();
//! # let torque = [0.05, -9.0].into_iter().collect();
//! # let command = Command { sequence: 1, enable: true, watchdog_ms: 20, torque };
//! # for message in [ToController::Describe, ToController::Command(command)] {
//! #     let mut frame = [0; 100];
//! #     let length = encode(&message, &mut frame).unwrap();
//! #     board.input.borrow_mut().splice(..0, frame[..length].iter().rev().copied());
//! # }
//! # firmware(&board);
//! # assert!(*board.sent.borrow() > 30);
//! # assert_eq!(*board.amperes.borrow(), [1.0, -2.8]);
//! ```
//!
//! # Where to call it
//!
//! - **One loop.** As above, if no pass of the loop takes longer than a millisecond, also while the
//!   host does not read.
//! - **Interrupts.** Call [`Device::receive`] in the interrupt of the serial port and
//!   [`Device::poll`] in the interrupt of a timer. Both must have the same priority, or share the
//!   device by a critical section.
//! - **Async tasks.** One task waits for a byte or for the next millisecond, whichever comes first.
//! - **A serial port that implements the traits of embedded-io.** Call [`run`], which is the loop
//!   above (feature `embedded-io`, enabled by default).
//!
//! # Time
//!
//! The age of a reading limits the stiffness that the rig can render. So let no byte wait, and send
//! an answer at once. [`Joints::drive`] comes before [`Joints::read`], so the reading is as new as
//! possible when it leaves. The clock can start at any value and can wrap.
//!
//! # Memory
//!
//! The sizes are fixed, for up to 16 joints. `firmware/mps2` is an image for a Cortex-M4F with four
//! simulated joints and this crate. It has 6 KiB of flash, of which 1 KiB is the table of the CRC.
//! It uses 3 KiB of RAM at most, of which 2.5 KiB are the stack with the [`Device`] on it.
//! `.ci/firmware.sh` measures both.
//!
//! Frames are checked without a table unless a feature asks for one. `crc-table` takes 1 KiB of
//! flash and needs one step for each byte of a frame instead of eight. `crc-table-16` takes 16 KiB
//! and is meant for a PC.
#![no_std]

mod answer;
mod device;
mod identity;
mod joints;
#[cfg(feature = "embedded-io")]
mod run;
mod watchdog;

pub use answer::Answer;
pub use device::Device;
pub use hbot_link::{JointFlags, JointReading};
pub use identity::{Identity, Joint};
pub use joints::{Condition, Joints};
#[cfg(feature = "embedded-io")]
pub use run::run;
