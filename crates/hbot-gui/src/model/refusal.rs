//! A request to enable or to reset that the server has refused.

use glam::DQuat;
use hbot_api::{Mode, StateEvent};

use super::has_torque;
use super::sample::quaternion;
use crate::net::Intent;

/// A refusal of `enable` is over when the sphere has turned by this angle since, rad: the distance
/// from the reference may be another.
const TURNED: f64 = 0.1;

/// A request to enable or to reset that the server has refused.
#[derive(Clone, Debug)]
pub(crate) struct Refusal {
    intent: Intent,
    why: String,
    /// Orientation of the sphere at the refusal.
    q: Option<DQuat>,
}

impl Refusal {
    /// Returns the refusal of `intent` in the state `state`. Returns `None` if this is no request
    /// to enable or to reset.
    pub(super) fn of(intent: &Intent, why: String, state: Option<&StateEvent>) -> Option<Self> {
        let q = state.map(|state| quaternion(state.q));
        let is_told = matches!(intent, Intent::Enable | Intent::Reset | Intent::Recover);
        is_told.then(|| Self { intent: intent.clone(), why, q })
    }

    /// Returns whether what was refused has come about, perhaps by another client, or the reason
    /// may be gone.
    pub(super) fn is_over(&self, state: &StateEvent) -> bool {
        let stopped = matches!(state.mode, Mode::Fault | Mode::Estop);
        let turned = self.q.is_some_and(|q| q.angle_between(quaternion(state.q)) > TURNED);
        has_torque(state.mode) || !stopped && (self.intent == Intent::Reset || turned)
    }

    pub(crate) fn in_words(&self) -> String {
        let what = match self.intent {
            Intent::Enable => "enabled",
            Intent::Reset => "reset",
            _ => "recovered",
        };
        format!("Not {what}: {}", self.why.replace('`', ""))
    }
}
