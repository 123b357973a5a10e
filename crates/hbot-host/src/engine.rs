//! One tick of the loop, the same in wall-clock and in virtual time: readings in, controller, command
//! out, sample.

use std::hint::black_box;
use std::time::Duration;

use hbot_core::inputs::Command::{Disable, Enable, Estop};
use hbot_core::inputs::{Commands, Inputs, JointFeedback, MAX_COMMANDS};
use hbot_core::mode::Mode;
use hbot_core::{CompiledScene, Controller};

use crate::bridge::LoopEnd;
use crate::clock::now_ns;
use crate::motors::Motors;
use crate::sample::{Answer, Counters, Sample, TickTiming};

/// Commands whose send time is remembered to tell the age of a reading; an older one has no age.
const SENT: usize = 1024;
/// How many times the final zero-torque command is sent, in case a frame is lost.
const STOPS: u32 = 3;

/// Everything that a tick touches. Nothing here allocates, frees or waits once it runs.
pub struct Engine {
    motors: Motors,
    controller: Controller,
    scene: Box<CompiledScene>,
    bridge: LoopEnd,
    /// The sequence of each of the last commands, and when it went out, ns.
    sent_at: Box<[(u32, u64); SENT]>,
    counters: Counters,
    recorder: Option<Recorder>,
    /// Enable as soon as the rig is idle, once.
    enable_when_idle: bool,
    /// Idle after the last tick.
    idle: bool,
    /// The nominal time of the last tick, ns.
    now_ns: u64,
}

/// The ticket of what the engine orders itself; nobody waits for its answer.
const OWN: u64 = 0;

/// What came in with each tick: enough to replay a run bit for bit.
pub type Recorder = Box<dyn FnMut(&CompiledScene, &Inputs, &hbot_core::Outputs) + Send>;

/// When a tick runs.
#[derive(Debug, Clone, Copy)]
pub struct TickTime {
    /// The number of the tick.
    pub tick: u64,
    /// Nominal time since the start, ns.
    pub t_ns: u64,
    /// Time awake before the deadline, ns.
    pub awake_ns: u64,
    /// Time from the deadline to the start of the tick, ns.
    pub lateness_ns: u64,
    /// It counts as late.
    pub late: bool,
    /// Ticks skipped since the last.
    pub skipped: u64,
}

impl Engine {
    /// An engine that renders `scene` with `controller` on `motors`.
    #[must_use]
    pub fn new(
        motors: Motors,
        controller: Controller,
        scene: Box<CompiledScene>,
        bridge: LoopEnd,
        recorder: Option<Recorder>,
    ) -> Self {
        Self {
            motors,
            controller,
            scene,
            bridge,
            sent_at: Box::new([(u32::MAX, 0); SENT]),
            counters: Counters::default(),
            recorder,
            enable_when_idle: false,
            idle: false,
            now_ns: 0,
        }
    }

    /// Has it enable the rig by itself, once, in the first tick in which that can be: the same tick in every run.
    #[must_use]
    pub fn enabling(mut self, enable: bool) -> Self {
        self.enable_when_idle = enable;
        self
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
    pub fn tick(&mut self, moment: &TickTime) {
        let started = now_ns();
        self.now_ns = moment.t_ns;
        let news = self.motors.receive(moment.t_ns, moment.tick as u32);
        let (commands, tickets) = self.orders();
        self.bridge.adopt_scene(&mut self.scene);
        let inputs = Inputs {
            tick: moment.tick,
            lateness_ns: moment.lateness_ns,
            feedback: news.feedback,
            corrupt_frames: news.damaged,
            rebooted: news.zeros_lost,
            commands,
        };

        let computing = now_ns();
        let outputs = self.controller.tick(&self.scene, &inputs);
        let computed = now_ns();

        self.counters.send_failures += self.motors.command(moment.t_ns, moment.tick as u32, &outputs.drive);
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
        self.counters.corrupt_frames += u64::from(news.damaged);
        self.counters.foreign_frames += news.foreign;
        self.counters.reopened += news.reopened;
        let mut answers = [None; MAX_COMMANDS];
        for ((answer, ticket), reply) in answers.iter_mut().zip(tickets).zip(outputs.replies) {
            *answer = reply.map(|reply| Answer { ticket, reply });
        }
        let sample = Sample {
            state: outputs.state,
            t_ns: moment.t_ns,
            scene: self.scene.revision(),
            timing: TickTiming {
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
    pub fn rehearse(&self, tick: u64) {
        let readings = self.motors.readings();
        let feedback = JointFeedback { sequence: readings.sequence.wrapping_add(1), ..*readings };
        let inputs = Inputs {
            tick,
            lateness_ns: 0,
            feedback: self.motors.has_answered().then_some(feedback),
            corrupt_frames: 0,
            rebooted: false,
            commands: Commands::default(),
        };
        black_box(self.controller.clone().tick(&self.scene, black_box(&inputs)));
    }

    /// Zero torque, motors off: the last thing that the controllers hear. Said more than once, `pause` apart, in case a
    /// frame is damaged on the line.
    pub fn stop(&mut self, tick: u32, pause: Duration) {
        for k in 0..STOPS {
            if k > 0 {
                std::thread::sleep(pause);
            }
            let now_ns = self.now_ns + u64::from(k) * pause.as_nanos() as u64;
            self.counters.send_failures += self.motors.switch_off(now_ns, tick.wrapping_add(k));
        }
        self.motors.release();
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
            let Some(order) = self.bridge.take_order() else { break };
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
}
