//! Computes the orientation of the sphere from joint angles. It is integrated, because the
//! mechanism is non-holonomic (physics notes, section 4).

use crate::count::Count;
use crate::design::device::{Device, MAX_JOINTS};
use crate::design::kinematics::{ContactFrame, Fit};
use crate::design::rig::OdometryMethod;
use crate::motion::path::Path;
use crate::real::{Quat, Real, Vec3};
use crate::rotation;

/// sqrt(3)/6: distance of the two Gauss points from the middle of an integration step of length 1.
#[allow(clippy::excessive_precision, reason = "an f32 rounds it")]
const ROOT3_6: Real = 0.288_675_134_594_812_9;
/// sqrt(3)/12: factor of the cross product in the Magnus expansion of order 4.
#[allow(clippy::excessive_precision, reason = "an f32 rounds it")]
const ROOT3_12: Real = 0.144_337_567_297_406_44;

/// Returns how far the sphere turns in frame N, as a rotation vector (rad), if all joints move at
/// constant rates. The joints begin at the steer angles `th` (one per wheel, rad) and move by
/// `delta` (steer, drive of each wheel, rad).
///
/// The error of the method falls with the n-th power of the step length. n is 1 for
/// [`OdometryMethod::Euler`], 2 for [`Midpoint`](OdometryMethod::Midpoint) and 4 for
/// [`Magnus4`](OdometryMethod::Magnus4) (Magnus expansion on two Gauss points; Iserles and Norsett
/// 1999).
#[inline]
#[must_use]
pub fn turn(device: &Device, method: OdometryMethod, th: &[Real], delta: &[Real]) -> Vec3 {
    turn_of(device.count(), device, method, th, delta)
}

/// Implements [`turn`] for a device with `count` wheels.
#[inline(always)]
pub(crate) fn turn_of<C: Count>(
    count: C,
    device: &Device,
    method: OdometryMethod,
    th: &[Real],
    delta: &[Real],
) -> Vec3 {
    let part = match method {
        OdometryMethod::Euler => 0.0,
        OdometryMethod::Midpoint => 0.5,
        OdometryMethod::Magnus4 => return magnus_turn(count, device, th, delta),
    };
    turn_at(count, device, th, delta, part)
}

/// Returns the turn of [`turn`] by the Magnus expansion. It is a separate function, so that it
/// costs nothing if the rig uses another method.
#[inline(never)]
fn magnus_turn<C: Count>(count: C, device: &Device, th: &[Real], delta: &[Real]) -> Vec3 {
    let first = turn_at(count, device, th, delta, 0.5 - ROOT3_6);
    let second = turn_at(count, device, th, delta, 0.5 + ROOT3_6);
    magnus(first, second)
}

/// Returns the orientation that `q` becomes after a `turn` (rotation vector in frame N, rad):
/// exp(turn) q, normalised to unit length.
///
/// In f32 the turn's change is added to `q`, because the rounding errors of a product of
/// quaternions would add up. In f64 they are a billion times smaller, so the product is taken,
/// and outputs keep their bits (docs/accuracy.md).
#[inline(always)]
#[must_use]
pub fn advance(q: Quat, turn: Vec3) -> Quat {
    if Real::EPSILON < 1.0e-10 {
        rotation::turned_by_product(q, turn)
    } else {
        rotation::turned_by_change(q, turn)
    }
}

/// Returns the turn of the sphere over one step by the Magnus expansion. `first` and `second` are
/// the turns that would result if the rates at the step's first or second Gauss point lasted for
/// the whole step.
#[inline]
fn magnus(first: Vec3, second: Vec3) -> Vec3 {
    (first + second) * 0.5 - first.cross(second) * ROOT3_12
}

/// Returns how far the sphere turns in frame N, as a rotation vector (rad), if the joints move
/// along `path`. The joints begin at the steer angles `th` (one per wheel, rad).
///
/// The contact frames are those at the angles of the path. [`Magnus4`](OdometryMethod::Magnus4)
/// also uses the rates of the path at its two Gauss points, so its order is that of the path: 3 for
/// a quadratic, 4 for a cubic. The other methods use the measured change of the joint angles and
/// keep their own orders. A curved path changes the result of
/// [`Midpoint`](OdometryMethod::Midpoint), because the steer angles in mid-step change. It does not
/// change the result of [`Euler`](OdometryMethod::Euler).
#[inline]
#[must_use]
pub fn turn_along(device: &Device, method: OdometryMethod, th: &[Real], path: &Path) -> Vec3 {
    match method {
        OdometryMethod::Euler => turn_at(device.count(), device, th, path.delta(), 0.0),
        OdometryMethod::Midpoint => forward_along(device, th, path, 0.5, path.delta()),
        OdometryMethod::Magnus4 => {
            let point = |s: Real| {
                let mut rate = [0.0; MAX_JOINTS];
                for (j, rate) in rate[..device.joints()].iter_mut().enumerate() {
                    *rate = path.rate(j, s);
                }
                forward_along(device, th, path, s, &rate)
            };
            magnus(point(0.5 - ROOT3_6), point(0.5 + ROOT3_6))
        }
    }
}

/// Returns how far the sphere turns in frame N, as a rotation vector (rad), if the joints move by
/// `delta` (rad) and the contact frames are constant. They are those at the point `s` (0 to 1) of
/// `path`, which begins at the steer angles `th` (rad).
#[inline]
fn forward_along(device: &Device, th: &[Real], path: &Path, s: Real, delta: &[Real]) -> Vec3 {
    let mut fit = Fit::EMPTY;
    for (i, wheel) in device.wheels().iter().enumerate() {
        let frame = ContactFrame::at(wheel, th[i] + path.turned(2 * i, s));
        fit.add(device, wheel, &frame, [delta[2 * i], delta[2 * i + 1]]);
    }
    fit.omega(device)
}

/// Returns how far the sphere turns in frame N, as a rotation vector (rad), if the contact frames
/// are constant. They are those at the fraction `part` (0 to 1) of the step.
#[inline(always)]
fn turn_at<C: Count>(count: C, device: &Device, th: &[Real], delta: &[Real], part: Real) -> Vec3 {
    let mut fit = Fit::EMPTY;
    for (i, wheel) in device.first(count).iter().enumerate() {
        let frame = ContactFrame::at(wheel, th[i] + part * delta[2 * i]);
        fit.add(device, wheel, &frame, [delta[2 * i], delta[2 * i + 1]]);
    }
    fit.omega(device)
}
