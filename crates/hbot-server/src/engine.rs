//! One tick of the loop, the same in wall-clock and in virtual time: frames in, controller, frame out, sample.

use std::hint::black_box;
use std::time::Duration;

use hbot_config::RigConfig;
use hbot_core::inputs::Command::{Disable, Enable, Estop};
use hbot_core::inputs::{Commands, Complaints, Inputs, JointFeedback, MAX_COMMANDS};
use hbot_core::mode::Mode;
use hbot_core::outputs::Drive;
use hbot_core::{CompiledScene, Controller, MAX_JOINTS};
use hbot_link::ToController;

use crate::bridge::LoopEnd;
use crate::clock::now_ns;
use crate::port::{NO_READINGS, Port};
use crate::sample::{Answer, Counters, Sample, Timing};
use crate::wire::Wire;

/// Commands whose send time is remembered to tell the age of a reading; an older one has no age.
const SENT: usize = 1024;
/// How often the last command is said.
const STOPS: u32 = 3;
/// A rebooted controller is asked to describe itself this often, ticks.
const DESCRIBE_EVERY: u64 = 100;

/// Where each joint stands on the serial lines, and how long controllers hold out without the host.
#[derive(Debug, Clone)]
pub struct Line {
    /// The place of each joint, in the order steer, drive of each wheel.
    pub places: Vec<Place>,
    /// What is added to the count of each joint, so that zero is where the rig has it.
    pub offsets: [i32; MAX_JOINTS],
    /// The controllers' watchdog time, ms.
    pub watchdog_ms: u16,
}

/// Where a joint stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// The line that carries it.
    pub port: usize,
    /// Its place on that line.
    pub at: usize,
}

impl Line {
    /// The lines of a rig.
    #[must_use]
    pub fn of(rig: &RigConfig) -> Self {
        let mut offsets = [0; MAX_JOINTS];
        for (j, offset) in offsets.iter_mut().enumerate().take(rig.rig.device.joints()).step_by(2) {
            let joint = &rig.rig.joints[j];
            let counts =
                rig.zero_offsets[j] / std::f64::consts::TAU * f64::from(joint.counts_per_turn) * joint.gear;
            // Wraps as the controllers' own counter does.
            *offset = (if joint.reversed { -counts } else { counts }).round() as i64 as i32;
        }
        if rig.link.port == hbot_config::rig::Port::Sim {
            // The simulated controllers stand on one line in the order of the joints.
            return Self { offsets, ..Self::single(0..rig.controllers.len(), rig.link.watchdog_ms) };
        }
        let places = rig.ports.iter().zip(&rig.controllers).map(|(port, at)| Place { port: *port, at: *at });
        Self { places: places.collect(), offsets, watchdog_ms: rig.link.watchdog_ms }
    }

    /// All joints on one line, `places` in the order steer, drive of each wheel.
    #[must_use]
    pub fn single(places: impl IntoIterator<Item = usize>, watchdog_ms: u16) -> Self {
        let places = places.into_iter().map(|at| Place { port: 0, at }).collect();
        Self { places, offsets: [0; MAX_JOINTS], watchdog_ms }
    }

    /// The joints on one of the lines, each with its place there.
    pub fn joints(&self, port: usize) -> impl Iterator<Item = (usize, usize)> {
        let all = self.places.iter().enumerate();
        all.filter(move |(_, place)| place.port == port).map(|(joint, place)| (joint, place.at))
    }
}

/// Everything that a tick touches. Nothing here allocates, frees or waits once it runs.
pub(crate) struct Engine<W> {
    ports: Vec<Port<W>>,
    watchdog_ms: u16,
    controller: Controller,
    scene: Box<CompiledScene>,
    bridge: LoopEnd,
    received: [u8; 4096],
    /// What the joints of all lines have told last, each in its own time.
    readings: JointFeedback,
    /// The sequence of each of the last commands, and when it went out, ns.
    sent_at: Box<[(u32, u64); SENT]>,
    counters: Counters,
    recorder: Option<Recorder>,
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
    /// Awake before the deadline.
    pub(crate) awake_ns: u64,
    pub(crate) lateness_ns: u64,
    /// Counts as late.
    pub(crate) late: bool,
    /// Ticks skipped since the last.
    pub(crate) skipped: u64,
}

/// What the lines brought since the last tick.
#[derive(Default)]
struct Received {
    feedback: Option<JointFeedback>,
    corrupt: u16,
    rebooted: bool,
}

impl<W: Wire> Engine<W> {
    /// `wires` are the lines in the order of `line`'s ports.
    pub(crate) fn new(
        wires: Vec<W>,
        line: &Line,
        controller: Controller,
        scene: Box<CompiledScene>,
        bridge: LoopEnd,
        recorder: Option<Recorder>,
    ) -> Self {
        let port = |(port, wire)| Port::new(wire, controller.rig(), line, port);
        Self {
            ports: wires.into_iter().enumerate().map(port).collect(),
            watchdog_ms: line.watchdog_ms,
            controller,
            scene,
            bridge,
            received: [0; 4096],
            readings: NO_READINGS,
            sent_at: Box::new([(u32::MAX, 0); SENT]),
            counters: Counters::default(),
            recorder,
            enable_when_idle: false,
            idle: false,
        }
    }

