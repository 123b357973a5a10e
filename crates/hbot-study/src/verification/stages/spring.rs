//! Torque of a spring: the laws, and what they are to first order.

use std::hint::black_box;

use super::hbot::impedance::{first_order_law, geodesic_law, quaternion_law};
use super::hbot::{Mat3, Quat, Vec3, rotation};
use super::{quaternion, vector, wide3};
use crate::timing::Timed;

/// The laws and their first-order forms, as ids have them.
pub(crate) const LAWS: [&str; 4] =
    ["geodesic_exact", "geodesic_first_order", "quaternion_exact", "quaternion_first_order"];

/// Stiffness about the axes of the desired frame, N m/rad; uneven, as only then the first-order forms are no springs.
pub(crate) const STIFFNESS: [f64; 3] = [4.0, 2.0, 1.0];

/// The torque in N of a spring towards the identity, by the law of that place in [`LAWS`].
///
/// To first order in the angle both are -K times the turn: `-K log q`, which leaves the Jacobian of the logarithm out, and
/// the core's `-2 K e`, which takes the sine of half the angle for half the angle.
#[inline]
fn torque(law: usize, q: Quat, stiffness: &Mat3) -> Vec3 {
    match law {
        0 => geodesic_law(Quat::IDENTITY, q, stiffness, Vec3::ZERO).0.torque,
        1 => -(*stiffness * rotation::log(q)),
        2 => quaternion_law(Quat::IDENTITY, q, stiffness).torque,
        _ => first_order_law(Quat::IDENTITY, q, stiffness).torque,
    }
}

fn stiffness() -> Mat3 {
    Mat3::from_diagonal(vector(STIFFNESS))
}

/// The torque at the orientation `q` (w, x, y, z), N m in N.
pub(crate) fn at(law: usize, q: [f64; 4]) -> [f64; 3] {
    wide3(torque(law, quaternion(q), &stiffness()))
}

/// One torque, timed.
pub(crate) fn timed(law: usize) -> Timed<'static> {
    let stiffness = stiffness();
    let q = rotation::exp(vector([0.3, -0.2, 0.4]));
    Timed::new(move || torque(law, black_box(q), &stiffness))
}
