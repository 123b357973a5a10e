//! Tests that a tick allocates no memory, and that no servo obeys a command that was cut short.

use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, PoisonError};

use hbot_config::RigConfig;
use hbot_config::rig::Protocol as Name;
use hbot_sim::controller::Line as SimulatedLine;
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};

use super::super::Moteus;
use super::super::codec::{self, Turn};
use super::super::text::{self, Dialect, Said};
use super::{Bench, rig_and_line, said};
use crate::bus::{Expected, Protocol as _};
use crate::line::{Line, Memory};
use crate::rig::layout::Layout;

/// A line for tests that returns one prepared answer per tick and ignores all written bytes.
struct Canned {
    answers: Vec<Vec<u8>>,
    next: usize,
}

impl Line for Canned {
    fn read(&mut self, _now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        // The first read comes before the first command, so there is no answer yet.
        let answer = self.next.checked_sub(1).and_then(|at| self.answers.get(at));
        self.next += 1;
        let answer = answer.map_or(&[][..], |answer| answer);
        buffer[..answer.len()].copy_from_slice(answer);
        Ok(answer.len())
    }

    fn write(&mut self, _now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        Ok(bytes.len())
    }
}

/// A line to simulated servos that records the bytes of their answers.
struct Noted(Memory, Arc<Mutex<Vec<Vec<u8>>>>);

impl Line for Noted {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.0.read(now_ns, buffer)?;
        if n > 0 {
            self.1.lock().unwrap_or_else(PoisonError::into_inner).push(buffer[..n].to_vec());
        }
        Ok(n)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.write(now_ns, bytes)
    }
}

#[test]
fn a_tick_allocates_nothing() {
    const TICKS: u32 = 200;
    let (rig, mut line, _calls) = rig_and_line();
    let expected = Expected::new("sim", &rig.rig, &Layout::of(&rig), 0);
    Moteus.meet(&mut line, &expected).expect("they are the rig's");
    let noted = Arc::default();
    let bus = Moteus.bus(Box::new(Noted(line, Arc::clone(&noted))), expected.clone());
    let mut bench = Bench { bus, calls: channel().0, tick: 1 };
    assert_eq!(bench.ticks(TICKS, true).1, TICKS - 1);
    let answers = std::mem::take(&mut *noted.lock().unwrap_or_else(PoisonError::into_inner));
    assert_eq!(answers.len() as u32, TICKS - 1);
    bench.bus = Moteus.bus(Box::new(Canned { answers, next: 0 }), expected);
    bench.tick = 1;
    let mut readings = 0;
    let allocated = allocation_counter::measure(|| readings = bench.ticks(TICKS, true).1);
    assert_eq!((allocated.count_total, readings), (0, TICKS - 1));
}

/// A torque command is cut short after any number of bytes, and then ended with
/// [`BREAK`](text::BREAK). The servo refuses it and stays in mode 0. If only an end of line
/// followed, the servo would obey the first part: a mode without torque and gains, which is
/// position mode.
#[test]
fn half_a_command_is_never_obeyed() {
    for (checksums, dialect) in [(false, Dialect::Fdcanusb), (true, Dialect::Uart)] {
        let rig = RigConfig::prototype().rig;
        let line = SimulatedLine { protocol: Name::Moteus, checksums };
        let config = SimulatedConfig { line, ..SimulatedConfig::new(&rig) };
        let mut rig = SimulatedRig::new(&config).expect("it can be simulated");
        let mut frame = codec::torque_frame(1, 0.1, 1.0, 0.02, &codec::torque_format());
        codec::state_query(Turn::Home).serialize(&mut frame);
        let mut command = Vec::new();
        text::push(&mut command, &frame, dialect);
        for most in 0..command.len() {
            let mut bytes = command[..most].to_vec();
            bytes.extend_from_slice(text::BREAK);
            let (mut reply, mut query) = (Vec::new(), codec::frame_to(1, true));
            codec::state_query(Turn::Home).serialize(&mut query);
            rig.receive(0, &bytes, &mut reply);
            reply.clear();
            let mut question = Vec::new();
            text::push(&mut question, &query, dialect);
            rig.receive(0, &question, &mut reply);
            let reply = String::from_utf8(reply).expect("text");
            let line = reply.lines().find(|line| line.starts_with("rcv")).expect("it answers");
            let Said::Frame(frame) = said(line, dialect) else { panic!("{line}") };
            let mode = codec::state(frame.payload()).and_then(|state| state.mode);
            assert_eq!(mode, Some(0), "after {most} bytes of {}", command.escape_ascii());
        }
    }
}
