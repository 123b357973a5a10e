//! Everything that the panel knows. The views only read it. [`Model::take`] changes it with what
//! arrives from the server, and [`Model::asked`] with what the user asks.

mod film;
mod fit;
mod headline;
mod histogram;
mod history;
mod judged;
mod marks;
mod messages;
mod own;
mod reach;
mod refusal;
pub(crate) mod sample;
mod scene;
mod stop;
#[cfg(test)]
pub(crate) mod tests;

use std::time::{Duration, Instant};

use glam::DQuat;
use hbot_api::{
    ControllerInfo, FaultEvent, HelloOk, InfoOk, LeaseCause, Mode, SceneEvent, SetEvent, ShakingEvent,
    StateEvent, StatsOk,
};

pub(crate) use film::Film;
pub(crate) use fit::{Fit, fit};
pub(crate) use headline::Headline;
pub(crate) use histogram::{BINS, Histogram};
pub(crate) use history::{History, SPAN_S, thinned};
pub(crate) use judged::Judged;
pub(crate) use marks::{Mark, Marks, What};
pub(crate) use messages::{Messages, Weight};
pub(crate) use refusal::Refusal;
pub(crate) use scene::{Effect, Scene};
pub(crate) use stop::{PendingStop, has_torque};

use crate::net::{Delivery, Intent, Lease, News, Progress};
use crate::shape::Placing;
use own::OwnSessions;
use sample::quaternion;

/// If no state message arrives for this time, the window reports that the server is silent.
const SILENT_AFTER: Duration = Duration::from_millis(1500);

/// What follows from a stop of a simulated rig that is not confirmed.
const NO_MOTORS: &str = "The rig is simulated and has no motors";

/// The end of the message about a client that has taken over.
const TAKEN: &str = " has taken over command";

/// The state of the panel's connection to the server: being made, missing or established.
#[derive(Clone, Debug, Default)]
pub(crate) enum Link {
    #[default]
    Connecting,
    /// There is no connection to the server.
    Offline {
        why: String,
        /// Whether the address refuses connections, which means that no server is running there.
        absent: bool,
        again: Instant,
    },
    Online(HelloOk),
    /// There is none: the model is that of a recording at one of its moments.
    Recording,
}

/// Everything that the panel knows about the server and the rig: the connection, the newest state,
/// histories, statistics, the scene and messages.
#[derive(Debug, Default)]
pub(crate) struct Model {
    pub(crate) server: String,
    pub(crate) link: Link,
    pub(crate) lease: Lease,
    /// Whether the user only watches until they press `Take command`.
    pub(crate) observes: bool,
    /// Name of this panel's clients.
    name: String,
    /// Numbers of the connections that have sent the user's requests.
    sessions: OwnSessions,
    /// Numbers of the connections that have sent stops.
    stop_sessions: OwnSessions,
    /// Whether the rig is simulated, as the server at this address last said.
    simulated: Option<bool>,
    /// Stops that the user has asked for and that are not confirmed yet, one for each server.
    stops: Vec<PendingStop>,
    /// The newest state message from the server.
    pub(crate) state: Option<StateEvent>,
    /// Time at which the newest state message arrived.
    heard: Option<Instant>,
    pub(crate) history: History,
    /// Moments that the plots mark: scenes, changed parameters, stops.
    pub(crate) marks: Marks,
    /// Orientation of the sphere when rendering began, if the panel saw it.
    began: Option<DQuat>,
    /// Marks of this delivery, whose time is that of its newest sample.
    unmarked: Vec<(What, String, Option<u64>)>,
    pub(crate) lateness: Histogram,
    pub(crate) info: InfoOk,
    pub(crate) stats: Option<StatsOk>,
    /// What the motor controllers report about themselves, in the order of the joints. Empty if the
    /// server has not said it.
    pub(crate) controllers: Vec<ControllerInfo>,
    /// Whether the server is too old to report the motor controllers.
    pub(crate) lacks_controllers: bool,
    pub(crate) scene: Scene,
    /// The server's message about the fault or emergency stop that the rig is in. `None` otherwise.
    pub(crate) fault: Option<FaultEvent>,
    /// The server's message about the fault that the rig was in when it was stopped. `None` outside
    /// an emergency stop.
    pub(crate) fault_before: Option<FaultEvent>,
    /// The user's last request to enable or reset, if it was refused and nothing has changed since.
    pub(crate) refusal: Option<Refusal>,
    /// What the server said when it found the sphere shaking by itself, while the torque is
    /// lowered.
    pub(crate) shaking: Option<ShakingEvent>,
    pub(crate) messages: Messages,
    /// The recording that the panel makes.
    pub(crate) recording: Option<Progress>,
    /// Number of states lost on the way to the panel since the connection was made.
    pub(crate) dropped: u64,
    /// Number of state messages per second that the panel requests from the server.
    pub(crate) samples_per_s: u32,
}

