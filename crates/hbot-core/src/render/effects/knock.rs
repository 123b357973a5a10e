//! Knocks: a short vibration at the moment at which the sphere meets a wall or falls into a notch.
//!
//! A spring alone is too soft to sound like a hard surface. A decaying vibration that starts at the
//! impact makes it feel hard (Okamura, Cutkosky and Dennerlein 2001; Kuchenbecker, Fiene and
//! Niemeyer 2006, IEEE TVCG 12(2)). t seconds after an impact at the speed v the torque against the
//! direction of the impact is
//!
//! ```text
//! A v exp(-t/s) sin(2 pi f t)        v at most FASTEST
//! ```
//!
//! It gives out energy on purpose. The energy is bounded: a knock ends as soon as its torque would
//! have given out more than [`MOST_ENERGY`] (before the effect's gain). A knock starts only if the
//! place was not touched before, and only after the last knock of the effect has ended. So there is
//! one knock for each impact, however the sphere trembles at the edge.

use super::{Anchor, Law, Now};
use crate::real::{Quat, Real, TURN, Vec3, exp as e_to, fabs, sincos, sqrt};
use crate::render::around::Spot;
use crate::render::outline::Outline;

/// Largest speed of an impact that a knock grows with, rad/s.
const FASTEST: Real = 5.0;
/// Largest energy that one knock gives to the sphere, J, before the effect's gain.
const MOST_ENERGY: Real = 0.01;
/// Duration of a knock, in units of its decay time. Its torque is then below e^-8, 0.03 %, of the
/// first.
const LASTS: Real = 8.0;

/// The knock of an effect: a decaying vibration at each impact.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Knock {
    /// Torque for each rad/s of the speed of the impact, A, N m s/rad.
    pub amplitude: Real,
    /// Frequency f, Hz.
    pub frequency: Real,
    /// Time s in which the vibration falls to 1/e; above 0.
    pub decay: Real,
}

impl Knock {
    /// Returns the torque for each rad/s of speed, `age` seconds after the impact, N m s/rad.
    fn at(&self, age: Real) -> Real {
        let (sine, _) = sincos(TURN * self.frequency * age);
        self.amplitude * e_to(-age / self.decay) * sine
    }
}

/// An effect with a knock: the law `law` renders as without it, and the knock is added.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Knocking<L> {
    /// The effect that has the knock.
    pub law: L,
    /// The knock.
    pub knock: Knock,
}

/// A place that the sphere touches: a wall or a notch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Touched {
    /// Number of the place among those of its list; above 0.
    pub(crate) place: u16,
    /// Direction of turn that leads into the place, of any length, in the reference's frame.
    pub(crate) way: Vec3,
}

/// A law whose walls or notches the sphere can meet.
pub(crate) trait Meets: Law {
    /// Returns the places that the sphere touches, at most one of each of two lists, such as
    /// notches and end walls. `held` are the numbers of the places that it touched in the last
    /// tick, 0 for none. The law chooses a wider range for these, so that a sphere that trembles at
    /// the edge touches a place once. `memory` is that after [`Law::render`] of this tick.
    fn touched(&self, now: &mut Now<'_>, memory: &Self::Memory, held: [u16; 2]) -> [Option<Touched>; 2];
}

/// The memory of an effect with a knock.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Knocked<M> {
    law: M,
    /// Numbers of the places that the sphere touched in the last tick. `None` before the first
    /// tick: a sphere that begins in a wall has not met it.
    held: Option<[u16; 2]>,
    /// Time since the impact, s. `None` if no knock sounds.
    age: Option<Real>,
    /// Speed of the impact times its unit direction, against which the knock begins, in the
    /// reference's frame, rad/s.
    impact: Vec3,
    /// Energy that the knock has given to the sphere, J. Negative if it was absorbed.
    given: Real,
}

impl<M: Copy> Knocked<M> {
    /// Creates the memory of an effect whose law has the memory `law`, before its first knock.
    pub(crate) fn silent(law: M) -> Self {
        Self { law, held: None, age: None, impact: Vec3::ZERO, given: 0.0 }
    }

    /// Returns the memory of the law.
    pub(crate) fn law(&self) -> M {
        self.law
    }
}

/// Advances the knock of `effect` by one tick.
fn advance<L: Meets>(effect: &Knocking<L>, now: &mut Now<'_>, state: &mut Knocked<L::Memory>) {
    let Knocking { law, knock } = effect;
    // The pose that is met is the measured one. A knock that pushes the sphere must not move
    // the led pose out of a wall and in again.
    now.lead_at_most(0.0);
    if let Some(age) = state.age {
        let next = age + now.dt;
        let turn = state.impact.dot(now.rate()) * now.dt;
        state.given -= knock.at(age) * turn;
        // However the sphere turns meanwhile, it does so at most at about this speed.
        let coming = fabs(knock.at(next) * turn);
        let goes_on = next < LASTS * knock.decay && state.given + coming < MOST_ENERGY;
        state.age = goes_on.then_some(next);
    }
    let before = state.held;
    let held = before.unwrap_or([0; 2]);
    let touched = law.touched(now, &state.law, held);
    state.held = Some(touched.map(|touched| touched.map_or(0, |touched| touched.place)));
    if before.is_none() || state.age.is_some() {
        return;
    }
    for (touched, held) in touched.into_iter().zip(held) {
        let Some(Touched { place, way }) = touched.filter(|touched| touched.place != held) else {
            continue;
        };
        let length = sqrt(way.length_squared());
        let speed = way.dot(now.rate()) / length;
        // False for a way without a direction.
        if place != 0 && speed > 0.0 {
            state.impact = way * (speed.min(FASTEST) / length);
            (state.age, state.given) = (Some(0.0), 0.0);
            return;
        }
    }
}

impl<L: Meets> Law for Knocking<L> {
    type Memory = Knocked<L::Memory>;

    const REMEMBERS: bool = L::REMEMBERS;

    fn render(&self, now: &mut Now<'_>, state: &mut Self::Memory) -> Vec3 {
        let led = (now.motion, now.shares, now.lead);
        let torque = self.law.render(now, &mut state.law);
        // The law can have shortened the lead of its pose.
        (now.motion, now.shares, now.lead) = led;
        // If the time stands still, the torque is only evaluated.
        if now.dt > 0.0 {
            advance(self, now, state);
        }
        match state.age {
            Some(age) => torque - now.in_n(state.impact * self.knock.at(age)),
            None => torque,
        }
    }

    fn energy(&self, now: &mut Now<'_>, state: &Self::Memory) -> Option<Real> {
        self.law.energy(now, &state.law)
    }

    fn reference(&self) -> Option<(Quat, Anchor)> {
        self.law.reference()
    }

    fn excess(&self, desired: Quat, q: Quat, numbers: &[Real]) -> Option<Real> {
        self.law.excess(desired, q, numbers)
    }

    fn places(&self, numbers: &[Real], visit: &mut dyn FnMut(Spot, Quat, Vec3, Self::Memory)) {
        self.law.places(numbers, &mut |spot, x, deeper, law| visit(spot, x, deeper, Knocked::silent(law)));
    }

    fn outline<'a>(&self, numbers: &'a [Real], visit: &mut dyn FnMut(Outline<'a>)) {
        self.law.outline(numbers, visit);
    }
}
