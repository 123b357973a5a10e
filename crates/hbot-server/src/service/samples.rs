//! What a sample sets off: states to subscribers, answers, fault events, the flight log.

use std::io;
use std::time::Instant;

use hbot_api::{Event, FaultEvent, StateEvent};
use hbot_core::controller::{LATE_FAULT_NS, SKIPPED_FAULT};
use hbot_core::mode::{Cause, Mode};
use tokio::task::JoinError;

use super::convert;
use super::hub::Hub;
use super::stats::Stats;
use crate::flight::Flight;
use crate::sample::Sample;

/// Flight logs being written at a time; a further one is given up.
const MAX_WRITING: usize = 2;

/// Makes one message of a sample for all who want it.
pub(super) struct Publisher {
    /// Reused, so that a sample takes no memory but that of its messages.
    event: Event,
    subscribers: usize,
}

/// What is looked for in samples.
#[derive(Default)]
pub(super) struct Watch {
    /// Of the last sample.
    mode: Option<(Mode, Option<Cause>)>,
    /// Ticks skipped just before it.
    skipped: u64,
}

impl Publisher {
    pub(super) fn new() -> Self {
        Self { event: Event::State(StateEvent::default()), subscribers: 0 }
    }

    pub(super) fn is_watched(&self) -> bool {
        self.subscribers > 0
    }
}

impl Hub {
    /// Takes a sample in. This runs for every tick, and in virtual time as fast as the loop goes.
    #[inline]
    pub(super) fn take(&mut self, sample: &Sample) {
        self.stats.record(sample);
        self.watch.skipped =
            self.latest.as_ref().map_or(0, |before| sample.counters.skipped - before.counters.skipped);
        self.latest = Some(*sample);
        if !self.orders.is_empty() {
            self.answers(sample);
        }
        if !self.loading.is_empty() {
            self.rendered(sample);
        }
        if let Some(flight) = self.recorder.as_mut().and_then(|recorder| recorder.push(sample)) {
            self.write(flight);
        }
        let mode = Some((sample.state.mode, sample.state.cause));
        if mode != self.watch.mode {
            let before = std::mem::replace(&mut self.watch.mode, mode);
            self.mode_changed(before.map(|(mode, _)| mode), sample);
        }
        if self.publisher.is_watched() {
            self.publish(sample);
        }
    }

    /// Whether anybody is to get states has changed.
    pub(super) fn count_subscribers(&mut self) {
        self.publisher.subscribers = self.peers.values().filter(|peer| peer.every != 0).count();
        self.changed.notify_one();
    }

    /// Sends a state to those who want one of this tick.
    fn publish(&mut self, sample: &Sample) {
        let mut filled = false;
        let Self { peers, publisher, frames, stats, .. } = self;
        frames.clear();
        for peer in peers.values_mut().filter(|peer| peer.wants(sample.state.tick)) {
            if !peer.outbox.takes_samples() {
                peer.drop_state();
                stats.counts.dropped_states += 1;
                continue;
            }
            if !filled {
                filled = true;
                if let Event::State(event) = &mut publisher.event {
                    convert::fill(event, sample);
                }
            }
            if let Some(event) = peer.dropped_event() {
                // There is room for samples, so there is for this.
                let _ = peer.send(&event);
            }
            // The same; and one whose connection has just broken will say so itself.
            let _ = peer.outbox.send(frames.of(peer.encoding, &publisher.event));
        }
    }

