//! One tick of the loop, the same in wall-clock and in virtual time: frames in, controller, frame out, sample.

use std::time::Duration;

use hbot_core::inputs::Command::{Enable, Estop};
use hbot_core::inputs::{Commands, Complaints, Inputs, JointFeedback, MAX_COMMANDS};
use hbot_core::mode::Mode;
use hbot_core::outputs::Drive;
use hbot_core::{CompiledScene, Controller, MAX_JOINTS};
use hbot_link::{
    Command, ControllerFlags, Decoder, Feedback, FromController, JointFlags, MAX_COMMAND_FRAME, ToController,
    encode,
};

use crate::bridge::LoopEnd;
use crate::clock::now_ns;
use crate::sample::{Answer, Counters, Sample, Timing};
use crate::wire::Wire;

/// Send times remembered to tell the age of a reading.
const SENT: usize = 64;
/// How often the last command is said.
const STOPS: u32 = 3;
/// A rebooted controller is asked to describe itself this often, ticks.
const DESCRIBE_EVERY: u64 = 100;

/// Where each joint stands on the serial line, and how long controllers hold out without the host.
#[derive(Debug, Clone)]
pub struct Line {
    /// The place on the line of each joint, in the order steer, drive of each wheel.
    pub places: Vec<usize>,
    /// The controllers' watchdog time, ms.
    pub watchdog_ms: u16,
}

/// Everything that a tick touches. Nothing here allocates, frees or waits once it runs.
pub(crate) struct Engine<W> {
    wire: W,
    line: Line,
    controller: Controller,
    scene: Box<CompiledScene>,
    bridge: LoopEnd,
    decoder: Decoder<FromController>,
    received: [u8; 4096],
    frame: [u8; MAX_COMMAND_FRAME],
    /// When each of the last commands went out, ns, by sequence.
    sent_at: [u64; SENT],
    counters: Counters,
    recorder: Option<Recorder>,
    /// The line took only a part of the last frame.
    cut: bool,
    /// Enable as soon as the rig is idle, once.
    enable_when_idle: bool,
    /// Idle after the last tick.
    idle: bool,
}

/// The ticket of what the engine orders itself; nobody waits for its answer.
const OWN: u64 = 0;

/// What came in with each tick: enough to replay a run bit for bit.
pub type Recorder = Box<dyn FnMut(&CompiledScene, &Inputs, &hbot_core::Outputs) + Send>;

/// When a tick runs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moment {
    pub(crate) tick: u64,
    /// Nominal time since the start, ns.
    pub(crate) t_ns: u64,
    pub(crate) lateness_ns: u64,
    /// Counts as late.
    pub(crate) late: bool,
    /// Ticks skipped since the last.
    pub(crate) skipped: u64,
}

/// What the line brought since the last tick.
#[derive(Default)]
struct Received {
    feedback: Option<JointFeedback>,
    corrupt: u16,
    rebooted: bool,
}

impl<W: Wire> Engine<W> {
    pub(crate) fn new(
        wire: W,
        line: Line,
        controller: Controller,
        scene: Box<CompiledScene>,
        bridge: LoopEnd,
        recorder: Option<Recorder>,
    ) -> Self {
        Self {
            wire,
            line,
            controller,
            scene,
            bridge,
            decoder: Decoder::new(),
            received: [0; 4096],
            frame: [0; MAX_COMMAND_FRAME],
            sent_at: [0; SENT],
            counters: Counters::default(),
            recorder,
            cut: false,
            enable_when_idle: false,
            idle: false,
        }
    }

    /// Has it enable the rig by itself, once, in the first tick in which that can be: the same tick in every run.
    pub(crate) fn enabling(mut self, enable: bool) -> Self {
        self.enable_when_idle = enable;
        self
    }

    pub(crate) fn wire(&mut self) -> &mut W {
        &mut self.wire
    }

    pub(crate) fn bridge(&self) -> &LoopEnd {
        &self.bridge
    }

    /// One tick.
    pub(crate) fn tick(&mut self, moment: &Moment) {
        let started = now_ns();
        let received = self.receive();
        let (commands, tickets) = self.orders();
        self.adopt_scene();
        let inputs = Inputs {
            tick: moment.tick,
            lateness_ns: moment.lateness_ns,
            feedback: received.feedback,
            corrupt_frames: received.corrupt,
            rebooted: received.rebooted,
            commands,
        };

        let computing = now_ns();
        let outputs = self.controller.tick(&self.scene, &inputs);
        let computed = now_ns();

        self.send(moment.tick as u32, &outputs.drive);
        if received.rebooted && moment.tick.is_multiple_of(DESCRIBE_EVERY) {
            self.describe();
        }
        let sent = now_ns();
        self.sent_at[moment.tick as usize % SENT] = sent;
        let age_ns = inputs
            .feedback
            .filter(|_| outputs.state.fresh)
            .map(|f| sent.saturating_sub(self.sent_at[f.sequence as usize % SENT]));

        self.idle = outputs.state.mode == Mode::Idle;
        self.counters.late += u64::from(moment.late);
        self.counters.skipped += moment.skipped;
        self.counters.missed += u64::from(!outputs.state.fresh);
        self.counters.corrupt_frames += u64::from(received.corrupt);
        let mut answers = [None; MAX_COMMANDS];
        for ((answer, ticket), reply) in answers.iter_mut().zip(tickets).zip(outputs.replies) {
            *answer = reply.map(|reply| Answer { ticket, reply });
        }
        let sample = Sample {
            state: outputs.state,
            t_ns: moment.t_ns,
            scene: self.scene.revision(),
            timing: Timing {
                lateness_ns: moment.lateness_ns,
                compute_ns: computed - computing,
                link_ns: (computing - started) + (sent - computed),
                age_ns,
            },
            counters: self.counters,
            answers,
        };
        self.counters.dropped_samples += u64::from(!self.bridge.publish(sample));
        if let Some(recorder) = &mut self.recorder {
            recorder(&self.scene, &inputs, &outputs);
        }
    }

