//! The loop over embedded-io, on a port in memory.

use core::convert::Infallible;

use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write, WriteReady};
use hbot_device::run;
use hbot_link::{ControllerFlags, Decoder, FromController};

use crate::bench::{Bench, PUSH, command_frame};

/// A serial port whose host sends `input` and then falls silent. It takes few bytes at a time.
struct Port {
    input: Vec<u8>,
    output: Vec<u8>,
    /// Number of bytes after which the host stops reading.
    room: usize,
    /// Number of times the loop may ask whether bytes have arrived before the port fails.
    looks: u32,
}

impl ErrorType for Port {
    type Error = ErrorKind;
}

impl ReadReady for Port {
    fn read_ready(&mut self) -> Result<bool, ErrorKind> {
        self.looks = self.looks.checked_sub(1).ok_or(ErrorKind::NotConnected)?;
        Ok(!self.input.is_empty())
    }
}

impl Read for Port {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
        assert!(!self.input.is_empty(), "the loop would wait for the port");
        let count = buffer.len().min(self.input.len()).min(5);
        buffer[..count].copy_from_slice(&self.input[..count]);
        self.input.drain(..count);
        Ok(count)
    }
}

impl WriteReady for Port {
    fn write_ready(&mut self) -> Result<bool, ErrorKind> {
        if self.output.len() == self.room {
            self.looks = self.looks.checked_sub(1).ok_or(ErrorKind::NotConnected)?;
        }
        Ok(self.output.len() < self.room)
    }
}

impl Write for Port {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        let count = bytes.len().min(7).min(self.room - self.output.len());
        assert!(count > 0, "the loop would wait for the port");
        self.output.extend(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}

/// Runs the loop on a port that fails after 200 looks. The host sends a command that is valid for
/// 20 ms, and then nothing. `step_us` is the time from one look at the clock to the next. Returns
/// the answers, and the calls of the builder's functions.
fn served(bench: &mut Bench, room: usize, step_us: u32) -> (Vec<u8>, Vec<&'static str>) {
    let mut port = Port { input: command_frame(true, 20, &PUSH), output: Vec::new(), room, looks: 200 };
    let mut now_us = bench.now_us;
    bench.hardware.calls.clear();
    let ended: Result<Infallible, _> = run(&mut bench.device, &mut bench.hardware, &mut port, || {
        now_us += step_us;
        now_us
    });
    bench.now_us = now_us;
    assert_eq!(ended, Err(ErrorKind::NotConnected));
    (port.output, bench.hardware.calls.clone())
}

#[test]
fn a_port_is_served_until_it_fails_and_the_joints_are_then_off() {
    let mut bench = Bench::new();
    let (output, calls) = served(&mut bench, 1000, 1);
    let mut answers = Vec::new();
    Decoder::new().feed(&output, |answer| answers.push(answer));
    let [Ok(FromController::Feedback(feedback))] = &answers[..] else { panic!("{answers:?}") };
    assert_eq!(feedback.flags, ControllerFlags::ENABLED);
    // The last call is because of the failure.
    assert_eq!(calls, ["drive", "read", "drive"]);
    assert!(bench.is_free());
    assert_eq!(bench.push(), ControllerFlags::WATCHDOG_EXPIRED, "torque does not come back by itself");
}

#[test]
fn the_watchdog_works_while_the_host_is_silent() {
    let (_, calls) = served(&mut Bench::new(), 1000, 1000);
    assert_eq!(calls, ["drive", "read", "drive", "drive"], "a command, the watchdog, the failure");
}

#[test]
fn the_watchdog_works_while_the_host_does_not_read() {
    let (output, calls) = served(&mut Bench::new(), 3, 1000);
    assert_eq!(output.len(), 3);
    assert_eq!(calls, ["drive", "read", "drive", "drive"], "a command, the watchdog, the failure");
}
