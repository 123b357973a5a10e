//! A loop that computes a torque from each state and streams it.

use super::{Client, ClientError};
use crate::names::names;
use crate::{ErrorBody, ErrorCode, Event, Mode, Op, ServerMessage, StateEvent, TorqueCommand};
use std::time::{Duration, Instant};

/// Options of [`Client::render`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RenderOptions {
    /// Number of ticks from one state to the next, from 1 to [`MAX_EVERY`](crate::MAX_EVERY).
    pub every: u64,
    /// Time from the arrival of a torque at the server until it expires, ms, 1 to
    /// [`MAX_VALID_MS`](crate::MAX_VALID_MS). Choose several periods of the states, so that one
    /// late torque is not felt.
    pub valid_ms: u64,
    /// What happens to states that wait because the program was late.
    pub late: LatePolicy,
    /// Time after which the loop ends. `None`: it does not end by itself.
    pub duration: Option<Duration>,
}

/// A torque from every tick, valid for 20 ms; only the newest state counts; no end.
impl Default for RenderOptions {
    fn default() -> Self {
        Self { every: 1, valid_ms: 20, late: LatePolicy::Newest, duration: None }
    }
}

names! {
    /// What [`Client::render`] does if several states have arrived, because the program was late.
    #[derive(Default)]
    pub enum LatePolicy {
        /// Only the newest state is rendered. The others are missed and counted. So a program that
        /// was late once has caught up with the next torque.
        #[default]
        Newest = "newest",
        /// Every state is rendered, in order, also if a newer one has arrived. The server refuses
        /// torques from states that are older than the rig's `max_age_ticks`.
        Each = "each",
    }
}

/// Why [`Client::render`] has ended without an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RenderEnd {
    /// The program's function returned `None`.
    Asked,
    /// The duration in the options is over.
    Duration,
    /// The rig stopped rendering. The value is its mode: a fault, an emergency stop, or idle after
    /// it had been on.
    Stopped(Mode),
    /// Another client has taken the lease, or it was given back.
    LeaseLost,
    /// The server is stopping.
    ServerStopping,
}

/// What [`Client::render`] has done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RenderReport {
    /// Why the loop ended.
    pub end: RenderEnd,
    /// Number of states from which a torque was computed and sent.
    pub rendered: u64,
    /// Number of states that were passed over because a newer one had arrived.
    pub missed: u64,
    /// Number of torques that the server refused, as far as it has reported them.
    pub refused: u64,
}

/// The variables of a running [`Client::render`].
struct Rendering {
    start: Instant,
    /// Whether a state with torque has been seen.
    was_on: bool,
    report: RenderReport,
}

impl Client {
    /// Subscribes to states, computes a torque from each with `torque`, and streams it, until
    /// `torque` returns `None` or something else ends the loop (see [`RenderEnd`]). At the end, and
    /// after an error, it sends a zero torque and unsubscribes. The client has to hold the lease,
    /// and the rig has to be enabled.
    ///
    /// Torques are in frame N, N m. Each carries the tick of its state, so the server refuses it if
    /// it is too old. If `torque` takes longer than `valid_ms`, the torque in force goes to zero
    /// until the next one arrives. Events other than states are kept for
    /// [`next_event`](Self::next_event). The sequence number of a torque is its number in this
    /// loop, counted from 1.
    ///
    /// A program that computes the torque from an older state, in another thread for example, reads
    /// states with [`next_event`](Self::next_event) and sends with [`torque`](Self::torque), with
    /// the tick of that older state. The age in states would be too low otherwise.
    ///
    /// # Errors
    ///
    /// Fails with [`ClientError::NoState`] if no state arrives within the client's timeout, with
    /// [`ClientError::Server`] if the client does not hold the lease, and if the connection breaks.
    pub fn render(
        &mut self,
        options: &RenderOptions,
        mut torque: impl FnMut(&StateEvent) -> Option<[f64; 3]>,
    ) -> Result<RenderReport, ClientError> {
        self.subscribe(options.every)?;
        // States of an earlier subscription.
        self.events.retain(|event| !matches!(event, Event::State(_)));
        let zero = TorqueCommand { torque: [0.0; 3], valid_ms: 1, tick: None, seq: None };
        let report = match self.render_states(options, &mut torque) {
            Ok(report) => report,
            Err(error) => {
                // No answer is awaited: the server may be silent. The first error is the cause. A
                // torque without the lease would be refused later, in the next loop.
                let held = error.code() != Some(ErrorCode::NotHolder);
                let ended = if held { self.torque(zero) } else { Ok(()) };
                let _ = ended.and_then(|()| self.send_with_id(Op::Unsubscribe));
                return Err(error);
            }
        };
        if report.end != RenderEnd::LeaseLost {
            self.torque(zero)?;
        }
        if report.end != RenderEnd::ServerStopping {
            self.unsubscribe()?;
        }
        Ok(report)
    }

