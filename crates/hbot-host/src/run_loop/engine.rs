//! One tick of the loop: it takes readings in, runs the controller, sends the command and publishes
//! a sample. It works identically in wall-clock and in virtual time.

use std::hint::black_box;
use std::time::{Duration, Instant};

use hbot_core::inputs::Command::{Disable, Enable, Estop, Model};
use hbot_core::inputs::{Commands, Inputs, JointReadings, MAX_COMMANDS};
use hbot_core::safety::mode::Mode;
use hbot_core::{CompiledScene, Controller, Outputs};

use crate::rig::motors::Motors;
use crate::run_loop::bridge::LoopEnd;
use crate::run_loop::clock::now_ns;
use crate::run_loop::sample::{Answer, Counters, Sample, TickTiming};

/// Number of recent commands whose send times are stored, to compute the age of a reading. If a
/// reading answers an older command, its age is unknown.
const SENT: usize = 1024;
/// How many times the final zero-torque command is sent, in case a frame is lost.
const STOPS: u32 = 3;
/// Longest time that the end of the loop waits for the service to take the last sample.
const LAST_WITHIN: Duration = Duration::from_secs(1);

/// The state of the control loop: everything that a tick uses. A tick neither allocates nor frees
/// memory, and never waits.
pub struct Engine {
    motors: Motors,
    /// In a box, because it is large and an engine is moved to its thread.
    controller: Box<Controller>,
    scene: Box<CompiledScene>,
    bridge: LoopEnd,
    /// Tick number and send time (ns) of each of the last commands, from which the age of a reading
    /// is computed.
    sent_at: Box<[(u32, u64); SENT]>,
    counters: Counters,
    recorder: Option<Recorder>,
    /// True if the engine must itself give the command `enable` in the first tick after the mode
    /// has become `idle`. It does so at most once.
    enable_when_idle: bool,
    /// True if the rig is simulated and its time waits for a late tick.
    time_waits: bool,
    /// True if the mode was `idle` after the last tick.
    idle: bool,
    /// Nominal time of the last tick since the start of the loop, ns.
    now_ns: u64,
    /// The last sample, if it found no place.
    untold: Option<Sample>,
}

/// Ticket of the commands that the engine itself creates. No client waits for their answers.
const OWN: u64 = 0;

/// A tick that has been run and whose command has been sent, as a recorder receives it.
pub struct Ticked<'a> {
    /// The scene that was rendered.
    pub scene: &'a CompiledScene,
    /// The inputs of the tick.
    pub inputs: &'a Inputs,
    /// The outputs of the tick.
    pub outputs: &'a Outputs,
    /// What the tick has published.
    pub sample: &'a Sample,
    /// The state of the control law after the tick.
    pub controller: &'a Controller,
}

