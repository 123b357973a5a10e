//! Clicks: a short push and its opposite about an axis. The torque is A sin(2 pi t/T) over one
//! period, so its total impulse is zero.
//!
//! A click starts when `fire` changes (also at load if it is not 0) and every `period`. It also
//! starts when the dial about the axis passes from one of `count` notches to the next, and then in
//! the direction of the motion. It gives out energy: at most A times the angle turned during the
//! click.

use super::target::Target;
use super::{Anchor, Law, Now};
use crate::real::{Quat, Real, TURN, Vec3, round, sincos};

/// An effect that makes clicks: short pulses of torque about an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pulse {
    /// Orientation in which the axis is given and from which the dial is measured.
    pub target: Target,
    /// Axis in the target's frame, a unit vector.
    pub axis: Vec3,
    /// Largest torque A, N m.
    pub strength: Real,
    /// Duration T of a click, s, > 0.
    pub duration: Real,
    /// A click starts each time this number changes, and at load if it is not 0.
    pub fire: u32,
    /// Time between periodic clicks, s; 0 for none.
    pub period: Real,
    /// Number of notches around a turn, as for [`Detents`](super::Detents). A click starts if the
    /// nearest notch changes. 0 for none.
    pub count: u16,
}

/// The state of a pulse effect.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Clicks {
    /// Last value of `fire`.
    fired: u32,
    /// Time since the click began, s; `None` if there is no click.
    age: Option<Real>,
    /// True if the click goes against the axis.
    backwards: bool,
    /// Time since the last periodic click, s.
    waited: Real,
    /// The nearest notch.
    notch: Option<i32>,
}

impl Clicks {
    fn start(&mut self, backwards: bool) {
        (self.age, self.backwards) = (Some(0.0), backwards);
    }
}

impl Pulse {
    /// Remembers the nearest notch. If it has changed, returns `Some(true)` for a dial that turned
    /// downwards and `Some(false)` for one that turned upwards.
    fn take_notch(&self, now: &mut Now<'_>, state: &mut Clicks) -> Option<bool> {
        let dial = now.dial(self.axis);
        // If the dial fades, it has no notches.
        if dial.fade().0 < 1.0 {
            state.notch = None;
            return None;
        }
        let count = i32::from(self.count);
        let notch = (round(dial.psi * Real::from(self.count) / TURN) as i32).rem_euclid(count);
        let last = state.notch.replace(notch)?;
        let up = (notch - last).rem_euclid(count);
        (up != 0).then_some(2 * up > count || (2 * up == count && dial.gradient.dot(now.rate()) < 0.0))
    }
}

impl Law for Pulse {
    type Memory = Clicks;

    #[inline]
    fn render(&self, now: &mut Now<'_>, state: &mut Clicks) -> Vec3 {
        if state.fired != self.fire {
            state.fired = self.fire;
            state.start(false);
        }
        if self.period > 0.0 {
            state.waited += now.dt;
            if state.waited >= self.period {
                state.waited -= self.period;
                state.start(false);
            }
        }
        if self.count > 0
            && let Some(backwards) = self.take_notch(now, state)
        {
            state.start(backwards);
        }
        let Some(age) = state.age else { return Vec3::ZERO };
        let next = age + now.dt;
        state.age = (next < self.duration).then_some(next);
        let (sine, _) = sincos(TURN * age / self.duration);
        let size = if state.backwards { -self.strength } else { self.strength };
        now.in_n(self.axis * (size * sine))
    }

    fn reference(&self) -> Option<(Quat, Anchor)> {
        Some(self.target.reference())
    }
}
