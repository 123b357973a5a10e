//! The three singularity margins, and the check whether a design can become singular (physics
//! notes, section 3).

use crate::design::device::{Device, MAX_JOINTS, Wheel};
use crate::design::kinematics::Posture;
use crate::linear;
use crate::real::{PI, Real, Vec3, acos, cos, fabs, sincos, sqrt};

/// The way in which two wheels' contact points come to lie on one line through the sphere's centre.
/// If all contact points lie on such a line, the design is singular.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meeting {
    /// The two contact points coincide. The wheels would also collide there.
    Collocated,
    /// The two contact points lie at opposite points of the sphere.
    Antipodal,
}

/// Largest angle between two contact points at which they count as meeting, rad. It allows for the
/// rounding of a sum of four angles.
const TOUCH: Real = 32.0 * Real::EPSILON;

/// Returns the determinant of the matrix H of `wheel`, r R sin a cos b, in m². H maps the wheel's
/// joint rates to the velocity of its contact point. If this constant of the design is zero, the
/// design has a boundary singularity.
#[must_use]
pub fn boundary_determinant(device: &Device, wheel: &Wheel) -> Real {
    wheel.spec().radius * device.sphere_radius() * wheel.axis_along_roll()
}

/// Returns how far a posture is from the interior singularity, at which all contact points lie on
/// one line through the sphere's centre. The value is sigma_min(Z)/R, dimensionless, and 0 at the
/// singularity. It equals the square root of the smallest eigenvalue of sum (I - c3 c3ᵀ).
#[must_use]
pub fn interior_margin(posture: &Posture) -> Real {
    // The rows of Z/R are -c2 and c1 of each wheel.
    let mut rows = [Vec3::ZERO; MAX_JOINTS];
    for (i, frame) in posture.frames().iter().enumerate() {
        rows[2 * i] = -frame.c2;
        rows[2 * i + 1] = frame.c1;
    }
    singular_values(&rows[..2 * posture.frames().len()])[2]
}

/// Returns the smallest value of [`interior_margin`] over all steer angles.
///
/// For two wheels the result is exact: sqrt(1 - cos g). Here g is the smallest angle between the
/// two contact points, or between one contact point and the point opposite to the other. For more
/// wheels the result is that of the best pair of wheels, which is a lower bound.
#[must_use]
pub fn interior_margin_over_all(device: &Device) -> Real {
    let mut best: Real = 0.0;
    for_each_pair(device, |_, _, a, b| {
        let gap = Real::min(
            closest_approach(a, b, Meeting::Collocated),
            closest_approach(a, b, Meeting::Antipodal),
        );
        // sqrt(1 - cos gap), without cancellation.
        best = best.max(sqrt(2.0) * sincos(0.5 * gap).0);
    });
    best
}

/// Returns how evenly the motors can turn the sphere at a posture: sigma_min / sigma_max of the
/// rows of G that belong to a joint with a motor. `driven` has one flag per joint, true if it has a
/// motor. The result is 0 if the motors cannot make torque in every direction.
#[must_use]
pub fn actuation_margin(posture: &Posture, driven: &[bool]) -> Real {
    let mut rows = [Vec3::ZERO; MAX_JOINTS];
    let mut n = 0;
    for (row, _) in posture.rows().iter().zip(driven).filter(|(_, has)| **has) {
        rows[n] = *row;
        n += 1;
    }
    Indices::of(&rows[..n]).spectral
}

/// Returns the smallest angle between the contact points of two wheels over all steer angles, rad.
/// It is 0 if the points can meet. For [`Meeting::Antipodal`], it is the angle between one contact
/// point and the point opposite to the other.
#[must_use]
pub fn closest_approach(a: &Wheel, b: &Wheel, meeting: Meeting) -> Real {
    let dot = a.spec().axis.dot(b.spec().axis).clamp(-1.0, 1.0);
    let between = match meeting {
        Meeting::Collocated => acos(dot),
        Meeting::Antipodal => acos(-dot),
    };
    let (ca, cb) = (a.spec().cone, b.spec().cone);
    // Either the circles are apart, or one is inside the other, or one is around the far side of
    // the other.
    let gap = (between - ca - cb).max(fabs(ca - cb) - between).max(ca + cb + between - 2.0 * PI);
    gap.max(0.0)
}

