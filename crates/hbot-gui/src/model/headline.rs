//! What the panel says at a glance: what the rig does, whether it is simulated, and who did it.

use hbot_api::{Mode, Requester};

use super::{Link, Model};

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
    /// Returns the headline as it stands in the window.
    pub(crate) fn text(self) -> String {
        match self {
            Self::NotStopped => "NOT STOPPED".to_owned(),
            Self::NoContact => "NO CONTACT".to_owned(),
            Self::NoState => "NO STATE".to_owned(),
            Self::Mode(mode) => mode.as_str().to_uppercase(),
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

    /// Returns the word that tells at a glance whether motors can push. The server's banner and
    /// `hbot watch` use the same words. `None` if the server has not told it yet, or is gone: the
    /// next one at this address can have a real rig.
    pub(crate) fn badge(&self) -> Option<&'static str> {
        let simulated = self.simulated.filter(|_| !matches!(self.link, Link::Offline { .. }));
        simulated.map(|simulated| if simulated { "SIMULATED" } else { "LIVE" })
    }

    /// Returns whether the server has said that its rig is simulated.
    pub(crate) fn is_simulated(&self) -> bool {
        self.simulated == Some(true)
    }

    /// Returns the title of the window.
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
        let own = |session| self.sessions.contains(session) || self.stop_sessions.contains(session);
        match by.session {
            None => format!("the signal {}", by.name),
            Some(session) if by.name == self.name && own(session) => "you".to_owned(),
            Some(_) => person(&by.name).to_owned(),
        }
    }

    /// Returns a message of the server about `by`, in which "you" stands for the user of this
    /// panel.
    pub(super) fn with_you(&self, message: &str, by: Option<&Requester>) -> String {
        match by {
            Some(by @ Requester { name, session: Some(session) }) if self.who(by) == "you" => {
                message.replace(&format!("client {name:?} (session {session})"), "you")
            }
            _ => message.to_owned(),
        }
    }
}

/// Returns the user and machine in the name of a panel, and the whole name of any other client.
pub(crate) fn person(name: &str) -> &str {
    name.strip_prefix("panel ").unwrap_or(name)
}