impl Model {
    /// Creates the model of a panel that is not connected yet. `name` is the name of the panel's
    /// clients.
    pub(crate) fn new(server: &str, name: &str, samples_per_s: u32) -> Self {
        Self { server: server.to_owned(), name: name.to_owned(), samples_per_s, ..Self::default() }
    }

    pub(crate) const fn is_online(&self) -> bool {
        matches!(self.link, Link::Online(_))
    }

    /// Returns the time since the last state message, if the panel is connected and this time is
    /// too long. Returns `None` otherwise.
    pub(crate) fn silent_for(&self) -> Option<Duration> {
        let silent = self.heard?.elapsed();
        (self.is_online() && silent > SILENT_AFTER).then_some(silent)
    }

    /// Returns whether what the window shows is what the rig does now: the panel is connected and
    /// receives states. A recording is always at its moment.
    pub(crate) fn is_live(&self) -> bool {
        let is_recorded = matches!(self.link, Link::Recording);
        (is_recorded || self.is_online()) && self.state.is_some() && self.silent_for().is_none()
    }

    /// Returns whether the user can rely on what the window shows: it is new, and no stop of the
    /// user is unconfirmed.
    pub(crate) fn is_certain(&self) -> bool {
        self.is_fresh() && self.unconfirmed_stop().is_none()
    }

    /// Returns whether the user can command the rig: the panel is connected, the server is not
    /// silent, and the user need not take command first.
    pub(crate) fn may_command(&self) -> bool {
        self.is_online() && self.silent_for().is_none() && !self.must_take()
    }

    /// Returns whether the user must press a button to get the lease: another client has it, or
    /// the user only watches. Otherwise a change takes it if it is free.
    fn must_take(&self) -> bool {
        matches!(self.lease, Lease::Other(_)) || self.observes && self.lease != Lease::Mine
    }

    /// Returns whether the user can turn the sphere by the hand of the simulated rig.
    pub(crate) fn has_hand(&self) -> bool {
        self.is_live() && self.is_simulated() && self.may_command()
    }

    /// Returns whether the user must take command before a change, and can do so now.
    pub(crate) fn is_observer(&self) -> bool {
        self.is_live() && self.must_take()
    }

    /// Returns the stop that the user has asked for, if nothing has confirmed it in time. A stop at
    /// the present server comes before one at another.
    pub(crate) fn unconfirmed_stop(&self) -> Option<&PendingStop> {
        let unconfirmed = || self.stops.iter().filter(|stop| stop.is_unconfirmed());
        unconfirmed().find(|stop| stop.server == self.server).or_else(|| unconfirmed().next())
    }

    pub(crate) fn mode(&self) -> Option<Mode> {
        self.state.as_ref().map(|state| state.mode)
    }

    /// Updates the model with everything that has arrived from the server.
    pub(crate) fn take(&mut self, delivery: &mut Delivery) {
        // News come first, because news about the connection apply to the samples after them.
        for news in delivery.news.drain(..) {
            self.news(news);
        }
        let state = delivery.samples.back().cloned();
        for sample in delivery.samples.drain(..) {
            self.lateness.add(sample.timing.lateness_us);
            self.history.push(sample);
        }
        self.mark();
        self.dropped += std::mem::take(&mut delivery.lost);
        if let Some(state) = state {
            // The message about a stop can overtake the states before it.
            let over = |fault: &FaultEvent| {
                state.tick > fault.tick && !matches!(state.mode, Mode::Fault | Mode::Estop)
            };
            self.fault = self.fault.take().filter(|fault| !over(fault));
            self.fault_before = self.fault_before.take().filter(|_| self.fault.is_some());
            self.refusal = self.refusal.take().filter(|refusal| !refusal.is_over(&state));
            self.stops.retain(|stop| !stop.is_proved_by(&self.server, &state));
            let now = is_rendering(state.mode);
            match self.mode().map(is_rendering) {
                Some(false) if now => self.began = Some(quaternion(state.q)),
                Some(true) if now => {}
                _ => self.began = None,
            }
            self.state = Some((*state).clone());
            self.heard = Some(Instant::now());
        }
    }

    /// Returns what the panel knows about the places of the scene's references.
    pub(crate) fn placing(&self) -> Placing {
        let Some(state) = &self.state else { return Placing::default() };
        Placing {
            q: quaternion(state.q),
            reference: state.reference.map(quaternion),
            began: self.began,
            rendering: is_rendering(state.mode),
        }
    }

