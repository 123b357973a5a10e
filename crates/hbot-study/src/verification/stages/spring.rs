//! Torque of a spring: the exact laws and their first-order forms.

use std::hint::black_box;

use super::hbot::render::impedance::{first_order_law, geodesic_law, quaternion_law};
use super::hbot::{Mat3, Quat, Vec3, rotation};
use super::{quaternion, vector, wide3};
use crate::timing::Timed;

/// The spring laws and their first-order forms, named as in the ids of figures.
pub(crate) const LAWS: [&str; 4] =
    ["geodesic_exact", "geodesic_first_order", "quaternion_exact", "quaternion_first_order"];

/// Stiffness of the spring about the axes of the desired frame, N m/rad. It differs between the
/// axes, because only then do the first-order forms differ from the gradient of an energy.
pub(crate) const STIFFNESS: [f64; 3] = [4.0, 2.0, 1.0];

/// Returns the torque of a spring that pulls the orientation `q` towards the identity, in frame N,
/// in N m. `law` is an index into [`LAWS`].
///
/// The geodesic and the quaternion law each have a first-order form. Both forms approximate -K
/// times the turn. That of the geodesic law is `-K log q`, which omits the Jacobian of the
/// logarithm. That of the quaternion law is `-2 K e` with the vector part e of q, which replaces
/// half the angle by its sine.
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

/// Returns the torque of a spring at the orientation `q` ([w, x, y, z]), in frame N, in N m. `law`
/// is an index into [`LAWS`].
pub(crate) fn at(law: usize, q: [f64; 4]) -> [f64; 3] {
    wide3(torque(law, quaternion(q), &stiffness()))
}

/// Prepares to measure the time of one evaluation of a spring law. `law` is an index into [`LAWS`].
pub(crate) fn timed(law: usize) -> Timed<'static> {
    let stiffness = stiffness();
    let q = rotation::exp(vector([0.3, -0.2, 0.4]));
    Timed::new(move || torque(law, black_box(q), &stiffness))
}
