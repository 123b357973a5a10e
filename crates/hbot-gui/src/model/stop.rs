//! A stop that the user has asked for, until something confirms it.

use std::time::{Duration, Instant};

use hbot_api::{Mode, StateEvent};

/// A stop that is not confirmed after this time is reported. The stop line waits as long for an
/// answer.
const CONFIRMED_WITHIN: Duration = Duration::from_secs(1);

/// A stop that the user has asked for, and that neither an answer nor a state has confirmed yet.
#[derive(Clone, Debug)]
pub(crate) struct PendingStop {
    /// Address of the server that was asked. States of another server prove nothing about its rig.
    pub(crate) server: String,
    asked: Instant,
    /// Tick of the newest state when the stop was asked for. `None` if no state of the present
    /// connection had arrived by then.
    after: Option<u64>,
    /// Whether the stop could not be sent or was not answered.
    failed: bool,
    /// Why the stop was not confirmed, if the present connection has told it.
    why: Option<String>,
    /// Whether a connection was made after the stop was asked for.
    pub(crate) reconnected: bool,
}

impl PendingStop {
    pub(crate) fn new(server: &str, newest: Option<&StateEvent>) -> Self {
        let after = newest.map(|state| state.tick);
        let server = server.to_owned();
        Self { server, asked: Instant::now(), after, failed: false, why: None, reconnected: false }
    }

    /// Records that the stop could not be sent or was not answered. The first reason stays, because
    /// further attempts fail for the same or for a lesser reason.
    pub(crate) fn fail(&mut self, why: String) {
        self.failed = true;
        self.why.get_or_insert(why);
    }

    /// Records that a new connection was made. Its ticks can begin again at 0, and all of its
    /// states come after the stop. Why an earlier attempt failed says nothing about this one.
    pub(crate) fn reconnect(&mut self) {
        self.after = None;
        self.why = None;
        self.reconnected = true;
    }

    /// Returns the time since the stop was asked for first.
    pub(crate) fn since(&self) -> Duration {
        self.asked.elapsed()
    }

    /// Returns whether the stop has failed, or has not been answered in time.
    pub(crate) fn is_unconfirmed(&self) -> bool {
        self.failed || self.asked.elapsed() > CONFIRMED_WITHIN
    }

    /// Returns whether `state`, from the server at the address `server`, proves that the rig has
    /// stopped: its tick came after the stop was asked for, and its mode is one without torque.
    pub(crate) fn is_proved_by(&self, server: &str, state: &StateEvent) -> bool {
        let later = self.after.is_none_or(|tick| state.tick > tick);
        server == self.server && later && !has_torque(state.mode)
    }

    /// Returns what went wrong, for the person who uses the rig.
    pub(crate) fn why(&self) -> &str {
        match &self.why {
            Some(why) => why,
            None if self.reconnected => "asked for before the present connection",
            None => "the server has not confirmed the stop",
        }
    }

    /// Returns what the user of a panel at the address `server` can do, and what ends the report of
    /// this stop. `has_keys` is whether the window gets what is typed.
    pub(crate) fn way_out(&self, server: &str, has_keys: bool) -> String {
        if server == self.server {
            let what = if has_keys { "STOP (or Esc)" } else { "STOP" };
            format!("Press {what} again. This message ends when the rig reports a mode without torque.")
        } else {
            format!(
                "This panel is at {server} now and cannot stop that rig. This message ends when it is at {} again and the \
                 rig reports a mode without torque.",
                self.server
            )
        }
    }
}

/// Returns whether the motors can have torque in this mode.
pub(crate) const fn has_torque(mode: Mode) -> bool {
    match mode {
        Mode::Enabling | Mode::Active => true,
        Mode::Unreferenced | Mode::Idle | Mode::Fault | Mode::Estop => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(tick: u64, mode: Mode) -> StateEvent {
        StateEvent { tick, mode, ..StateEvent::default() }
    }

    #[test]
    fn only_a_later_state_without_torque_of_this_server_proves_a_stop() {
        let stop = PendingStop::new("a", Some(&state(100, Mode::Active)));
        for (server, tick, mode, proved) in [
            ("a", 101, Mode::Estop, true),
            ("a", 101, Mode::Idle, true),
            ("a", 101, Mode::Fault, true),
            ("a", 100, Mode::Estop, false),
            ("a", 7, Mode::Estop, false),
            ("a", 101, Mode::Active, false),
            ("a", 101, Mode::Enabling, false),
            ("b", 101, Mode::Estop, false),
        ] {
            let state = state(tick, mode);
            assert_eq!(stop.is_proved_by(server, &state), proved, "{server} {tick} {mode}");
        }
        let mut stop = stop;
        stop.reconnect();
        assert!(stop.is_proved_by("a", &state(7, Mode::Idle)), "a server that has started again");
    }
}
