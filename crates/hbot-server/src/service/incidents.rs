//! Incidents in samples that all clients are notified of: the rig stops because of a fault or a
//! stop, or is reset.

mod explanation;

use hbot_api::{FaultEvent, Mode as ApiMode, Requester, StatsOk};
use hbot_config::scene::{Link, Simulate};
use hbot_core::Rig;
use hbot_core::safety::mode::{Cause, Mode};

use super::convert;
use super::flights::Flights;
use explanation::Explanation;
use hbot_host::run_loop::bridge::ServiceEnd;
use hbot_host::run_loop::sample::Sample;

/// Detects faults, emergency stops and resets in the samples of the loop.
pub(super) struct Incidents {
    rig: Rig,
    /// Whether the rig is simulated, so that no fault can mean broken hardware.
    simulated: bool,
    /// The errors of the serial line that the simulated rig shows, if any.
    line: Option<Link>,
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
    /// The event of the fault or stop in which the rig is now.
    present: Option<FaultEvent>,
}

impl Incidents {
    pub(super) fn new(rig: Rig, simulated: bool) -> Self {
        Self {
            rig,
            simulated,
            line: None,
            situation: None,
            skipped: 0,
            skipped_before: 0,
            stopper: None,
            resetter: None,
            lost: None,
            present: None,
        }
    }

    /// Returns the event of the fault or stop in which the rig is now. Returns `None` in other
    /// modes.
    pub(super) const fn present(&self) -> Option<&FaultEvent> {
        self.present.as_ref()
    }

    /// Returns whether the rig is simulated.
    pub(super) const fn is_simulated(&self) -> bool {
        self.simulated
    }

    /// Records the phenomena that the simulated rig shows from now on, so that a message about a
    /// fault can name those that cause it.
    pub(super) fn show(&mut self, simulate: &Simulate) {
        self.line = simulate.link;
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
            (Mode::Fault | Mode::Estop, _) => {
                let mut event = self.stopped(sample, end, flights, counts);
                let first = self.present.take();
                // Who stopped the rig may have a hand in it, whatever happened since.
                let stop = first.as_ref().filter(|first| first.mode == ApiMode::Estop);
                if let Some(FaultEvent { t, message, .. }) = stop.filter(|_| event.mode == ApiMode::Fault) {
                    let stop = format!("; before that, at {t:.1} s, the rig was {message}");
                    for text in [Some(&mut event.message), event.found.as_mut()].into_iter().flatten() {
                        text.push_str(&stop);
                    }
                    let remedy = event.remedy.unwrap_or_default();
                    event.remedy = Some(format!("Make sure that nobody touches the sphere. {remedy}"));
                }
                // The log of a rig that is stopped already does not show what stopped it.
                let first = first.and_then(|first| first.flight_log);
                let flight_log = first.or_else(|| event.flight_log.clone());
                self.present = Some(FaultEvent { flight_log, ..event.clone() });
                Some(event)
            }
            (mode, _) if stopped_before => {
                self.present = None;
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
        let (explanation, by) = match (state.mode, state.cause) {
            (Mode::Fault, Some(cause)) => {
                counts.faults.add(convert::fault(cause));
                let by = (cause == Cause::ClientLost).then(|| self.lost.take()).flatten();
                (Ok(self.explain(cause, sample)), by)
            }
            (Mode::Fault, None) => (Err("a fault of unknown cause".to_owned()), None),
            _ => {
                counts.estops += 1;
                let by_client = self.stopper.take();
                let by = if end.take_signalled() { Some(signal()) } else { by_client };
                let who = by.as_ref().map(in_words).unwrap_or_default();
                (Err(format!("stopped{who}")), by)
            }
        };
        let what = state.cause.map_or(ApiMode::Estop.as_str(), |cause| convert::fault(cause).as_str());
        let log = flights.trigger(tick, what).map(|path| path.display().to_string());
        let (message, found, remedy) = match explanation {
            Ok(Explanation { message, found, remedy }) => (message, Some(found), Some(remedy)),
            Err(message) => (message, None, None),
        };
        // What to do next is said by each client.
        tracing::warn!(tick, log, "{what}: {}", found.as_ref().unwrap_or(&message));
        FaultEvent { found, remedy, flight_log: log, ..event(sample, message, by) }
    }

    /// Explains a fault to clients.
    fn explain(&self, cause: Cause, sample: &Sample) -> Explanation {
        if self.simulated {
            explanation::simulated(cause, sample, self.skipped_before, &self.rig, self.line.as_ref())
        } else {
            explanation::real(cause, sample, self.skipped_before, &self.rig)
        }
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
        found: None,
        remedy: None,
        flight_log: None,
        by,
    }
}

#[cfg(test)]
mod tests {
    use hbot_config::RigConfig;

    use super::*;
    use hbot_host::run_loop::bridge::bridge;

