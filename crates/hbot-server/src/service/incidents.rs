//! Incidents in samples that all clients are notified of: the rig stops because of a fault or a
//! stop, or is reset.

use hbot_api::{FaultEvent, Mode as ApiMode, Requester, StatsOk};
use hbot_core::Rig;
use hbot_core::controller::{LATE_FAULT_NS, SKIPPED_FAULT};
use hbot_core::mode::{Cause, Mode};

use super::convert;
use super::flights::Flights;
use hbot_host::bridge::ServiceEnd;
use hbot_host::sample::Sample;

/// Detects faults, emergency stops and resets in the samples of the loop.
pub(super) struct Incidents {
    rig: Rig,
    /// Whether the rig is simulated, so that no fault can mean broken hardware.
    simulated: bool,
    /// Mode and fault cause of the last sample.
    situation: Option<(Mode, Option<Cause>)>,
    /// Total number of skipped ticks that the last sample reported.
    skipped: u64,
    /// Number of ticks that were skipped just before the last sample.
    skipped_before: u64,
    /// The client that stopped the rig last.
    stopper: Option<Requester>,
    /// The client whose request to reset the rig was carried out in the sample that is examined.
    resetter: Option<Requester>,
    /// The last lease holder whose connection ended.
    lost: Option<Requester>,
}

impl Incidents {
    pub(super) fn new(rig: Rig, simulated: bool) -> Self {
        Self {
            rig,
            simulated,
            situation: None,
            skipped: 0,
            skipped_before: 0,
            stopper: None,
            resetter: None,
            lost: None,
        }
    }

    /// Records the client that stops the rig.
    pub(super) fn stopped_by(&mut self, who: Option<Requester>) {
        self.stopper = who;
    }

    /// Records the client whose request to reset the rig was carried out. Call it before
    /// [`look`](Self::look) examines the sample with the answer.
    pub(super) fn reset_by(&mut self, who: Option<Requester>) {
        self.resetter = who;
    }

    /// Records the lease holder whose connection ended.
    pub(super) fn lost(&mut self, who: Option<Requester>) {
        self.lost = who;
    }

    /// Examines a sample for an incident: a fault, an emergency stop or a reset. An incident is
    /// counted and logged, and a fault or stop also begins a flight log. Returns the event for all
    /// clients, or `None` if there was no incident.
    #[inline]
    pub(super) fn look(
        &mut self,
        sample: &Sample,
        end: &ServiceEnd,
        flights: &mut Flights,
        counts: &mut StatsOk,
    ) -> Option<FaultEvent> {
        let resetter = self.resetter.take();
        let skipped = std::mem::replace(&mut self.skipped, sample.counters.skipped);
        // Before the first sample, no tick is known to have been skipped.
        self.skipped_before = self.situation.map_or(0, |_| sample.counters.skipped - skipped);
        let situation = (sample.state.mode, sample.state.cause);
        if self.situation == Some(situation) {
            return None;
        }
        let before = self.situation.replace(situation).map(|(mode, _)| mode);
        let stopped_before = matches!(before, Some(Mode::Fault | Mode::Estop));
        match (sample.state.mode, sample.state.cause) {
            (Mode::Fault | Mode::Estop, _) => Some(self.stopped(sample, end, flights, counts)),
            (mode, _) if stopped_before => {
                tracing::info!(tick = sample.state.tick, mode = %convert::mode(mode), "reset");
                // Discard a signal that found the rig already stopped.
                let _ = end.take_signalled();
                Some(event(sample, "reset".to_owned(), resetter))
            }
            _ => None,
        }
    }

    /// Counts and logs a fault or an emergency stop, and begins a flight log.
    fn stopped(
        &mut self,
        sample: &Sample,
        end: &ServiceEnd,
        flights: &mut Flights,
        counts: &mut StatsOk,
    ) -> FaultEvent {
        let state = &sample.state;
        let tick = state.tick;
        let (mut message, by) = match (state.mode, state.cause) {
            (Mode::Fault, Some(cause)) => {
                counts.faults.add(convert::fault(cause));
                let by = (cause == Cause::ClientLost).then(|| self.lost.take()).flatten();
                (self.explain(cause, sample), by)
            }
            (Mode::Fault, None) => ("a fault of unknown cause".to_owned(), None),
            _ => {
                counts.estops += 1;
                let by_client = self.stopper.take();
                let by = if end.take_signalled() { Some(signal()) } else { by_client };
                (format!("stopped{}; reset to go on", by.as_ref().map(in_words).unwrap_or_default()), by)
            }
        };
        let what = state.cause.map_or(ApiMode::Estop.as_str(), |cause| convert::fault(cause).as_str());
        if let Some(path) = flights.trigger(tick, what) {
            message = format!("{message}; flight log: {}", path.display());
        }
        tracing::warn!(tick, "{what}: {message}");
        event(sample, message, by)
    }

