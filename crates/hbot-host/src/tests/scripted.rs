//! A line and a motor bus that a test scripts. They keep what was written and commanded.

use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::bus::{BusCommand, Heard, MotorBus, Telemetry};
use crate::line::Line;

/// What a test sets and sees of a [`ScriptedLine`].
#[derive(Default)]
pub(crate) struct Bytes {
    pub(crate) arrived: Vec<u8>,
    pub(crate) reads: u32,
    /// Number of bytes that the line takes of a write. `None` means all.
    pub(crate) room: Option<usize>,
    pub(crate) written: Vec<u8>,
    /// Number of times that the line has learned that the motors are off for good.
    pub(crate) released: u32,
}

/// A line of which the test keeps the other end. Time does not pass on it.
#[derive(Clone, Default)]
pub(crate) struct ScriptedLine(Arc<Mutex<Bytes>>);

impl ScriptedLine {
    pub(crate) fn end(&self) -> MutexGuard<'_, Bytes> {
        self.0.lock().expect("no test has panicked")
    }
}

impl Line for ScriptedLine {
    fn read(&mut self, _now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        let mut end = self.end();
        end.reads += 1;
        let n = end.arrived.len().min(buffer.len());
        buffer[..n].copy_from_slice(&end.arrived[..n]);
        end.arrived.drain(..n);
        Ok(n)
    }

    fn write(&mut self, _now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        let mut end = self.end();
        let n = end.room.map_or(bytes.len(), |room| room.min(bytes.len()));
        end.written.extend(&bytes[..n]);
        Ok(n)
    }

    fn pause(&mut self) {}

    fn release(&mut self) {
        self.end().released += 1;
    }
}

/// What a test sets and sees of a [`ScriptedBus`].
#[derive(Default)]
pub(crate) struct Script {
    /// What the bus hears in the next tick, or in every tick if `lasts` is true.
    pub(crate) report: Heard,
    pub(crate) lasts: bool,
    /// How long a call of `receive` and a call of `command` take.
    pub(crate) takes: [Duration; 2],
    /// True if the line takes no command.
    pub(crate) refuses: bool,
    /// True if a command panics.
    pub(crate) panics: bool,
    /// Each command, the time that came with it, ns, and when it came.
    pub(crate) commands: Vec<(BusCommand, u64, Instant)>,
    /// Number of times that the bus has learned that the motors are off for good.
    pub(crate) released: u32,
}

/// A motor bus whose reports a test writes.
#[derive(Clone, Default)]
pub(crate) struct ScriptedBus(Arc<Mutex<Script>>);

impl ScriptedBus {
    pub(crate) fn script(&self) -> MutexGuard<'_, Script> {
        self.0.lock().expect("no test has panicked")
    }

    /// Makes the bus report this in the next tick.
    pub(crate) fn reports(&self, heard: Heard) {
        self.script().report = heard;
    }

    pub(crate) fn last(&self) -> BusCommand {
        self.script().commands.last().expect("a command").0
    }
}

impl MotorBus for ScriptedBus {
    fn receive(&mut self, _: u64, _: u32) -> Heard {
        let mut script = self.script();
        let report = if script.lasts { script.report } else { std::mem::take(&mut script.report) };
        let takes = script.takes[0];
        drop(script);
        sleep(takes);
        report
    }

    fn command(&mut self, now_ns: u64, command: &BusCommand) -> bool {
        let mut script = self.script();
        let (takes, refuses, panics) = (script.takes[1], script.refuses, script.panics);
        if !panics {
            script.commands.push((*command, now_ns, Instant::now()));
        }
        drop(script);
        assert!(!panics, "as a test asks");
        sleep(takes);
        !refuses
    }

    /// Reports a current of 10 A on the first joint, and 1 A more on each joint after it.
    fn telemetry(&self, now_ns: u64, at: usize) -> Telemetry {
        let current = Some(10.0 + at as f32).filter(|_| now_ns == 7);
        Telemetry { current, ..Telemetry::default() }
    }

    fn release(&mut self) {
        self.script().released += 1;
    }
}
