//! Clicks: a short push and its opposite about an axis. The torque is A sin(2 pi t/T) over one
//! period, so its total impulse is zero.
//!
//! A click starts when `fire` changes (also at load if it is not 0) and every `period`. It also
//! starts when the dial about the axis passes from one of `count` notches to the next, and then in
//! the direction of the motion. It gives out energy: at most A times the angle turned during the
//! click.

use super::target::Target;
use super::{Anchor, Law, Now};
use crate::real::{PI, Quat, Real, TURN, Vec3, fabs, round, sincos};
use crate::render::outline::{Angles, Outline};

/// An effect that makes clicks: short pulses of torque about an axis. It clicks on request,
/// periodically, or as the sphere turns past notches.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Pulse {
    /// Orientation that defines the axis of the clicks and the zero of the dial's angle.
    pub target: Target,
    /// Axis of the clicks, a unit vector in the target's frame.
    pub axis: Vec3,
    /// Largest torque of a click, N m.
    pub strength: Real,
    /// Duration of a click, s; above 0.
    pub duration: Real,
    /// Counter that requests clicks: a click starts each time this number changes, and at load if
    /// it is not 0.
    pub fire: u32,
    /// Time between periodic clicks, s. 0 for no periodic clicks.
    pub period: Real,
    /// Number of notches around a turn, as in [`Detents`](super::Detents). A click starts each time
    /// another notch becomes the nearest. 0 for no notches.
    pub count: u16,
}

/// The memory of a pulse effect from one tick to the next.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Clicks {
    /// Value of `fire` in the last tick, to detect a change.
    fired: u32,
    /// Time since the present click began, s. `None` between clicks.
    age: Option<Real>,
    /// True if the present click starts with a torque against the axis.
    backwards: bool,
    /// Time since the last periodic click, s.
    waited: Real,
    /// Index of the nearest notch. `None` if it is not known yet.
    notch: Option<i32>,
}

impl Clicks {
    fn start(&mut self, backwards: bool) {
        (self.age, self.backwards) = (Some(0.0), backwards);
    }
}

impl Pulse {
    /// Stores the nearest notch and compares it with the one before. If it has changed, returns
    /// `Some(true)` if the dial's angle has fallen and `Some(false)` if it has risen.
    fn take_notch(&self, now: &mut Now<'_>, state: &mut Clicks) -> Option<bool> {
        // A click accelerates the sphere. If the pose were led, this alone could take it across a
        // notch, and clicks would start each other.
        now.lead_at_most(0.0);
        let dial = now.dial(self.axis);
        // If the dial fades, it has no notches.
        if dial.fade().0 < 1.0 {
            state.notch = None;
            return None;
        }
        let count = i32::from(self.count);
        if count == 1 {
            // The only notch is left and reached at a half turn, where the side changes.
            let side = i32::from(dial.psi < 0.0);
            let last = state.notch.replace(side)?;
            return (fabs(dial.psi) > 0.5 * PI && last != side).then_some(last == 1);
        }
        let notch = (round(dial.psi * Real::from(self.count) / TURN) as i32).rem_euclid(count);
        let last = state.notch.replace(notch)?;
        let up = (notch - last).rem_euclid(count);
        (up != 0).then_some(2 * up > count || (2 * up == count && dial.gradient.dot(now.rate()) < 0.0))
    }
}

impl Law for Pulse {
    type Memory = Clicks;

    const GIVES: bool = true;
    const ELASTIC: bool = false;

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

    fn outline<'a>(&self, _: &'a [Real], visit: &mut dyn FnMut(Outline<'a>)) {
        if self.count > 0 {
            visit(Outline::Clicks { axis: self.axis, angles: Angles::Even(self.count) });
        }
    }
}