    #[test]
    fn a_fault_of_a_simulated_rig_says_that_nothing_is_broken() {
        let mut sample = crate::still::still(7);
        sample.complaints.fault = true;
        let told =
            |simulated, cause| Incidents::new(RigConfig::prototype().rig, simulated).explain(cause, &sample);
        for cause in Cause::ALL {
            let said = told(true, cause);
            let of_hardware = ["cable", "controller", "Clean", "cool"];
            assert!(!of_hardware.iter().any(|word| said.remedy.contains(word)), "{}", said.remedy);
            let unbroken =
                !matches!(cause, Cause::Overspeed | Cause::NonFinite | Cause::Deadline | Cause::ClientLost);
            assert_eq!(said.remedy.contains("simulated and nothing is broken."), unbroken, "{}", said.remedy);
            // A sphere without a hand may never slow down.
            assert_eq!(said.remedy.contains("`hand = {}`"), cause == Cause::Overspeed);
            let real = told(false, cause);
            assert!(!real.message.contains("simulated") && !real.remedy.contains("simulated"), "{cause:?}");
            assert_eq!(real.remedy, convert::fault(cause).words().1);
            assert!(real.message.contains(&real.found) || cause == Cause::Overspeed, "{}", real.found);
        }
        assert!(!told(true, Cause::LinkLost).message.contains("cable"), "a simulated rig has no cable");
    }

    #[test]
    fn a_fault_that_the_scene_s_line_causes_names_its_keys_and_no_others() {
        let told = |cause, line| {
            let mut incidents = Incidents::new(RigConfig::prototype().rig, true);
            incidents.show(&Simulate { link: Some(line), ..Simulate::default() });
            let Explanation { message, remedy, .. } = incidents.explain(cause, &crate::still::still(7));
            format!("{message}. {remedy}")
        };
        let still = Link { latency_s: 0.0, jitter_s: 0.0, loss: 0.0, corrupt: 0.0, ..Link::default() };
        let said = told(Cause::LinkLost, Link { loss: 0.6, ..still });
        assert!(said.contains("[simulate.link] loses frames (loss = 0.6), or other programs"), "{said}");
        assert!(
            said.ends_with(
                "load the scene with a smaller `loss` first (`hbot scene load NAME --ideal` has none)."
            ),
            "{said}"
        );
        let said = told(Cause::LinkLost, Link { latency_s: 0.05, jitter_s: 0.001, ..still });
        assert!(said.contains("delays answers by up to 52.0 ms") && !said.contains("loss"), "{said}");
        let said = told(Cause::LinkLost, still);
        assert!(said.contains("too busy") && !said.contains("simulate.link"), "{said}");
        assert!(said.ends_with("nothing is broken."), "{said}");
        let said = told(Cause::LinkCorrupt, Link { corrupt: 0.4, ..still });
        assert!(said.contains("corrupt = 0.4") && said.contains("a smaller `corrupt`"), "{said}");
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
        let stopped = "stopped by client \"ann\" (session 1)".to_owned();
        assert_eq!(told(&mut incidents, 2, Mode::Estop), Some((stopped, ann.clone())));
        assert_eq!(told(&mut incidents, 3, Mode::Estop), None, "once");
        incidents.reset_by(ann.clone());
        assert_eq!(told(&mut incidents, 4, Mode::Idle), Some(("reset".to_owned(), ann.clone())));
        incidents.reset_by(ann);
        assert_eq!(told(&mut incidents, 5, Mode::Idle), None, "a reset that changed nothing");
        assert_eq!(told(&mut incidents, 6, Mode::Estop), Some(("stopped".to_owned(), None)));
        assert_eq!(told(&mut incidents, 7, Mode::Idle), Some(("reset".to_owned(), None)));
        assert_eq!(counts.estops, 2);
    }

    #[tokio::test]
    async fn a_fault_after_a_stop_still_tells_who_has_stopped_the_rig() {
        let (_loop_end, end) = bridge().unwrap();
        let (mut flights, mut counts) = (Flights::default(), StatsOk::default());
        let mut incidents = Incidents::new(RigConfig::prototype().rig, false);
        let mut sample = crate::still::still(2);
        sample.state.mode = Mode::Estop;
        incidents.stopped_by(Some(Requester { name: "ann".to_owned(), session: Some(1) }));
        incidents.look(&sample, &end, &mut flights, &mut counts).expect("a stop");
        (sample.state.mode, sample.state.cause) = (Mode::Fault, Some(Cause::Deadline));
        let event = incidents.look(&sample, &end, &mut flights, &mut counts).expect("a fault");
        let stop = "; before that, at 0.0 s, the rig was stopped by client \"ann\" (session 1)";
        assert!(event.message.ends_with(stop) && event.found.expect("found").ends_with(stop));
        assert!(event.remedy.expect("told").starts_with("Make sure that nobody touches the sphere. "));
    }

    #[tokio::test]
    async fn the_log_of_the_first_stop_shows_what_stopped_a_rig_that_fails_again() {
        let (_loop_end, end) = bridge().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let mut flights =
            Flights::new(Some(folder.path().to_owned()), 1_000_000, <_>::default(), <_>::default());
        let mut incidents = Incidents::new(RigConfig::prototype().rig, false);
        let mut log = |tick, mode, cause| {
            let mut sample = crate::still::still(tick);
            (sample.state.mode, sample.state.cause) = (mode, cause);
            let told = incidents.look(&sample, &end, &mut flights, &mut StatsOk::default());
            let present = incidents.present().and_then(|event| event.flight_log.clone());
            (told.and_then(|event| event.flight_log), present)
        };
        log(1, Mode::Idle, None);
        let (first, present) = log(2, Mode::Estop, None);
        assert!(first.is_some() && present == first);
        let (second, present) = log(3000, Mode::Fault, Some(Cause::LinkLost));
        assert!(second.is_some() && second != first && present == first);
        log(3001, Mode::Idle, None);
        let (third, present) = log(6000, Mode::Estop, None);
        assert!(third != first && present == third);
    }
}
