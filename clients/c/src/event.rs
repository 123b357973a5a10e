//! States and other events, in the order in which the program asks for them.

use std::collections::VecDeque;
use std::ffi::c_char;
use std::time::{Duration, Instant};

use hbot_api::{Event, FaultEvent, LeaseCause, Requester, StateEvent};

use crate::boundary::{Out, copied};
use crate::client::{HbotClient, Inner, with};
use crate::state::{HbotFault, HbotMode, HbotState};
use crate::status::{Failure, HbotStatus, refusal};

/// Largest number of states that wait while a program asks only for other events: those of four
/// seconds at 1 kHz. The oldest are dropped first.
const MAX_STATES: usize = 4096;

/// Longest time for which `hbot_latest_state` looks for a newer state.
const LATEST_WITHIN: Duration = Duration::from_millis(20);

/// Largest number of other events that wait while a program asks only for states.
const MAX_NOTICES: usize = 256;

/// What an hbot_event is about.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HbotEventKind {
    /// An event of a later server. Ignore it.
    Unknown = 0,
    /// The rig went into a fault or an emergency stop, or left it: `tick`, `t`, `mode`, `fault`,
    /// and in `text` the reason.
    Fault = 1,
    /// The lease has another holder: `cause`, `mine`, `session`, and in `text` the holder.
    Lease = 2,
    /// Another scene is rendered: `tick`, and in `text` its name.
    Scene = 3,
    /// States were dropped because this client read too slowly: `count`, `total`.
    Dropped = 4,
    /// Stream messages were refused: `count`, `total`, `status`, and in `text` the reason.
    Refused = 5,
    /// The server ends: in `text` the reason.
    Stopping = 6,
    /// The sphere shakes by itself, or has its full torque again: `tick`, `t`, and in `text` what
    /// was found.
    Shaking = 7,
    /// Parameters of an effect have changed: `tick`, and in `text` the id of the effect.
    Set = 8,
}

/// Why the lease has another holder.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HbotLeaseCause {
    /// The event is not about the lease.
    None = 0,
    /// A client took the free lease.
    Acquired = 1,
    /// The holder gave it back.
    Released = 2,
    /// A client took it from the holder.
    Stolen = 3,
    /// The holder's connection ended.
    Disconnected = 4,
}

/// An event other than a state. Fields that do not belong to its kind are 0.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct HbotEvent {
    /// What the event is about.
    pub kind: HbotEventKind,
    /// Number of the tick in which it happened.
    pub tick: u64,
    /// Time of that tick, s.
    pub t: f64,
    /// Mode after a fault event.
    pub mode: HbotMode,
    /// Cause of a fault event.
    pub fault: HbotFault,
    /// Cause of a lease event.
    pub cause: HbotLeaseCause,
    /// Whether this client now has the lease.
    pub mine: bool,
    /// Session of the holder of the lease; 0 if it is free.
    pub session: u64,
    /// Number of states or messages since the last event of this kind.
    pub count: u64,
    /// Number of states or messages on this connection.
    pub total: u64,
    /// Why the last stream message was refused.
    pub status: HbotStatus,
    /// Text for people. A longer text is cut.
    pub text: [c_char; 512],
    /// Name of the client that asked for what a fault, lease, scene or set event reports, or of the
    /// signal that stopped the rig. Empty if the rig stopped by itself.
    pub by: [c_char; 72],
    /// Session of that client; 0 if there is none.
    pub by_session: u64,
}

/// Returns what happened in a fault or a stop, what to do about it, and where the flight log is.
fn told(fault: &FaultEvent) -> String {
    let remedy = fault.remedy.iter().map(|remedy| format!(". {remedy}"));
    let log = fault.flight_log.iter().map(|path| format!("; flight log: {path}"));
    [fault.message.clone()].into_iter().chain(remedy).chain(log).collect()
}

impl HbotEvent {
    fn new(kind: HbotEventKind, text: &str) -> Self {
        Self {
            kind,
            tick: 0,
            t: 0.0,
            mode: HbotMode::Unreferenced,
            fault: HbotFault::None,
            cause: HbotLeaseCause::None,
            mine: false,
            session: 0,
            count: 0,
            total: 0,
            status: HbotStatus::Ok,
            text: copied(text),
            by: copied(""),
            by_session: 0,
        }
    }

    /// Adds who asked for what the event reports.
    fn by(self, by: Option<&Requester>) -> Self {
        let Some(by) = by else { return self };
        Self { by: copied(&by.name), by_session: by.session.unwrap_or_default(), ..self }
    }

