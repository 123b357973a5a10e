//! The three singularity margins, and whether a design can become singular (physics notes, section 3).

use crate::device::{Device, MAX_JOINTS, Wheel};
use crate::kinematics::Posture;
use crate::linear;
use crate::real::{PI, Real, Vec3, acos, cos, fabs, sincos, sqrt};

/// How two contact points come to lie on one line through the sphere's centre.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meeting {
    /// At the same point: the wheels themselves collide as well.
    Collocated,
    /// At opposite points of the sphere.
    Antipodal,
}

/// Angles closer than this count as touching; above the rounding of a sum of four angles.
const TOUCH: Real = 32.0 * Real::EPSILON;

/// det H of a wheel, m²: r R sin a cos b, a constant of the design (boundary singularity where zero).
#[must_use]
pub fn boundary_determinant(device: &Device, wheel: &Wheel) -> Real {
    wheel.spec().radius * device.sphere_radius() * wheel.axis_along_roll()
}

/// The interior margin sigma_min(Z)/R at a posture: sqrt of the least eigenvalue of sum (I - c3 c3ᵀ); 0 where
/// all contact points lie on one line through the centre.
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

/// The least interior margin over all steering angles: exact for two wheels, sqrt(1 - cos g) with g the closest that the
/// contact points or their antipodes come; for more wheels the best pair's, which the true one is not below.
#[must_use]
pub fn interior_margin_over_all(device: &Device) -> Real {
    let mut best: Real = 0.0;
    for_each_pair(device, |_, _, a, b| {
        let gap = Real::min(
            closest_approach(a, b, Meeting::Collocated),
            closest_approach(a, b, Meeting::Antipodal),
        );
        // sqrt(1 - cos gap) without the cancellation.
        best = best.max(sqrt(2.0) * sincos(0.5 * gap).0);
    });
    best
}

/// The actuation margin at a posture: sigma_min / sigma_max of the rows of G that have a motor (`driven`, one flag
/// a joint). 0 where the motors cannot make every torque.
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

/// The closest that two contact points (or one and the other's antipode) come over all steering angles, rad; 0 where
/// they can meet.
#[must_use]
pub fn closest_approach(a: &Wheel, b: &Wheel, meeting: Meeting) -> Real {
    let dot = a.spec().axis.dot(b.spec().axis).clamp(-1.0, 1.0);
    let between = match meeting {
        Meeting::Collocated => acos(dot),
        Meeting::Antipodal => acos(-dot),
    };
    let (ca, cb) = (a.spec().cone, b.spec().cone);
    // Apart, nested, or nested around the far side.
    let gap = (between - ca - cb).max(fabs(ca - cb) - between).max(ca + cb + between - 2.0 * PI);
    gap.max(0.0)
}

/// Two wheels through which the whole design can become singular, if it can: some line through the centre is met by the
/// contact circles (or their antipodes) of all wheels. Exact for any number of wheels.
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

/// Whether some unit u has u.l = +-cos a for every wheel. The candidates are where the circles of one pair cross.
fn common_line(device: &Device) -> bool {
    let wheels = device.wheels();
    let on_circle = |u: Vec3, w: &Wheel| fabs(fabs(u.dot(w.spec().axis)) - fabs(cos(w.spec().cone)));
    let mut found = false;
    let mut crossed = false;
    for_each_pair(device, |_, _, a, b| {
        let (la, lb) = (a.spec().axis, b.spec().axis);
        let normal = la.cross(lb);
        let n2 = normal.length_squared();
        // Parallel axes: their circles are the same or never meet; another pair tells more.
        if crossed || n2 < 1.0e-12 {
            return;
        }
        crossed = true;
        let dot = la.dot(lb);
        for sign in [1.0, -1.0] {
            let (ha, hb) = (cos(a.spec().cone), sign * cos(b.spec().cone));
            let base = (la * (ha - dot * hb) + lb * (hb - dot * ha)) / n2;
            let rest = 1.0 - base.length_squared();
            if rest < -TOUCH {
                continue;
            }
            let along = normal * sqrt(rest.max(0.0) / n2);
            for u in [base + along, base - along] {
                // Near a tangency an error of rounding in the angles moves the point by its square root.
                found |= wheels.iter().all(|w| on_circle(u, w) <= sqrt(TOUCH));
            }
        }
    });
    // All axes parallel and no safe pair: all circles are one.
    found || !crossed
}

fn for_each_pair(device: &Device, mut each: impl FnMut(usize, usize, &Wheel, &Wheel)) {
    let wheels = device.wheels();
    for (j, b) in wheels.iter().enumerate() {
        for (i, a) in wheels[..j].iter().enumerate() {
            each(i, j, a, b);
        }
    }
}

/// Measures of how evenly a set of joints can turn the sphere (physics notes, section 10).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Indices {
    /// sigma_min / sigma_max of G, 0 to 1.
    pub spectral: Real,
    /// 3 / sqrt(sum sigma² sum sigma⁻²), 0 to 1 (paper eq. 17-18 with W = I/3).
    pub frobenius: Real,
    /// 1 / (sigma_1 sigma_2 sigma_3); infinite where singular.
    pub manipulability: Real,
}

impl Indices {
    /// The indices of the rows of G, `2n x 3` or a part of them.
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

/// The singular values of an m x 3 matrix given by rows, largest first, by one-sided Jacobi rotations, which are
/// accurate even for the least one (Demmel and Veselic 1992). At most [`MAX_JOINTS`] rows.
#[must_use]
pub fn singular_values(rows: &[Vec3]) -> [Real; 3] {
    linear::principal(&rows[..rows.len().min(MAX_JOINTS)], [Vec3::X, Vec3::Y, Vec3::Z]).0
}
