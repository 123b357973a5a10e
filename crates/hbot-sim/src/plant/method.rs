//! Integration methods with a fixed step, with their cost and order.

use hbot_core::{Quat, Vec3, rotation};

use super::field::Field;
use super::model::{Flow, quaternion_rate};
use super::pair::Pair;
use super::{PlantState, gather, scatter};

/// A method that advances a plant by one step of h seconds.
///
/// The error over a given time falls as h to the power of the method's order. An *evaluation*
/// computes the plant's accelerations and its load once. Nearly all the cost is in evaluations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Method {
    /// Order 1, one evaluation per step. Computes new speeds from the present accelerations, then
    /// new angles from the new speeds. When it simulates a spring, its energy error stays bounded,
    /// whereas that of explicit Euler grows.
    SemiImplicitEuler,
    /// Order 2, two evaluations per step. Makes half a step to the middle, then the whole step with
    /// the rates at the middle. The orientation turns by the exponential of the angular velocity at
    /// the middle.
    Midpoint,
    /// Order 4, four evaluations per step. The classic Runge-Kutta rule on the components of the
    /// quaternion, which is normalised at the end of the step.
    #[default]
    Rk4,
    /// Order 4, four evaluations per step. The classic Runge-Kutta rule in the coordinates of the
    /// exponential map (Munthe-Kaas 1999).
    Rkmk4,
}

impl Method {
    /// All methods, in rising order of accuracy.
    pub const ALL: [Self; 4] = [Self::SemiImplicitEuler, Self::Midpoint, Self::Rk4, Self::Rkmk4];

    /// Returns the order of the method: the error is proportional to the step to this power.
    #[must_use]
    pub const fn order(self) -> u32 {
        match self {
            Self::SemiImplicitEuler => 1,
            Self::Midpoint => 2,
            Self::Rk4 | Self::Rkmk4 => 4,
        }
    }

    #[inline(always)]
    pub(super) fn step<const P: usize>(self, field: &impl Field<P>, state: &mut PlantState, t: f64, h: f64) {
        match self {
            Self::SemiImplicitEuler => semi_implicit_euler(field, state, t, h),
            Self::Midpoint => midpoint(field, state, t, h),
            Self::Rk4 => rk4(field, state, t, h),
            Self::Rkmk4 => rkmk4(field, state, t, h),
        }
    }
}

#[inline]
fn semi_implicit_euler<const P: usize>(field: &impl Field<P>, state: &mut PlantState, t: f64, h: f64) {
    let steer: [Pair; P] = gather(&state.steer);
    let geometry = field.geometry(state.q, &steer);
    let flow = field.flow(&geometry, &field.at(t), state.q, state.omega);
    let omega = state.omega + flow.acceleration * h;
    let (steer_rate, drive_rate) = field.rates(&geometry, omega);
    state.omega = omega;
    state.q = turned(state.q, omega * h);
    scatter(&along(&steer, &steer_rate, h), &mut state.steer);
    scatter(&along(&gather(&state.drive), &drive_rate, h), &mut state.drive);
}

#[inline]
fn midpoint<const P: usize>(field: &impl Field<P>, state: &mut PlantState, t: f64, h: f64) {
    let half = 0.5 * h;
    let (q, omega, steer) = (state.q, state.omega, gather::<P>(&state.steer));
    let here = field.flow(&field.geometry(q, &steer), &field.at(t), q, omega);
    let middle = (turned(q, omega * half), omega + here.acceleration * half);
    let geometry = field.geometry(middle.0, &along(&steer, &here.steer, half));
    let there = field.flow(&geometry, &field.at(t + half), middle.0, middle.1);
    state.q = turned(q, middle.1 * h);
    state.omega = omega + there.acceleration * h;
    scatter(&along(&steer, &there.steer, h), &mut state.steer);
    scatter(&along(&gather(&state.drive), &there.drive, h), &mut state.drive);
}

