//! Tests of the engine with disturbed serial lines: frames in pieces, damaged, late, duplicated or
//! out of order; several lines; lines that are lost and reopened.

mod anew;
mod busy;
mod bytes;
mod frames;
mod ports;
mod states;

use std::sync::{Arc, Mutex};
use std::time::Instant;

use hbot_config::RigConfig;
use hbot_core::inputs::Command as Order;
use hbot_core::safety::mode::{Cause, Mode};
use hbot_link::{
    Command, ControllerFlags, Decoder, Description, Feedback, FromController, JointDescription, JointFlags,
    JointReading, MAX_FEEDBACK_FRAME, PROTOCOL_VERSION, ToController, encode,
};

use crate::bus::drivers::hbot::HbotLink;
use crate::bus::{BusCommand, Expected, Heard, MotorBus, Protocol as _};
use crate::line::{Line, Renewed};
use crate::rig::layout::Layout;
use crate::run_loop::sample::Sample;
use crate::tests::tick_bench::{TickBench, default_scene, on_time};

/// Simulated motor controllers that answer every command with constant encoder counts, and the
/// disturbances of their answers that a test sets.
#[derive(Default)]
struct Far {
    joints: usize,
    decoder: Decoder<ToController>,
    heard: Vec<Command>,
    heard_at: Vec<Instant>,
    asked: u32,
    flags: ControllerFlags,
    /// True if the power supply of the motors is off: the controllers then never report `ENABLED`.
    unsupplied: bool,
    index_seen: bool,
    /// Temperature, °C, and current, A, that the controllers report for the last joint, if set.
    warmth: Option<[f32; 2]>,
    silent: bool,
    renewed: Option<Renewed>,
    answers: Vec<Vec<u8>>,
}

#[derive(Clone)]
struct Fake(Arc<Mutex<Far>>);

impl Fake {
    fn new(joints: usize) -> Self {
        Self(Arc::new(Mutex::new(Far { joints, ..Far::default() })))
    }

    fn with<T>(&self, what: impl FnOnce(&mut Far) -> T) -> T {
        what(&mut self.0.lock().expect("no test has panicked"))
    }
}

fn framed(feedback: Feedback) -> Vec<u8> {
    let mut frame = [0; MAX_FEEDBACK_FRAME];
    let n = encode(&FromController::Feedback(feedback), &mut frame).expect("it fits");
    frame[..n].to_vec()
}

fn answer(sequence: u32, flags: ControllerFlags, joints: usize, warmth: Option<[f32; 2]>) -> Vec<u8> {
    let reading = |j: usize| JointReading { count: j as i32, ..JointReading::default() };
    let mut feedback = Feedback { sequence, flags, joints: (0..joints).map(reading).collect() };
    if let (Some([temperature, current]), Some(last)) = (warmth, feedback.joints.last_mut()) {
        (last.temperature, last.current) = (temperature, current);
    }
    framed(feedback)
}

impl Line for Fake {
    fn read(&mut self, _now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.with(|far| {
            let bytes: Vec<u8> = far.answers.drain(..).flatten().collect();
            buffer[..bytes.len()].copy_from_slice(&bytes);
            Ok(bytes.len())
        })
    }

    fn write(&mut self, _now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        self.with(|far| {
            let Far {
                joints,
                decoder,
                heard,
                heard_at,
                asked,
                flags,
                unsupplied,
                index_seen,
                warmth,
                silent,
                answers,
                ..
            } = far;
            decoder.feed(bytes, |message| match message {
                Ok(ToController::Command(command)) => {
                    let mut flags = *flags;
                    flags.set(ControllerFlags::ENABLED, command.enable && !*unsupplied);
                    if !*silent && !*index_seen {
                        answers.push(answer(command.sequence, flags, *joints, *warmth));
                    } else if !*silent {
                        let reading =
                            JointReading { flags: JointFlags::INDEX_SEEN, ..JointReading::default() };
                        let joints = (0..*joints).map(|_| reading).collect();
                        answers.push(framed(Feedback { sequence: command.sequence, flags, joints }));
                    }
                    heard.push(command);
                    heard_at.push(Instant::now());
                }
                Ok(ToController::Describe) => *asked += 1,
                Err(_) => {}
            });
        });
        Ok(bytes.len())
    }

    fn renewed(&mut self) -> Option<Renewed> {
        self.with(|far| far.renewed.take())
    }
}

/// Returns an engine whose buses have not identified their controllers yet, so that a test sees the
/// first frame on each line.
fn bench(rig: &RigConfig, lines: Vec<impl Line + 'static>, layout: &Layout) -> TickBench {
    let bus = |(bus, line)| HbotLink.bus(Box::new(line), Expected::new("test", &rig.rig, layout, bus));
    TickBench::new(rig, lines.into_iter().enumerate().map(bus).collect(), layout, default_scene())
}

/// A bus that has not identified its controllers, and the line to them.
fn bus_and_line() -> (Box<dyn MotorBus>, Fake) {
    let fake = Fake::new(4);
    let rig = RigConfig::prototype().rig;
    let expected = Expected::new("test", &rig, &Layout::single(0..4), 0);
    (HbotLink.bus(Box::new(fake.clone()), expected), fake)
}

fn read(bus: &mut dyn MotorBus, fake: &Fake, tick: u32, bytes: &[u8]) -> Heard {
    fake.with(|far| far.answers = vec![bytes.to_vec()]);
    bus.receive(0, tick)
}