/// Checks whether the contact points of all wheels can come to lie on one line through the sphere's
/// centre, which makes the design singular. Returns two of the wheels and the way in which their
/// contact points meet, or `None` if the design cannot become singular.
///
/// Over all steer angles, the contact point of each wheel moves on a circle. The design can become
/// singular if some line through the centre meets the circles of all wheels, or their mirror images
/// through the centre. The check is exact for any number of wheels.
pub(crate) fn interior_singularity(device: &Device) -> Option<([usize; 2], Meeting)> {
    let mut worst = None;
    let mut safe = false;
    for_each_pair(device, |i, j, a, b| {
        let meeting = [Meeting::Collocated, Meeting::Antipodal]
            .into_iter()
            .find(|meeting| closest_approach(a, b, *meeting) <= TOUCH);
        match meeting {
            None => safe = true,
            Some(meeting) => {
                if worst.is_none() {
                    worst = Some(([i, j], meeting));
                }
            }
        }
    });
    if safe || (device.wheels().len() > 2 && !common_line(device)) { None } else { worst }
}

/// Returns true if one line through the sphere's centre meets the contact circles of all wheels.
/// This means that a unit vector u satisfies u.l = +-cos a for every wheel, with its steer axis l
/// and cone angle a. The function tries the points at which the circles of one pair of wheels
/// cross. It takes the pair whose axes are farthest from parallel, because there a rounding error
/// of the axes moves these points least.
fn common_line(device: &Device) -> bool {
    let wheels = device.wheels();
    let on_circle = |u: Vec3, w: &Wheel| fabs(fabs(u.dot(w.spec().axis)) - fabs(cos(w.spec().cone)));
    let (mut pair, mut n2) = ([0, 0], 0.0);
    for_each_pair(device, |i, j, a, b| {
        let this = a.spec().axis.cross(b.spec().axis).length_squared();
        if this > n2 {
            (pair, n2) = ([i, j], this);
        }
    });
    // All axes are parallel and no pair is safe, so all circles are equal.
    if n2 < 1.0e-12 {
        return true;
    }
    let [a, b] = pair.map(|i| wheels[i].spec());
    let (normal, dot) = (a.axis.cross(b.axis), a.axis.dot(b.axis));
    [1.0, -1.0].into_iter().any(|sign| {
        let (ha, hb) = (cos(a.cone), sign * cos(b.cone));
        let base = (a.axis * (ha - dot * hb) + b.axis * (hb - dot * ha)) / n2;
        let rest = 1.0 - base.length_squared();
        let along = normal * sqrt(rest.max(0.0) / n2);
        // Near a tangency a rounding error of the angles moves the point by the square root of the
        // error.
        rest >= -TOUCH
            && [base + along, base - along]
                .iter()
                .any(|u| wheels.iter().all(|w| on_circle(*u, w) <= sqrt(TOUCH)))
    })
}

fn for_each_pair(device: &Device, mut each: impl FnMut(usize, usize, &Wheel, &Wheel)) {
    let wheels = device.wheels();
    for (j, b) in wheels.iter().enumerate() {
        for (i, a) in wheels[..j].iter().enumerate() {
            each(i, j, a, b);
        }
    }
}

/// Measures of how evenly a set of joints can turn the sphere, from the singular values sigma of
/// their rows of G (physics notes, section 10).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Indices {
    /// Spectral index: sigma_min / sigma_max, 0 to 1.
    pub spectral: Real,
    /// Frobenius index: 3 / sqrt(sum sigma² sum sigma⁻²), 0 to 1 (paper eq. 17-18 with W = I/3).
    pub frobenius: Real,
    /// Manipulability: 1 / (sigma_1 sigma_2 sigma_3). Infinite at a singularity.
    pub manipulability: Real,
}

impl Indices {
    /// Computes the indices from `rows`: all rows of G (2n x 3), or some of them.
    #[must_use]
    pub fn of(rows: &[Vec3]) -> Self {
        let [a, b, c] = singular_values(rows);
        if !(c > 0.0) {
            return Self { spectral: 0.0, frobenius: 0.0, manipulability: Real::INFINITY };
        }
        let squares = a * a + b * b + c * c;
        let inverse = 1.0 / (a * a) + 1.0 / (b * b) + 1.0 / (c * c);
        Self { spectral: c / a, frobenius: 3.0 / sqrt(squares * inverse), manipulability: 1.0 / (a * b * c) }
    }
}

/// Returns the three singular values, in descending order, of the matrix with the given rows. Only
/// the first [`MAX_JOINTS`] rows are used.
///
/// Uses one-sided Jacobi rotations, because they are accurate even for the smallest singular value
/// (Demmel and Veselic 1992).
#[must_use]
pub fn singular_values(rows: &[Vec3]) -> [Real; 3] {
    linear::principal(&rows[..rows.len().min(MAX_JOINTS)], [Vec3::X, Vec3::Y, Vec3::Z]).0
}
