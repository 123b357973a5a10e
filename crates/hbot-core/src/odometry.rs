//! Orientation from joint angles: integrated, because the mechanism is non-holonomic (physics notes, section 4).

use crate::device::{Device, MAX_JOINTS, MAX_WHEELS};
use crate::kinematics::{ContactFrame, forward};
use crate::path::Path;
use crate::real::{Quat, Real, Vec3};
use crate::rig::OdometryMethod;
use crate::rotation::{self, renormalized};

/// sqrt(3)/6, how far the Gauss points lie from the middle.
#[allow(clippy::excessive_precision, reason = "an f32 rounds it")]
const ROOT3_6: Real = 0.288_675_134_594_812_9;
/// sqrt(3)/12.
#[allow(clippy::excessive_precision, reason = "an f32 rounds it")]
const ROOT3_12: Real = 0.144_337_567_297_406_44;

/// The turn of the sphere in N, as a rotation vector (rad), while the joints move at constant rates from the
/// steering angles `th` (one a wheel, rad) by `delta` (steer, drive of each wheel, rad).
///
/// Orders per step: [`OdometryMethod::Euler`] 1, [`Midpoint`](OdometryMethod::Midpoint) 2,
/// [`Magnus4`](OdometryMethod::Magnus4) 4 (Magnus expansion on two Gauss points; Iserles and Norsett 1999).
#[inline]
#[must_use]
pub fn turn(device: &Device, method: OdometryMethod, th: &[Real], delta: &[Real]) -> Vec3 {
    match method {
        OdometryMethod::Euler => turn_at(device, th, delta, 0.0),
        OdometryMethod::Midpoint => turn_at(device, th, delta, 0.5),
        OdometryMethod::Magnus4 => {
            let first = turn_at(device, th, delta, 0.5 - ROOT3_6);
            let second = turn_at(device, th, delta, 0.5 + ROOT3_6);
            magnus(first, second)
        }
    }
}

/// The orientation after the turn: exp(turn) q, kept unit.
#[inline]
#[must_use]
pub fn advance(q: Quat, turn: Vec3) -> Quat {
    renormalized(rotation::exp(turn) * q)
}

/// The turn over a step from the turns that it would make at the rates of its two Gauss points.
#[inline]
fn magnus(first: Vec3, second: Vec3) -> Vec3 {
    (first + second) * 0.5 - first.cross(second) * ROOT3_12
}

/// The contact frames where the path is at `s`.
#[inline]
fn frames_along(device: &Device, th: &[Real], path: &Path, s: Real) -> [ContactFrame; MAX_WHEELS] {
    let mut frames = [ContactFrame::default(); MAX_WHEELS];
    for (i, wheel) in device.wheels().iter().enumerate() {
        frames[i] = ContactFrame::at(wheel, th[i] + path.turned(2 * i, s));
    }
    frames
}

/// The turn of the sphere in N, as a rotation vector (rad), while the joints go along `path` from the steering angles `th`
/// (one a wheel, rad).
///
/// The frames are those of the path's angles. [`Magnus4`](OdometryMethod::Magnus4) takes the path's rates at its two
/// points as well; the turn then is as good as the path: of order 3 for a quadratic, 4 for a cubic one. The other two
/// take the turn of the joints that was measured, so that none of it is lost, and keep their orders: in
/// [`Midpoint`](OdometryMethod::Midpoint) a curved path moves the mid angles, in [`Euler`](OdometryMethod::Euler) it changes nothing.
#[inline]
#[must_use]
pub fn turn_along(device: &Device, method: OdometryMethod, th: &[Real], path: &Path) -> Vec3 {
    match method {
        OdometryMethod::Euler => turn_at(device, th, path.delta(), 0.0),
        OdometryMethod::Midpoint => {
            forward(device, &frames_along(device, th, path, 0.5)[..device.wheels().len()], path.delta())
        }
        OdometryMethod::Magnus4 => {
            let point = |s: Real| {
                let mut rate = [0.0; MAX_JOINTS];
                for (j, rate) in rate[..device.joints()].iter_mut().enumerate() {
                    *rate = path.rate(j, s);
                }
                forward(device, &frames_along(device, th, path, s)[..device.wheels().len()], &rate)
            };
            magnus(point(0.5 - ROOT3_6), point(0.5 + ROOT3_6))
        }
    }
}

/// The turn with the contact frames of one moment, `part` of the way through the step.
#[inline]
fn turn_at(device: &Device, th: &[Real], delta: &[Real], part: Real) -> Vec3 {
    let mut frames = [ContactFrame::default(); MAX_WHEELS];
    for (i, wheel) in device.wheels().iter().enumerate() {
        frames[i] = ContactFrame::at(wheel, th[i] + part * delta[2 * i]);
    }
    forward(device, &frames[..device.wheels().len()], delta)
}