    /// Returns the message that explains a fault to clients. For a simulated rig it says so, and
    /// names causes that a simulated rig can have.
    fn explain(&self, cause: Cause, sample: &Sample) -> String {
        let timeout_ticks = self.rig.timing.timeout_ticks;
        if !self.simulated {
            return explain(cause, sample, self.skipped_before, &self.rig);
        }
        let what = match cause {
            Cause::LinkLost => format!(
                "the simulated motor controllers have not answered for {timeout_ticks} ticks (link.timeout_ticks), or answered \
                 late: the scene's table [simulate] loses or delays frames, or other programs kept this machine too busy"
            ),
            Cause::LinkCorrupt => "the scene's table [simulate] damages too many frames".to_owned(),
            _ => explain(cause, sample, self.skipped_before, &self.rig),
        };
        format!("{what}. The rig is simulated and nothing is broken: reset, then enable")
    }
}

/// The signal that stops the rig, in the place of a client.
fn signal() -> Requester {
    Requester { name: "SIGUSR1".to_owned(), session: None }
}

fn in_words(by: &Requester) -> String {
    match by.session {
        Some(session) => format!(" by client {:?} (session {session})", by.name),
        None => format!(" by {}", by.name),
    }
}

fn event(sample: &Sample, message: String, by: Option<Requester>) -> FaultEvent {
    let state = &sample.state;
    FaultEvent {
        tick: state.tick,
        t: convert::seconds(sample.t_ns),
        mode: convert::mode(state.mode),
        fault: state.cause.map(convert::fault),
        message,
        by,
    }
}

/// Returns the message that explains a fault to clients: the observed value, the limit that it
/// exceeded, and the remedy.
fn explain(cause: Cause, sample: &Sample, skipped: u64, rig: &Rig) -> String {
    let state = &sample.state;
    match cause {
        Cause::LinkLost => format!(
            "the motor controllers have not answered for {} ticks (link.timeout_ticks), their answers come later than that \
             or are mostly missing, or they ran out of their watchdog time: check power and cable",
            rig.timing.timeout_ticks
        ),
        Cause::LinkCorrupt => format!(
            "too many frames on the serial line are damaged ({} so far): check cable, shield and baud rate",
            sample.counters.corrupt_frames
        ),
        Cause::ControllerFault => {
            "a motor controller reports a fault, has rebooted, is another than the rig file's, or says for 20 ms that its motors \
             are off although they are switched on, or on although they are off: see its own display, and the motors' supply"
                .to_owned()
        }
        Cause::Overspeed => {
            let limit = rig.limits.speed;
            match state.omega.length() {
                speed if speed > limit => {
                    format!("the sphere turned at {speed:.3} rad/s; the limit is {limit} (limits.speed)")
                }
                _ => format!(
                    "by its encoders' counts the sphere turned faster than {limit} rad/s (limits.speed) over 25 ms; the rates that \
                     the controllers report do not show it: check how they are measured"
                ),
            }
        }
        Cause::Overtorque => match rig.limits.energy {
            None => "a motor controller reports more current than its motor may have".to_owned(),
            Some(limit) => format!(
                "more than {} J went into the hand beyond {} W (limits.energy), or a motor controller reports more current \
                 than its motor may have",
                limit.burst, limit.power
            ),
        },
        Cause::Slip => {
            let limit = rig.limits.slip;
            let what = match state.slip {
                slip if slip > limit => format!("a wheel slipped at {slip:.3} m/s"),
                _ => "by its encoder's counts a wheel slipped faster than that over 25 ms".to_owned(),
            };
            format!(
                "{what}; the limit is {limit} (limits.slip): less torque, or more normal force. A gear that crosses its play looks \
                 the same"
            )
        }
        Cause::NonFinite => "a number is not finite, in what the controllers report or in a torque".to_owned(),
        Cause::ImplausibleFeedback => {
            "a joint moved further between two readings than it can, or its counts and the rate that its controller reports \
             disagreed for 50 ms: check its encoder"
                .to_owned()
        }
        Cause::Deadline => deadline(sample.timing.lateness_ns, skipped),
        Cause::ClientLost => {
            "the client that held the lease is gone, and api.on_client_lost is \"fault\"".to_owned()
        }
        Cause::Thermal => "a motor or its controller is too hot: let it cool".to_owned(),
    }
}