    fn render_states(
        &mut self,
        options: &RenderOptions,
        torque: &mut impl FnMut(&StateEvent) -> Option<[f64; 3]>,
    ) -> Result<RenderReport, ClientError> {
        let report = RenderReport { end: RenderEnd::Asked, rendered: 0, missed: 0, refused: 0 };
        let mut rendering = Rendering { start: Instant::now(), was_on: false, report };
        loop {
            let state = match self.newest_state(options, &mut rendering)? {
                Ok(state) => state,
                Err(end) => return Ok(RenderReport { end, ..rendering.report }),
            };
            if let Some(end) = rendering.end(&state, options.duration) {
                return Ok(RenderReport { end, ..rendering.report });
            }
            let Some(torque) = torque(&state) else {
                return Ok(RenderReport { end: RenderEnd::Asked, ..rendering.report });
            };
            rendering.report.rendered += 1;
            self.torque(TorqueCommand {
                torque,
                valid_ms: options.valid_ms,
                tick: Some(state.tick),
                seq: Some(rendering.report.rendered),
            })?;
        }
    }

    /// Waits for a state. With [`LatePolicy::Newest`] it returns the newest one that has arrived.
    /// Returns an inner error if an event ends the loop.
    fn newest_state(
        &mut self,
        options: &RenderOptions,
        rendering: &mut Rendering,
    ) -> Result<Result<StateEvent, RenderEnd>, ClientError> {
        let deadline = Instant::now() + self.timeout;
        let mut newest: Option<StateEvent> = None;
        loop {
            let deadline = if newest.is_some() { Instant::now() } else { deadline };
            match (self.receive(deadline)?, newest.take()) {
                (None, Some(state)) => return Ok(Ok(state)),
                (None, None) => return Err(ClientError::NoState { after: self.timeout }),
                (Some(ServerMessage::Event(Event::State(state))), before) => {
                    rendering.report.missed += u64::from(before.is_some());
                    if options.late == LatePolicy::Each {
                        return Ok(Ok(state));
                    }
                    newest = Some(state);
                }
                (Some(ServerMessage::Event(event)), before) => {
                    let end = self.end_by(&event, rendering);
                    self.keep(event);
                    if let Some(end) = end? {
                        return Ok(Err(end));
                    }
                    newest = before;
                }
                // The late answer to a call that has timed out.
                (Some(ServerMessage::Response(_)), before) => newest = before,
            }
        }
    }

    /// Returns why this event ends the loop, or `None` if it does not. Counts refused torques.
    fn end_by(&self, event: &Event, rendering: &mut Rendering) -> Result<Option<RenderEnd>, ClientError> {
        Ok(match event {
            Event::Lease(lease) if lease.session != Some(self.hello.session) => Some(RenderEnd::LeaseLost),
            Event::Fault(fault) if matches!(fault.mode, Mode::Fault | Mode::Estop) => {
                Some(RenderEnd::Stopped(fault.mode))
            }
            Event::Stopping(_) => Some(RenderEnd::ServerStopping),
            Event::Refused(refused) if refused.code == ErrorCode::NotHolder => {
                return Err(ClientError::Server(ErrorBody::new(refused.code, refused.message.clone())));
            }
            Event::Refused(refused) => {
                rendering.report.refused += refused.count;
                None
            }
            _ => None,
        })
    }
}

impl Rendering {
    /// Returns why the loop ends at this state, or `None` if it goes on.
    fn end(&mut self, state: &StateEvent, duration: Option<Duration>) -> Option<RenderEnd> {
        match state.mode {
            Mode::Fault | Mode::Estop => return Some(RenderEnd::Stopped(state.mode)),
            Mode::Idle | Mode::Unreferenced if self.was_on => return Some(RenderEnd::Stopped(state.mode)),
            Mode::Enabling | Mode::Active => self.was_on = true,
            Mode::Idle | Mode::Unreferenced => {}
        }
        duration.is_some_and(|duration| self.start.elapsed() >= duration).then_some(RenderEnd::Duration)
    }
}