#[inline]
fn rk4<const P: usize, F: Field<P>>(field: &F, state: &mut PlantState, t: f64, h: f64) {
    let half = 0.5 * h;
    let (q, omega, steer) = (state.q, state.omega, gather::<P>(&state.steer));
    let look = |q: Quat, omega: Vec3, steer: &[Pair; P], now: &F::Instant| {
        (quaternion_rate(q, omega), field.flow(&field.geometry(q, steer), now, q, omega))
    };
    let stage = |k: &(Quat, Flow<P>), a: f64, now: &F::Instant| {
        look(q + k.0 * a, omega + k.1.acceleration * a, &along(&steer, &k.1.steer, a), now)
    };
    let k1 = look(q, omega, &steer, &field.at(t));
    let middle = field.at(t + half);
    let k2 = stage(&k1, half, &middle);
    let k3 = stage(&k2, half, &middle);
    let k4 = stage(&k3, h, &field.at(t + h));

    let sixth = h / 6.0;
    state.q = rotation::renormalized(q + (k1.0 + (k2.0 + k3.0) * 2.0 + k4.0) * sixth);
    finish(state, &steer, omega, &[k1.1, k2.1, k3.1, k4.1], sixth);
}

#[inline]
fn rkmk4<const P: usize, F: Field<P>>(field: &F, state: &mut PlantState, t: f64, h: f64) {
    let half = 0.5 * h;
    let (q, omega, steer) = (state.q, state.omega, gather::<P>(&state.steer));
    // u is the turn since the start of the step: q = exp(u) q0, du/dt = w - 1/2 u x w + 1/12 u x (u
    // x w) + O(u^4).
    let look = |u: Vec3, q: Quat, omega: Vec3, steer: &[Pair; P], now: &F::Instant| {
        let flow = field.flow(&field.geometry(q, steer), now, q, omega);
        let c = u.cross(omega);
        (omega - c * 0.5 + u.cross(c) * (1.0 / 12.0), flow)
    };
    let stage = |k: &(Vec3, Flow<P>), a: f64, now: &F::Instant| {
        let u = k.0 * a;
        look(u, turned(q, u), omega + k.1.acceleration * a, &along(&steer, &k.1.steer, a), now)
    };
    let k1 = look(Vec3::ZERO, q, omega, &steer, &field.at(t));
    let middle = field.at(t + half);
    let k2 = stage(&k1, half, &middle);
    let k3 = stage(&k2, half, &middle);
    let k4 = stage(&k3, h, &field.at(t + h));

    let sixth = h / 6.0;
    state.q = turned(q, (k1.0 + (k2.0 + k3.0) * 2.0 + k4.0) * sixth);
    finish(state, &steer, omega, &[k1.1, k2.1, k3.1, k4.1], sixth);
}

/// Writes the result of a step of order 4 to `state`, except for the orientation. `k1` to `k4` are
/// the accelerations and rates of the four stages.
#[inline(always)]
fn finish<const P: usize>(
    state: &mut PlantState,
    steer: &[Pair; P],
    omega: Vec3,
    [k1, k2, k3, k4]: &[Flow<P>; 4],
    sixth: f64,
) {
    let two = Pair::splat(2.0);
    state.omega =
        omega + (k1.acceleration + (k2.acceleration + k3.acceleration) * 2.0 + k4.acceleration) * sixth;
    let mean = |of: fn(&Flow<P>) -> &[Pair; P]| {
        let (k1, k2, k3, k4) = (of(k1), of(k2), of(k3), of(k4));
        core::array::from_fn(|p| k1[p] + (k2[p] + k3[p]) * two + k4[p])
    };
    scatter(&along(steer, &mean(|k| &k.steer), sixth), &mut state.steer);
    scatter(&along(&gather(&state.drive), &mean(|k| &k.drive), sixth), &mut state.drive);
}

/// Returns `q` turned by the rotation vector `turn` in frame N, rad.
#[inline(always)]
fn turned(q: Quat, turn: Vec3) -> Quat {
    rotation::renormalized(rotation::exp(turn) * q)
}

#[inline(always)]
fn along<const P: usize>(from: &[Pair; P], rate: &[Pair; P], h: f64) -> [Pair; P] {
    core::array::from_fn(|p| from[p] + rate[p] * Pair::splat(h))
}