/// Returns a description of a missed deadline: a tick that began too late, or ticks that were
/// skipped because the tick before them took too long.
fn deadline(lateness_ns: u64, skipped: u64) -> String {
    let late_ms = convert::seconds(lateness_ns) * 1.0e3;
    let what = if lateness_ns > LATE_FAULT_NS {
        format!("a tick came {late_ms:.1} ms late (more than {} is a fault)", LATE_FAULT_NS / 1_000_000)
    } else {
        format!(
            "{skipped} ticks in a row were skipped because the one before them took too long ({SKIPPED_FAULT} are a fault)"
        )
    };
    format!(
        "{what}: other work on this machine, no real-time priority, or a rate too high for it; mend that, then reset and enable"
    )
}

#[cfg(test)]
mod tests {
    use hbot_config::RigConfig;

    use super::*;
    use hbot_host::bridge::bridge;

    #[test]
    fn a_missed_deadline_is_named_by_what_was_missed() {
        let late = deadline(23_400_000, 0);
        assert!(late.starts_with("a tick came 23.4 ms late (more than 20 is a fault): "), "{late}");
        let skipped = deadline(400_000, 12);
        assert!(skipped.starts_with("12 ticks in a row were skipped because"), "{skipped}");
        assert!(!skipped.contains("ms late"), "its lateness is not what is wrong: {skipped}");
        // If both conditions hold, the late tick is named.
        assert!(deadline(20_000_001, 40).starts_with("a tick came 20.0 ms late"));
    }

    #[test]
    fn a_fault_of_a_simulated_rig_says_that_nothing_is_broken() {
        let sample = crate::still::still(7);
        let told =
            |simulated, cause| Incidents::new(RigConfig::prototype().rig, simulated).explain(cause, &sample);
        for cause in Cause::ALL {
            let said = told(true, cause);
            assert!(said.contains("simulated and nothing is broken: reset, then enable"), "{said}");
            assert!(!told(false, cause).contains("simulated"), "{cause:?}");
        }
        assert!(!told(true, Cause::LinkLost).contains("cable"), "a simulated rig has no cable");
    }

    #[tokio::test]
    async fn a_stop_is_told_once_with_who_did_it_and_so_is_the_reset() {
        let (_loop_end, end) = bridge().unwrap();
        let (mut flights, mut counts) = (Flights::default(), StatsOk::default());
        let mut incidents = Incidents::new(RigConfig::prototype().rig, false);
        let sample = |tick, mode| {
            let mut sample = crate::still::still(tick);
            sample.state.mode = mode;
            sample
        };
        let mut told = |incidents: &mut Incidents, tick, mode| {
            let event = incidents.look(&sample(tick, mode), &end, &mut flights, &mut counts);
            event.map(|event| (event.message, event.by))
        };
        let ann = Some(Requester { name: "ann".to_owned(), session: Some(1) });
        assert_eq!(told(&mut incidents, 1, Mode::Idle), None);
        incidents.stopped_by(ann.clone());
        let stopped = "stopped by client \"ann\" (session 1); reset to go on".to_owned();
        assert_eq!(told(&mut incidents, 2, Mode::Estop), Some((stopped, ann.clone())));
        assert_eq!(told(&mut incidents, 3, Mode::Estop), None, "once");
        incidents.reset_by(ann.clone());
        assert_eq!(told(&mut incidents, 4, Mode::Idle), Some(("reset".to_owned(), ann.clone())));
        incidents.reset_by(ann);
        assert_eq!(told(&mut incidents, 5, Mode::Idle), None, "a reset that changed nothing");
        assert_eq!(told(&mut incidents, 6, Mode::Estop), Some(("stopped; reset to go on".to_owned(), None)));
        assert_eq!(told(&mut incidents, 7, Mode::Idle), Some(("reset".to_owned(), None)));
        assert_eq!(counts.estops, 2);
    }
}