    fn mode_changed(&mut self, before: Option<Mode>, sample: &Sample) {
        let state = &sample.state;
        let tick = state.tick;
        let mut message = match (state.mode, state.cause) {
            (Mode::Fault, Some(cause)) => {
                self.stats.fault(cause);
                self.explain(cause, sample)
            }
            (Mode::Fault, None) => "a fault of unknown cause".to_owned(),
            (Mode::Estop, _) => {
                self.stats.counts.estops += 1;
                let by_signal = self.end.take_signalled().then(|| "SIGUSR1".to_owned());
                let by = self.stopper.take().filter(|_| by_signal.is_none()).or(by_signal);
                let by = by.map(|by| format!(" by {by}")).unwrap_or_default();
                format!("stopped{by}; reset to go on")
            }
            (mode, _) if matches!(before, Some(Mode::Fault | Mode::Estop)) => {
                let mode = convert::mode(mode);
                tracing::info!(tick, %mode, "reset");
                // One that found the rig stopped already is not told of.
                let _ = self.end.take_signalled();
                self.broadcast_fault(sample, "reset".to_owned());
                return;
            }
            _ => return,
        };
        let fault = state.cause.map(convert::fault);
        let what = fault.map_or(hbot_api::Mode::Estop.as_str(), |fault| fault.as_str());
        if let Some(recorder) = &mut self.recorder {
            let path = recorder.trigger(tick, what).display();
            message = format!("{message}; flight log: {path}");
        }
        tracing::warn!(tick, "{what}: {message}");
        self.broadcast_fault(sample, message);
    }

    fn broadcast_fault(&mut self, sample: &Sample, message: String) {
        let state = &sample.state;
        self.broadcast(&Event::Fault(FaultEvent {
            tick: state.tick,
            t: convert::seconds(sample.t_ns),
            mode: convert::mode(state.mode),
            fault: state.cause.map(convert::fault),
            message,
        }));
    }

    /// What was seen, against which limit, and what to do.
    fn explain(&self, cause: Cause, sample: &Sample) -> String {
        let (state, rig) = (&sample.state, &self.setup.rig.rig);
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
            Cause::Deadline => deadline(sample.timing.lateness_ns, self.watch.skipped),
            Cause::ClientLost => {
                "the client that held the lease is gone, and api.on_client_lost is \"fault\"".to_owned()
            }
            Cause::Thermal => "a motor or its controller is too hot: let it cool".to_owned(),
        }
    }

    /// Has a flight log written on another thread.
    fn write(&mut self, flight: Flight) {
        if self.writing.len() >= MAX_WRITING {
            let error = io::Error::other(format!("{MAX_WRITING} are still being written"));
            self.stats.written(Ok((flight, Err(error))));
            return;
        }
        self.writing.spawn_blocking(move || {
            let result = flight.write();
            (flight, result)
        });
        self.changed.notify_one();
    }
}

/// Which deadline was not kept: a tick that came too late, or ticks that were left out because the one before them took too long.
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

impl Stats {
    /// Notes how writing a flight log went.
    pub(super) fn written(&mut self, written: Result<(Flight, io::Result<()>), JoinError>) {
        match written {
            Ok((flight, Ok(()))) => {
                self.counts.flight_logs += 1;
                tracing::info!(path = %flight.path.display(), ticks = flight.samples.len(), "flight log written");
            }
            Ok((flight, Err(error))) => {
                self.counts.flight_logs_failed += 1;
                if let Some(count) = self.flight_failures.failed(Instant::now()) {
                    tracing::warn!(path = %flight.path.display(), %error, count, "flight logs could not be written");
                }
            }
            Err(error) => {
                self.counts.flight_logs_failed += 1;
                tracing::error!(%error, "the flight log could not be written");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missed_deadline_is_named_by_what_was_missed() {
        let late = deadline(23_400_000, 0);
        assert!(late.starts_with("a tick came 23.4 ms late (more than 20 is a fault): "), "{late}");
        let skipped = deadline(400_000, 12);
        assert!(skipped.starts_with("12 ticks in a row were skipped because"), "{skipped}");
        assert!(!skipped.contains("ms late"), "its lateness is not what is wrong: {skipped}");
        // Both: the tick itself is named.
        assert!(deadline(20_000_001, 40).starts_with("a tick came 20.0 ms late"));
    }
}
