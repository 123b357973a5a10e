//! What the panel says at a glance: what the rig does, whether it is simulated, and who did it.

use std::time::Duration;

use glam::DVec3;
use hbot_api::{Mode, Requester, StateEvent};

use super::{Link, Model, PendingStop, SILENT_AFTER};
use crate::net::Lease;

/// If no state message arrives for this time, what the window shows is grey.
const QUIET_AFTER: Duration = Duration::from_millis(500);
/// The torque is at its limit if it is this part of it or more for so long, s.
const AT_LIMIT: f64 = 0.95;
const AT_LIMIT_S: f64 = 0.2;

/// The one thing that the user must know first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Headline {
    /// The user has asked for a stop, and no state proves that the rig has stopped.
    NotStopped,
    /// The server is silent or unreachable, so what the rig does is not known.
    NoContact,
    /// The connection is new, and no state has arrived yet.
    NoState,
    /// The mode of the rig in the newest state.
    Mode(Mode),
}

impl Headline {
    pub(crate) fn text(self) -> String {
        match self {
            Self::NotStopped => "NOT STOPPED".to_owned(),
            Self::NoContact => "NO CONTACT".to_owned(),
            Self::NoState => "NO STATE".to_owned(),
            Self::Mode(mode) => mode.as_str().to_uppercase(),
        }
    }

    /// Returns a sign that tells the headlines apart without their colours.
    pub(crate) const fn sign(self) -> &'static str {
        match self {
            Self::NotStopped => "\u{d7}",
            Self::NoContact | Self::NoState => "\u{25cc}",
            Self::Mode(Mode::Fault) => "\u{25b2}",
            Self::Mode(Mode::Estop) => "\u{25a0}",
            Self::Mode(Mode::Idle | Mode::Unreferenced) => "\u{25a1}",
            Self::Mode(Mode::Active) => "\u{25cf}",
            Self::Mode(Mode::Enabling) => "\u{25cb}",
        }
    }
}

impl Model {
    /// Returns what the user must know first.
    pub(crate) fn headline(&self) -> Headline {
        if self.unconfirmed_stop().is_some() {
            return Headline::NotStopped;
        }
        match (&self.link, &self.state) {
            (Link::Offline { .. }, _) => Headline::NoContact,
            _ if self.silent_for().is_some() => Headline::NoContact,
            (Link::Online(_) | Link::Recording, Some(state)) => Headline::Mode(state.mode),
            _ => Headline::NoState,
        }
    }

    /// Returns the time since the last state message, if the panel is connected and this time is so
    /// long that what the window shows may be old. Returns `None` otherwise. It comes before
    /// [`Model::silent_for`]; a panel that requests few states per second waits for some of them.
    pub(crate) fn quiet_for(&self) -> Option<Duration> {
        let few = Duration::from_secs_f64(2.5 / f64::from(self.samples_per_s.max(1)));
        let quiet = self.heard?.elapsed();
        (self.is_online() && quiet > QUIET_AFTER.max(few).min(SILENT_AFTER)).then_some(quiet)
    }

    /// Returns the time since the last state message, if there was one.
    pub(crate) fn heard_before(&self) -> Option<Duration> {
        Some(self.heard?.elapsed())
    }

    /// Returns whether what the window shows is live, and so new that it need not be grey.
    pub(crate) fn is_fresh(&self) -> bool {
        self.is_live() && self.quiet_for().is_none()
    }

    /// Returns whether the user has asked the present server for a stop that nothing has confirmed.
    pub(crate) fn has_pending_stop(&self) -> bool {
        self.stops.iter().any(|stop| stop.server == self.server)
    }

    /// Returns whether a stop was sent to the present server, and its answer may still come in
    /// time.
    pub(crate) fn awaits_stop(&self) -> bool {
        self.has_pending_stop() && self.unconfirmed_stop().is_none_or(|stop| stop.server != self.server)
    }

    /// Returns whether the rig that `stop` should have stopped pushes, as a connection says that
    /// was made after it.
    pub(crate) fn pushes_again(&self, stop: &PendingStop) -> bool {
        let pushes = self.mode().is_some_and(super::has_torque);
        stop.reconnected && stop.server == self.server && self.is_fresh() && pushes
    }