    /// Adds the marks of this delivery. Each is at its tick, or at the newest sample if the panel
    /// does not know the tick.
    fn mark(&mut self) {
        let newest = self.history.newest().map(|newest| (newest.t, newest.tick));
        for (what, text, tick) in std::mem::take(&mut self.unmarked) {
            let Some((now, newest)) = newest else { continue };
            if what == What::Scene && self.mode().is_some_and(is_rendering) {
                // A scene that is loaded into an active rig begins where the sphere is.
                self.began = self.history.newest().map(|newest| quaternion(newest.q));
            }
            let rate = f64::from(self.info.rig.rate_hz);
            let ago = match tick {
                Some(tick) if rate > 0.0 => (newest as f64 - tick as f64) / rate,
                _ => 0.0,
            };
            self.marks.add(Mark { what, t: now - ago, text }, self.scene.fading_s());
        }
    }

    /// Updates the model after the user's request was sent to the server, for example to show the
    /// requested value.
    pub(crate) fn asked(&mut self, intent: &Intent) {
        match intent {
            Intent::Set { effect, key, value } => {
                self.refusal = None;
                self.scene.ask(effect, key, value);
            }
            Intent::Enable | Intent::Reset | Intent::Recover => self.refusal = None,
            Intent::Connect(address) if *address != self.server => {
                self.server.clone_from(address);
                self.simulated = None;
                self.sessions.clear();
                self.stop_sessions.clear();
            }
            // A key that is held down asks many times. The time limit begins with the first.
            Intent::Stop if self.stops.iter().all(|stop| stop.server != self.server) => {
                self.stops.push(PendingStop::new(&self.server, self.state.as_ref()));
            }
            Intent::Samples(n) => self.samples_per_s = *n,
            _ => {}
        }
    }

    fn news(&mut self, news: News) {
        match news {
            News::Connecting => {
                if !matches!(self.link, Link::Offline { .. }) {
                    self.link = Link::Connecting;
                }
            }
            News::Connected(hello) => self.connected(hello),
            News::StopLine(session) => self.stop_sessions.add(session),
            News::Offline { why, absent, again_in } => {
                if self.is_online() {
                    self.messages.add(Weight::Bad, format!("connection lost: {why}"));
                }
                self.link = Link::Offline { why, absent, again: Instant::now() + again_in };
                self.lease = Lease::Unknown;
                self.forget_reports();
                self.scene.forget_pending();
            }
            News::Info(info) => {
                self.simulated = Some(info.rig.simulated);
                // A panel that came later learns here who or what stopped the rig, or shakes it.
                self.fault = info.incident.clone().or(self.fault.take());
                self.shaking = info.shaking.clone().or(self.shaking.take());
                let known = !self.info.scene.is_null();
                if self.scene.take(&info.scene) && known {
                    self.marks.fades(self.scene.fading_s());
                }
                self.info = *info;
            }
            News::Stats(stats) => self.stats = Some(*stats),
            News::Controllers(controllers) => self.controllers = controllers,
            News::NoControllers => self.lacks_controllers = true,
            News::Lease { lease, cause } => self.lease(lease, cause),
            News::Fault(fault) => self.fault(fault),
            News::Shaking(shaking) => self.shaking(shaking),
            News::Scene(scene) => self.scene_loaded(scene),
            News::Set(set) => self.parameters_set(set),
            News::Dropped(dropped) => self.dropped = dropped.total,
            News::Stop { server, result } => self.stop_answered(&server, result),
            News::Answer { intent, result } => self.answer(&intent, result),
            News::Recording(progress) => self.recording = progress,
            News::Note(Ok(message)) => self.messages.add(Weight::Good, message),
            News::Note(Err(message)) => self.messages.add(Weight::Bad, message),
        }
    }

    fn connected(&mut self, hello: HelloOk) {
        self.messages.add(Weight::Good, format!("connected to {}, {}", hello.server, hello.rig));
        self.sessions.add(hello.session);
        self.link = Link::Online(hello);
        // The new server can have another clock. Discard what the old one reported.
        self.history.clear();
        self.marks.clear();
        self.unmarked.clear();
        self.lateness = Histogram::default();
        self.forget_reports();
        self.began = None;
        self.info.scene = serde_json::Value::Null;
        self.heard = Some(Instant::now());
        self.fault = None;
        self.fault_before = None;
        self.refusal = None;
        self.shaking = None;
        self.dropped = 0;
        // The server can have started again with another rig. The answer to `info` says which.
        self.simulated = None;
        let here = self.stops.iter_mut().filter(|stop| stop.server == self.server);
        here.for_each(PendingStop::reconnect);
    }

    /// Forgets what the server reports again and again.
    fn forget_reports(&mut self) {
        self.state = None;
        self.stats = None;
        self.controllers.clear();
        self.lacks_controllers = false;
    }

