//! Clicks: a short push and its opposite about an axis, A sin(2 pi t/T) over one period, whose impulse is zero.
//!
//! A click comes whenever `fire` changes (by `set`; at load where it is not 0), every `period`, and whenever the dial about
//! the axis passes from one of `count` notches to the next, then along the motion. It gives energy: at most A times the path turned meanwhile.

use super::target::Target;
use super::{Anchor, Law, Now};
use crate::real::{Quat, Real, TURN, Vec3, round, sincos};

/// Clicks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pulse {
    /// What the axis is given in and the dial measured from.
    pub target: Target,
    /// In the target's frame, unit.
    pub axis: Vec3,
    /// A, N m.
    pub strength: Real,
    /// T, s, > 0.
    pub duration: Real,
    /// A click each time that this changes; at load where it is not 0.
    pub fire: u32,
    /// A click at every period, s; 0 for none.
    pub period: Real,
    /// Notches around a turn, as [`Detents`](super::Detents) has them: a click where the nearest changes. 0 for none.
    pub count: u16,
}

/// Where a pulse stands.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Clicks {
    /// The last `fire` seen.
    fired: u32,
    /// Since the click began, s, while it lasts.
    age: Option<Real>,
    /// Its sense.
    backwards: bool,
    /// Since the last periodic click, s.
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
    /// Remembers the nearest notch. Returns whether the dial has passed on to another one: `Some(true)` downwards, `Some(false)` upwards.
    fn take_notch(&self, now: &mut Now<'_>, state: &mut Clicks) -> Option<bool> {
        let dial = now.dial(self.axis);
        // Where the dial fades, so do its notches.
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