/// A callback that receives each tick in the loop's thread, after the tick's command has been sent.
/// The scenes and inputs suffice to replay a run bit for bit.
pub type Recorder = Box<dyn FnMut(&Ticked<'_>) + Send>;

/// The number and the timing of a tick that begins.
#[derive(Debug, Clone, Copy)]
pub struct TickTime {
    /// Number of the tick, from 0.
    pub tick: u64,
    /// Nominal time of the tick since the start of the loop, ns.
    pub t_ns: u64,
    /// Time for which the loop's thread was already awake before the deadline, ns.
    pub awake_ns: u64,
    /// Time from the deadline of the tick to its actual start, ns.
    pub lateness_ns: u64,
    /// True if the tick began more than a quarter period after its deadline.
    pub late: bool,
    /// Number of ticks that were skipped since the previous tick.
    pub skipped: u64,
}

impl Engine {
    /// Creates an engine that renders `scene` with `controller` on `motors`. The engine calls
    /// `recorder`, if there is one, in every tick.
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
            controller: Box::new(controller),
            scene,
            bridge,
            sent_at: Box::new([(u32::MAX, 0); SENT]),
            counters: Counters::default(),
            recorder,
            enable_when_idle: false,
            time_waits: false,
            idle: false,
            now_ns: 0,
            untold: None,
        }
    }

    /// Sets whether the engine itself gives the command `enable`, once, in the first tick in which
    /// this is possible. In virtual time, this tick has the same number in every run.
    #[must_use]
    pub fn enabling(mut self, enable: bool) -> Self {
        self.enable_when_idle = enable;
        self
    }

    /// Sets whether the rig is simulated and its time waits for a late tick. Lateness is then
    /// counted and published, but the control law gets none, so it causes no fault.
    #[must_use]
    pub fn waiting(mut self, waits: bool) -> Self {
        self.time_waits = waits;
        self
    }

    /// Returns the counters since the start of the loop.
    #[cfg(test)]
    pub(crate) fn counters(&self) -> &Counters {
        &self.counters
    }

    pub(crate) fn bridge(&self) -> &LoopEnd {
        &self.bridge
    }

    /// Runs one tick: reads the motors, computes the torques, sends the command and publishes a
    /// sample.
    pub fn tick(&mut self, moment: &TickTime) {
        let started = now_ns();
        self.now_ns = moment.t_ns;
        let news = self.motors.receive(moment.t_ns, moment.tick as u32);
        let (commands, tickets) = self.orders();
        self.bridge.adopt_scene(&mut self.scene);
        let inputs = Inputs {
            tick: moment.tick,
            lateness_ns: if self.time_waits { 0 } else { moment.lateness_ns },
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
        // After a fault or an emergency stop, torque returns only on a client's request.
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
                line_ns: (computing - started) + (sent - computed),
                age_ns,
            },
            counters: self.counters,
            answers,
            telemetry: self.motors.next_telemetry(moment.t_ns),
            complaints: news.feedback.map(|feedback| feedback.complaints).unwrap_or_default(),
            restarted: news.zeros_lost,
        };
        let placed = self.bridge.publish(sample);
        self.counters.dropped_samples += u64::from(!placed);
        self.untold = if placed { None } else { Some(sample) };
        if let Some(recorder) = &mut self.recorder {
            let (scene, controller) = (&self.scene, &*self.controller);
            recorder(&Ticked { scene, inputs: &inputs, outputs: &outputs, sample: &sample, controller });
        }
    }

    /// Computes the tick with number `tick` on a copy of the controller and discards the result, so
    /// that code and data are in the processor's caches when the real tick runs. It assumes that
    /// the next reading will equal the last one. The engine does not change.
    #[inline(never)]
    pub fn rehearse(&self, tick: u64) {
        let readings = self.motors.readings();
        let feedback = JointReadings { sequence: readings.sequence.wrapping_add(1), ..*readings };
        let inputs = Inputs {
            tick,
            lateness_ns: 0,
            feedback: self.motors.has_answered().then_some(feedback),
            corrupt_frames: 0,
            rebooted: false,
            commands: Commands::default(),
        };
        black_box(Controller::clone(&self.controller).tick(&self.scene, black_box(&inputs)));
    }

    /// Ends the session. Sends the command that switches the motors off several times, in case a
    /// frame is damaged on the line, with the time `pause` between two commands. Then releases the
    /// motor buses, and publishes the last sample if it found no place before, because it has all
    /// counts.
    pub fn stop(&mut self, tick: u32, pause: Duration) {
        for k in 0..STOPS {
            if k > 0 {
                std::thread::sleep(pause);
            }
            let now_ns = self.now_ns + u64::from(k) * pause.as_nanos() as u64;
            self.counters.send_failures += self.motors.switch_off(now_ns, tick.wrapping_add(k));
        }
        self.motors.release();
        let Some(mut last) = self.untold.take() else { return };
        self.counters.dropped_samples -= 1;
        last.counters = self.counters;
        let until = Instant::now() + LAST_WITHIN;
        while !self.bridge.publish(last) && Instant::now() < until {
            std::thread::sleep(LAST_WITHIN / 1000);
        }
    }

    /// Takes the commands for this tick from the bridge, at most the number that one tick can carry
    /// out. Returns the commands, and the ticket under which each is answered.
    fn orders(&mut self) -> (Commands, [u64; MAX_COMMANDS]) {
        let mut commands = Commands::default();
        let mut tickets = [OWN; MAX_COMMANDS];
        // This cannot fail: the engine's own command is the first, so there is room for it.
        if self.idle && std::mem::take(&mut self.enable_when_idle) {
            let _ = commands.push(Enable);
        }
        // The last place is reserved for an emergency stop. Its flag is read after the ring, so
        // that a client's stop is obeyed no later than the tick that takes its confirmation from
        // the ring.
        let own = commands.len();
        for ticket in &mut tickets[own..MAX_COMMANDS - 1] {
            let Some(order) = self.bridge.take_order() else { break };
            *ticket = order.ticket;
            // A rig that a client has disabled must not enable itself.
            self.enable_when_idle &= order.command != Disable;
            // This cannot fail: there is one place for each ticket.
            let _ = match (order.command, &order.model) {
                (Model(command), Some(model)) => commands.push_model(command, model),
                (command, _) => commands.push(command),
            };
        }
        if self.bridge.take_estop() {
            let _ = commands.push(Estop);
        }
        (commands, tickets)
    }
}