    /// Has it enable the rig by itself, once, in the first tick in which that can be: the same tick in every run.
    pub(crate) fn enabling(mut self, enable: bool) -> Self {
        self.enable_when_idle = enable;
        self
    }

    /// Tells simulated lines what time it is, ns.
    pub(crate) fn set_time(&mut self, now_ns: u64) {
        self.ports.iter_mut().for_each(|port| port.wire.set_time(now_ns));
    }

    /// What has been counted so far.
    #[cfg(test)]
    pub(crate) fn counters(&self) -> &Counters {
        &self.counters
    }

    pub(crate) fn bridge(&self) -> &LoopEnd {
        &self.bridge
    }

    /// One tick.
    pub(crate) fn tick(&mut self, moment: &Moment) {
        let started = now_ns();
        let received = self.receive(moment.tick as u32);
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
            for port in self.ports.iter_mut().filter(|port| port.undescribed) {
                self.counters.send_failures += u64::from(!port.write(&ToController::Describe));
            }
        }
        let sent = now_ns();
        self.sent_at[moment.tick as usize % SENT] = (moment.tick as u32, sent);
        let age_ns = inputs.feedback.filter(|_| outputs.state.fresh).and_then(|feedback| {
            let (sequence, at) = self.sent_at[feedback.sequence as usize % SENT];
            (sequence == feedback.sequence).then(|| sent.saturating_sub(at))
        });

        self.idle = outputs.state.mode == Mode::Idle;
        // After a fault or a stop torque comes back only if somebody asks for it.
        self.enable_when_idle &= !matches!(outputs.state.mode, Mode::Fault | Mode::Estop);
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
                awake_ns: moment.awake_ns,
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

    /// What `tick` is going to compute if the line brings what it brought last, on a copy that is thrown away: code and data are in
    /// the caches afterwards, and nothing else has changed.
    #[inline(never)]
    pub(crate) fn rehearse(&self, tick: u64) {
        let heard = self.ports.iter().any(|port| port.sequence.is_some());
        let feedback = JointFeedback { sequence: self.readings.sequence.wrapping_add(1), ..self.readings };
        let inputs = Inputs {
            tick,
            lateness_ns: 0,
            feedback: heard.then_some(feedback),
            corrupt_frames: 0,
            rebooted: false,
            commands: Commands::default(),
        };
        black_box(self.controller.clone().tick(&self.scene, black_box(&inputs)));
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
        self.ports.iter_mut().for_each(|port| port.wire.all_said());
    }

    /// Reads and decodes what has arrived on all lines; of each the newest feedback counts.
    fn receive(&mut self, tick: u32) -> Received {
        let mut all = Received::default();
        let mut complaints = Complaints::default();
        let mut news = false;
        for port in &mut self.ports {
            port.receive(tick, &mut self.received, &mut self.counters);
            all.corrupt = all.corrupt.saturating_add(std::mem::take(&mut port.corrupt));
            all.rebooted |= port.undescribed | std::mem::take(&mut port.rebooted);
            complaints = complaints.or(std::mem::take(&mut port.complaints));
            if let Some(feedback) = port.fresh.take() {
                news = true;
                port.take(&feedback, &mut self.readings);
            }
        }
        // The oldest answer tells how new all together are: what the core takes as news is news of every joint. Complaints it
        // takes at any rate.
        let age = |sequence: u32| tick.wrapping_sub(sequence);
        let oldest = self.ports.iter().try_fold(tick, |oldest, port| {
            port.sequence.map(|sequence| if age(sequence) > age(oldest) { sequence } else { oldest })
        });
        if let Some(sequence) = oldest.filter(|_| news || complaints != Complaints::default()) {
            self.readings.sequence = sequence;
            all.feedback = Some(JointFeedback { complaints, ..self.readings });
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
        // One place is left for an emergency stop, whose flag is looked at last: whoever has found its
        // confirmation in the ring finds the flag set.
        let own = commands.len();
        for ticket in &mut tickets[own..MAX_COMMANDS - 1] {
            let Ok(order) = self.bridge.orders.pop() else { break };
            *ticket = order.ticket;
            // A rig that somebody wants off does not come on by itself.
            self.enable_when_idle &= order.command != Disable;
            // There are as many places as tickets.
            let _ = commands.push(order.command);
        }
        if self.bridge.take_estop() {
            let _ = commands.push(Estop);
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
        for port in &mut self.ports {
            let command = port.command(sequence, self.watchdog_ms, drive);
            self.counters.send_failures += u64::from(!port.write(&ToController::Command(command)));
        }
    }
}