    /// Returns whether the torque has been at its limit for a while.
    pub(crate) fn is_at_limit(&self) -> bool {
        let limit = self.info.limits.torque;
        limit > 0.0 && self.history.pushes_with(AT_LIMIT * limit, AT_LIMIT_S)
    }

    /// Returns what cuts the torque of a state. Other limits than these do not show in it.
    pub(crate) fn limit_of(&self, state: &StateEvent) -> &'static str {
        let limit = self.info.limits.torque;
        if state.traction >= 1.0 {
            "Friction cuts"
        } else if limit > 0.0 && DVec3::from(state.torque).length() >= AT_LIMIT * limit {
            "The torque limit cuts"
        } else {
            "Limits cut"
        }
    }

    /// Returns whether the rig that `stop` should have stopped is known to be simulated. Without a
    /// connection it is not: the next one at its address can have motors.
    pub(crate) fn is_of_simulated(&self, stop: &PendingStop) -> bool {
        stop.server == self.server && self.is_online() && self.is_simulated()
    }

    /// Returns the word that tells at a glance whether motors can push. The server's banner and
    /// `hbot watch` use the same words. `None` if the server has not told it yet, or is gone: the
    /// next one at this address can have a real rig.
    pub(crate) fn badge(&self) -> Option<&'static str> {
        let simulated = self.simulated.filter(|_| !matches!(self.link, Link::Offline { .. }));
        simulated.map(|simulated| if simulated { "SIMULATED" } else { "LIVE" })
    }

    /// Returns the badge of the connection that is lost, marked as past.
    pub(crate) fn last_badge(&self) -> Option<&'static str> {
        let simulated = self.simulated.filter(|_| matches!(self.link, Link::Offline { .. }));
        simulated.map(|simulated| if simulated { "was SIMULATED" } else { "was LIVE" })
    }

    /// Returns whether the server has said that its rig is simulated.
    pub(crate) fn is_simulated(&self) -> bool {
        self.simulated == Some(true)
    }

    pub(crate) fn title(&self) -> String {
        match self.badge() {
            Some(badge) => format!("{badge}: {} at {} - hbot panel", self.info.rig.name, self.server),
            None if matches!(self.link, Link::Offline { .. }) => {
                format!("not connected: {} - hbot panel", self.server)
            }
            None => "hbot panel".to_owned(),
        }
    }

    /// Returns who asked for something, as the user of this panel would say it: "you", the user and
    /// machine of another panel, or the name of another client.
    pub(crate) fn who(&self, by: &Requester) -> String {
        match by.session {
            None => format!("the signal {}", by.name),
            Some(_) if self.is_own(by) => "you".to_owned(),
            Some(_) => self.other(by),
        }
    }

    /// Returns whether it was the user of this panel who asked for something.
    pub(crate) fn is_own(&self, by: &Requester) -> bool {
        by.name == self.name
            && by.session.is_some_and(|session| {
                self.sessions.contains(session) || self.stop_sessions.contains(session)
            })
    }

    /// Returns who has stopped the rig, if it was not the user of this panel.
    pub(crate) fn other_stopper(&self) -> Option<String> {
        let by = self.fault.as_ref().filter(|_| self.mode() == Some(Mode::Estop))?.by.as_ref()?;
        (!self.is_own(by)).then(|| self.who(by))
    }

    /// Returns the user and machine of another panel, or the name of another client. The number of
    /// its connection follows if this panel or the lease holder has the same name.
    pub(crate) fn other(&self, by: &Requester) -> String {
        let holds = |it: &Requester| it.name == by.name && it.session != by.session;
        let alike = by.name == self.name || matches!(&self.lease, Lease::Other(it) if holds(it));
        match by.session.filter(|_| alike) {
            Some(session) => format!("{} (session {session})", person(&by.name)),
            None => person(&by.name).to_owned(),
        }
    }
}

/// Returns the user and machine in the name of a panel, and the whole name of any other client.
fn person(name: &str) -> &str {
    name.strip_prefix("panel ").unwrap_or(name)
}
