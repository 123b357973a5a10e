//! What is fed forward to friction is a loan: without a hand the sphere comes to rest.
//!
//! If the true friction is less than was measured, the torque that is fed forward drives the
//! sphere. No reading tells that from a hand that turns the sphere steadily. So friction is fed
//! forward for one turn of the sphere, and over the next turn it fades out. The count of turns
//! begins anew in each of these cases, none of which occurs without a hand for ever:
//!
//! - The joints stand for [`REST_S`]. If the scene asks for less torque than the friction holds,
//!   [`QUIET_REST_S`] is enough: a free sphere would not move again.
//! - The sphere turns back while the scene asks for so little torque.
//! - Within [`WINDOW_S`] the energy of the sphere has changed by much more, or has fallen by much
//!   more, than motors and friction explain.
//!
//! The sphere is assumed to be balanced, or its imbalance to be known.

use crate::real::{Real, TURN, Vec3, sqrt};

/// Time without motion after which the count begins anew, s.
const REST_S: Real = 0.25;
/// The same if the scene's torque is below what friction holds, s.
const QUIET_REST_S: Real = 0.02;
/// Time over which energies are compared, s.
const WINDOW_S: Real = 0.1;
/// Error of an energy that is expected, as a fraction: inertias and torque constants are not exact.
const UNSURE: Real = 0.3;
/// The same of the energy that friction takes.
const UNSURE_LOSS: Real = 0.5;
/// Energy below which nothing is concluded, J.
const LEAST_J: Real = 1.0e-4;
/// Age of the direction with which the present direction is compared, s: one to two times this.
const TURN_BACK_S: Real = 0.25;
/// Rate above which the sphere has a direction, rad/s.
const LEAST_RATE: Real = 0.1;
/// Time in which the fraction that is fed forward goes from 0 to 1 or back, s.
const FADE_S: Real = 0.1;

/// How much of the friction is still fed forward.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Loan {
    /// Angle that the sphere has turned since the count began, rad.
    turned: Real,
    /// Fraction of the friction that is fed forward, 0 to 1.
    gain: Real,
    /// Time for which the joints have stood, s.
    still_s: Real,
    /// Angular velocities of some time ago, the newer one first, rad/s, and how long ago the newer
    /// one was, s.
    before: [Vec3; 2],
    before_s: Real,
    /// True if the scene's torque has exceeded what friction holds, since each of `before`.
    loud: [bool; 2],
    window: Window,
}

/// Energies since a moment, J.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
struct Window {
    /// Time since the moment, s.
    time_s: Real,
    /// Kinetic energy at the moment, and the largest one since.
    kinetic: [Real; 2],
    /// What the motors had given until the moment, and until the last tick.
    given: [Real; 2],
    /// Sum of the sizes of what they have given in each tick.
    moved: Real,
    /// What friction has taken.
    lost: Real,
}

/// Data of a tick that the loan needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment {
    /// Time since the last tick, s.
    pub(super) dt: Real,
    /// Angular velocity of the sphere in frame N, rad/s.
    pub(super) omega: Vec3,
    /// Kinetic energy of sphere and joints, J.
    pub(super) kinetic: Real,
    /// Energy that the motors have given since the start, J.
    pub(super) given: Real,
    /// Energy that the measured friction takes in this tick, J.
    pub(super) lost: Real,
    /// True if the torques of the scene cannot move the joints from rest.
    pub(super) quiet: bool,
    /// True if the joints stand.
    pub(super) still: bool,
}

impl Loan {
    pub(super) const START: Self = Self {
        turned: 0.0,
        gain: 1.0,
        still_s: 0.0,
        before: [Vec3::ZERO; 2],
        before_s: 0.0,
        loud: [true; 2],
        window: Window { time_s: 0.0, kinetic: [0.0; 2], given: [0.0; 2], moved: 0.0, lost: 0.0 },
    };

    /// Returns the fraction of the friction that is fed forward, 0 to 1.
    #[inline]
    pub(super) fn gain(&self) -> Real {
        self.gain
    }

    /// Advances by a tick. `acts` is false while nothing is fed forward.
    pub(super) fn advance(&mut self, now: &Moment, acts: bool) {
        self.still_s = if now.still { self.still_s + now.dt } else { 0.0 };
        let rests = self.still_s >= if now.quiet { QUIET_REST_S } else { REST_S };
        // Each of them has a memory, so none may be skipped.
        let hand = self.window.shows_a_hand(now) | self.turns_back(now) | rests;
        if hand {
            self.turned = 0.0;
        } else if acts {
            self.turned += sqrt(now.omega.length_squared()) * now.dt;
        }
        let goal = (2.0 - self.turned / TURN).clamp(0.0, 1.0);
        let step = now.dt / FADE_S;
        self.gain += (goal - self.gain).clamp(-step, step);
    }

    /// Returns true if the sphere turns in the opposite direction to some time ago, although the
    /// scene has asked for too little torque to turn it back.
    fn turns_back(&mut self, now: &Moment) -> bool {
        self.loud = self.loud.map(|loud| loud || !now.quiet);
        let least = LEAST_RATE * LEAST_RATE;
        let old = self.before[1];
        let back = !self.loud[1]
            && now.omega.length_squared() > least
            && old.length_squared() > least
            && now.omega.dot(old) < 0.0;
        self.before_s += now.dt;
        if back || self.before_s >= TURN_BACK_S {
            self.before_s = 0.0;
            self.before = [now.omega, if back { now.omega } else { self.before[0] }];
            self.loud = [!now.quiet, if back { !now.quiet } else { self.loud[0] }];
        }
        back
    }
}

impl Window {
    /// Advances by a tick. Returns true if, at the end of the window, the energies show a hand.
    fn shows_a_hand(&mut self, now: &Moment) -> bool {
        self.time_s += now.dt;
        self.kinetic[1] = self.kinetic[1].max(now.kinetic);
        let given = now.given - self.given[1];
        self.given[1] = now.given;
        self.moved += if given < 0.0 { -given } else { given };
        self.lost += now.lost;
        if self.time_s < WINDOW_S {
            return false;
        }
        // Without a hand this is what friction has taken, with a minus.
        let from_outside = (now.kinetic - self.kinetic[0]) - (now.given - self.given[0]);
        let margin = UNSURE * (self.kinetic[1] + self.moved) + UNSURE_LOSS * self.lost + LEAST_J;
        let shown = from_outside > margin || from_outside < -(self.lost + margin);
        *self = Self { time_s: 0.0, kinetic: [now.kinetic; 2], given: [now.given; 2], moved: 0.0, lost: 0.0 };
        shown
    }
}