    /// Converts an event. `session` is the number of this connection.
    fn of(event: &Event, session: u64) -> Self {
        match event {
            Event::Fault(fault) => Self {
                tick: fault.tick,
                t: fault.t,
                mode: fault.mode.into(),
                fault: fault.fault.into(),
                ..Self::new(HbotEventKind::Fault, &told(fault)).by(fault.by.as_ref())
            },
            Event::Lease(lease) => Self {
                cause: match lease.cause {
                    LeaseCause::Acquired => HbotLeaseCause::Acquired,
                    LeaseCause::Released => HbotLeaseCause::Released,
                    LeaseCause::Stolen => HbotLeaseCause::Stolen,
                    LeaseCause::Disconnected => HbotLeaseCause::Disconnected,
                },
                mine: lease.session == Some(session),
                session: lease.session.unwrap_or_default(),
                ..Self::new(HbotEventKind::Lease, lease.holder.as_deref().unwrap_or_default())
                    .by(lease.by.as_ref())
            },
            Event::Scene(scene) => Self {
                tick: scene.tick,
                ..Self::new(HbotEventKind::Scene, &scene.name).by(scene.by.as_ref())
            },
            Event::Set(set) => {
                Self { tick: set.tick, ..Self::new(HbotEventKind::Set, &set.effect).by(set.by.as_ref()) }
            }
            Event::Dropped(dropped) => {
                Self { count: dropped.count, total: dropped.total, ..Self::new(HbotEventKind::Dropped, "") }
            }
            Event::Refused(refused) => Self {
                count: refused.count,
                total: refused.total,
                status: refusal(refused.code),
                ..Self::new(HbotEventKind::Refused, &refused.message)
            },
            Event::Shaking(shaking) => Self {
                tick: shaking.tick,
                t: shaking.t,
                ..Self::new(HbotEventKind::Shaking, &shaking.message)
            },
            Event::Stopping(stopping) => Self::new(HbotEventKind::Stopping, &stopping.message),
            Event::State(_) | Event::Unknown => Self::new(HbotEventKind::Unknown, ""),
        }
    }
}

impl Inner {
    /// Returns the oldest state that the program has not seen, and waits for one until the
    /// deadline.
    fn next_state(&mut self, deadline: Instant) -> Result<Option<StateEvent>, Failure> {
        if let Some(state) = self.states.pop_front() {
            return Ok(Some(state));
        }
        loop {
            match self.client.next_event(left(deadline))? {
                None => return Ok(None),
                Some(Event::State(state)) => return Ok(Some(state)),
                Some(event) => self.lost += push(&mut self.notices, event, MAX_NOTICES),
            }
        }
    }

    /// Returns the oldest event other than a state that the program has not seen, and waits for one
    /// until the deadline.
    fn next_notice(&mut self, deadline: Instant) -> Result<Option<Event>, Failure> {
        if let Some(event) = self.notices.pop_front() {
            return Ok(Some(event));
        }
        loop {
            match self.client.next_event(left(deadline))? {
                None => return Ok(None),
                Some(Event::State(state)) => self.lost += push(&mut self.states, state, MAX_STATES),
                Some(event) => return Ok(Some(event)),
            }
            // A flood of states must not extend the waiting time.
            if Instant::now() > deadline && self.states.len() == MAX_STATES {
                return Ok(None);
            }
        }
    }
}

/// Appends to a bounded queue. Returns how many elements were dropped for that.
fn push<T>(queue: &mut VecDeque<T>, element: T, most: usize) -> u64 {
    let full = queue.len() == most;
    if full {
        queue.pop_front();
    }
    queue.push_back(element);
    u64::from(full)
}

fn left(deadline: Instant) -> Duration {
    deadline.saturating_duration_since(Instant::now())
}

fn after(timeout_ms: u32) -> Instant {
    Instant::now() + Duration::from_millis(timeout_ms.into())
}

/// Reads the oldest state that has not been read yet, and waits for one for at most `timeout_ms`.
/// Returns HBOT_STATUS_NOTHING if none has come. Needs hbot_subscribe().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_next_state(
    client: *mut HbotClient,
    timeout_ms: u32,
    state: *mut HbotState,
) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let out = Out::new(state, "state")?;
            let Some(state) = inner.next_state(after(timeout_ms))? else { return Ok(HbotStatus::Nothing) };
            out.write(HbotState::of(&state)?);
            Ok(HbotStatus::Ok)
        })
    }
}

/// Reads the newest state that has arrived, and drops older ones; looks for newer ones for at most
/// 20 ms. Waits for at most `timeout_ms` if none has arrived, and returns HBOT_STATUS_NOTHING if
/// none comes. For programs that draw.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_latest_state(
    client: *mut HbotClient,
    timeout_ms: u32,
    state: *mut HbotState,
) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let out = Out::new(state, "state")?;
            let Some(mut newest) = inner.next_state(after(timeout_ms))? else {
                return Ok(HbotStatus::Nothing);
            };
            let now = Instant::now();
            // If the connection has ended, the next call reports it. A machine that reads more
            // slowly than states arrive would never come to the end.
            while now.elapsed() < LATEST_WITHIN
                && let Ok(Some(newer)) = inner.next_state(now)
            {
                newest = newer;
            }
            out.write(HbotState::of(&newest)?);
            Ok(HbotStatus::Ok)
        })
    }
}

/// Reads the oldest event other than a state that has not been read yet, and waits for one for at
/// most `timeout_ms`. Returns HBOT_STATUS_NOTHING if none has come. The last one of a server that
/// ends is HBOT_EVENT_KIND_STOPPING.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_next_event(
    client: *mut HbotClient,
    timeout_ms: u32,
    event: *mut HbotEvent,
) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let out = Out::new(event, "event")?;
            let session = inner.client.hello().session;
            let Some(event) = inner.next_notice(after(timeout_ms))? else { return Ok(HbotStatus::Nothing) };
            out.write(HbotEvent::of(&event, session));
            Ok(HbotStatus::Ok)
        })
    }
}

/// Writes to `*lost` how many states and events were dropped on this side because the program did
/// not read them. The queue holds those of about four seconds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_events_lost(client: *mut HbotClient, lost: *mut u64) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            Out::new(lost, "lost")?.write(inner.lost + inner.client.events_lost());
            Ok(HbotStatus::Ok)
        })
    }
}