    /// Zero torque, motors off: the last thing that the controllers hear. Said more than once, `pause` apart, in case a
    /// frame is damaged on the line.
    pub(crate) fn stop(&mut self, tick: u32, pause: Duration) {
        for k in 0..STOPS {
            if k > 0 {
                std::thread::sleep(pause);
            }
            self.send(tick.wrapping_add(k), &Drive { enable: false, torque: [0.0; MAX_JOINTS] });
        }
    }

    /// Reads and decodes what has arrived; the newest feedback counts.
    fn receive(&mut self) -> Received {
        let mut all = Received::default();
        // A line that babbles faster than it is read is read on next tick.
        for _ in 0..4 {
            let n = self.wire.read(&mut self.received).unwrap_or(0);
            let (places, counters) = (&self.line.places, &mut self.counters);
            self.decoder.feed(&self.received[..n], |frame| match frame {
                Ok(FromController::Feedback(feedback)) if feedback.joints.len() == places.len() => {
                    all.rebooted |= feedback.flags.contains(ControllerFlags::UNDESCRIBED);
                    // The newest reading counts, and every complaint.
                    let complaints = all.feedback.map(|last| last.complaints).unwrap_or_default();
                    let mut reading = reading(&feedback, places);
                    reading.complaints = reading.complaints.or(complaints);
                    all.feedback = Some(reading);
                }
                Ok(FromController::Feedback(_)) => counters.foreign_frames += 1,
                Ok(FromController::Description(_)) => {}
                Err(_) => all.corrupt = all.corrupt.saturating_add(1),
            });
            if n < self.received.len() {
                break;
            }
        }
        all
    }

    /// Takes at most as many orders as a tick may have.
    fn orders(&mut self) -> (Commands, [u64; MAX_COMMANDS]) {
        let mut commands = Commands::default();
        let mut tickets = [OWN; MAX_COMMANDS];
        // What the engine orders itself finds the tick's commands still empty.
        if self.idle && std::mem::take(&mut self.enable_when_idle) {
            let _ = commands.push(Enable);
        }
        if self.bridge.take_estop() {
            let _ = commands.push(Estop);
        }
        let own = commands.len();
        for ticket in &mut tickets[own..] {
            let Ok(order) = self.bridge.orders.pop() else { break };
            *ticket = order.ticket;
            // There are as many places as tickets.
            let _ = commands.push(order.command);
        }
        (commands, tickets)
    }

    /// Takes the newest scene; those that it replaces go back to be freed outside.
    fn adopt_scene(&mut self) {
        while let Ok(scene) = self.bridge.scenes.pop() {
            let old = std::mem::replace(&mut self.scene, scene);
            // The ring has a place for every scene that can be on its way.
            let _ = self.bridge.retired.push(old);
        }
    }

    fn send(&mut self, sequence: u32, drive: &Drive) {
        let mut command = Command {
            sequence,
            enable: drive.enable,
            watchdog_ms: self.line.watchdog_ms,
            ..Command::default()
        };
        let mut torque = [0.0_f32; MAX_JOINTS];
        for (joint, place) in self.line.places.iter().enumerate() {
            torque[*place] = drive.torque[joint] as f32;
        }
        // At most MAX_JOINTS, which is what it holds.
        let _ = command.torque.extend_from_slice(&torque[..self.line.places.len()]);
        self.write(&ToController::Command(command));
    }

    fn describe(&mut self) {
        self.write(&ToController::Describe);
    }

    fn write(&mut self, message: &ToController) {
        if self.cut {
            // A zero ends the half frame, or it would spoil this one too.
            self.cut = !self.wire.write(&[0]).is_ok_and(|written| written == 1);
        }
        let whole = encode(message, &mut self.frame)
            .is_ok_and(|n| self.wire.write(&self.frame[..n]).is_ok_and(|written| written == n));
        self.cut |= !whole;
        self.counters.send_failures += u64::from(!whole);
    }
}

/// A feedback frame in the order of the rig's joints.
fn reading(feedback: &Feedback, places: &[usize]) -> JointFeedback {
    let mut reading = JointFeedback {
        sequence: feedback.sequence,
        counts: [0; MAX_JOINTS],
        rates: [0.0; MAX_JOINTS],
        index_seen: 0,
        complaints: Complaints {
            fault: feedback.flags.contains(ControllerFlags::FAULT),
            watchdog: feedback.flags.contains(ControllerFlags::WATCHDOG_EXPIRED),
            ..Complaints::default()
        },
    };
    for (joint, place) in places.iter().enumerate() {
        let at = &feedback.joints[*place];
        reading.counts[joint] = at.count;
        reading.rates[joint] = f64::from(at.rate);
        reading.index_seen |= u16::from(at.flags.contains(JointFlags::INDEX_SEEN)) << joint;
        reading.complaints.overcurrent |= at.flags.contains(JointFlags::OVERCURRENT);
        reading.complaints.overtemperature |= at.flags.contains(JointFlags::OVERTEMPERATURE);
    }
    reading
}