    fn fault(&mut self, fault: FaultEvent) {
        let stopped = matches!(fault.mode, Mode::Fault | Mode::Estop);
        let (what, name) =
            fault.fault.map_or(("mode", fault.mode.as_str()), |fault| ("fault", fault.as_str()));
        let weight = if stopped { Weight::Bad } else { Weight::Good };
        let message = match (&fault.by, fault.mode) {
            (Some(by), Mode::Estop) => format!("stopped by {}", self.who(by)),
            (Some(by), mode) if mode != Mode::Fault => format!("{} by {}", fault.message, self.who(by)),
            _ => fault.message.clone(),
        };
        let log = fault.flight_log.as_ref().map(|path| format!("; flight log: {path}")).unwrap_or_default();
        // The window shows this message below the mode while the fault lasts.
        self.messages.add_told(weight, format!("the {what} was {name}: {message}{log}"));
        if stopped {
            self.unmarked.push((What::Fault, name.to_owned(), Some(fault.tick)));
        }
        let before = self.fault.take().filter(|it| it.mode == Mode::Fault).or(self.fault_before.take());
        self.fault_before = before.filter(|_| fault.mode == Mode::Estop);
        self.fault = stopped.then_some(fault);
    }

    fn shaking(&mut self, event: ShakingEvent) {
        let weight = if event.shaking { Weight::Warn } else { Weight::Good };
        self.messages.add_told(weight, event.message.clone());
        if event.shaking {
            let who = event.effect.as_deref().unwrap_or("scene");
            self.unmarked.push((What::Fault, format!("{who} shakes"), Some(event.tick)));
        }
        self.shaking = event.shaking.then_some(event);
    }

    fn scene_loaded(&mut self, scene: SceneEvent) {
        self.refusal = None;
        let by = scene.by.as_ref().map(|by| format!(", loaded by {}", self.who(by)));
        self.messages.add(Weight::Good, format!("scene: {}{}", scene.name, by.unwrap_or_default()));
        self.unmarked.push((What::Scene, format!("scene {}", scene.name), Some(scene.tick)));
        self.scene.take_costs(scene.effects);
    }

    fn parameters_set(&mut self, set: SetEvent) {
        self.refusal = None;
        let SetEvent { tick, effect, parameters, by, .. } = set;
        let by = by.filter(|by| !self.is_own(by));
        for (key, value) in parameters {
            self.scene.set(&effect, &key, &value);
            // Lists and matrices are too long for a mark.
            let shown = if value.is_array() { String::new() } else { format!(" = {value}") };
            let by = by.as_ref().map(|by| format!(", set by {}", self.who(by))).unwrap_or_default();
            self.unmarked.push((What::Set, format!("{effect}: {key}{shown}{by}"), Some(tick)));
        }
    }

    fn answer(&mut self, intent: &Intent, result: Result<(), String>) {
        if let Intent::Set { effect, key, value } = intent {
            self.scene.answered(effect, key, value, result.is_ok());
        }
        let Err(why) = result else { return };
        let name = intent.name();
        match Refusal::of(intent, why.clone(), self.state.as_ref()) {
            None => self.messages.add(Weight::Bad, format!("{name}: {why}")),
            refusal => {
                self.messages.add_told(Weight::Bad, format!("{name} was refused: {why}"));
                self.refusal = refusal;
            }
        }
    }

    /// Records the answer to a stop of the rig at the address `server`. If the stop was not
    /// confirmed, the window shows this in the place of the mode until a state proves that the rig
    /// has stopped.
    fn stop_answered(&mut self, server: &str, result: Result<(), String>) {
        let Err(why) = result else {
            self.stops.retain(|stop| stop.server != server || stop.is_unconfirmed());
            return;
        };
        let known = self.stops.iter().position(|stop| stop.server == server);
        let mut stop = known.map_or_else(
            || PendingStop::new(server, self.state.as_ref().filter(|_| server == self.server)),
            |index| self.stops.remove(index),
        );
        let advice = if self.is_of_simulated(&stop) { NO_MOTORS } else { "Cut the motors' power" };
        self.messages.add_told(Weight::Bad, format!("{why}. {advice}"));
        stop.fail(why);
        self.stops.push(stop);
    }

    fn lease(&mut self, lease: Lease, cause: Option<LeaseCause>) {
        if self.lease == Lease::Mine
            && let (Lease::Other(holder), Some(LeaseCause::Stolen)) = (&lease, cause)
        {
            self.messages.add(Weight::Warn, format!("{}{TAKEN}", self.other(holder)));
        } else if lease == Lease::Mine {
            self.messages.hide(TAKEN);
        }
        self.lease = lease;
    }
}

const fn is_rendering(mode: Mode) -> bool {
    matches!(mode, Mode::Enabling | Mode::Active)
}
