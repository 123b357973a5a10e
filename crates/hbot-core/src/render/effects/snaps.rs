//! Orientations into which the sphere snaps: those of a rotation group, or up to 16 given ones.
//!
//! Let c_i = x . g_i, with quaternions as vectors of four. U_i = 1 - c_i² = sin²(angle to g_i / 2)
//! is the distance from well i. The smooth minimum U = min over weights w >= 0 with sum 1 of (sum
//! w_i U_i + (r/2) sum w_i²) - r/2 is continuous, and so is its gradient sum w_i grad U_i. Only
//! wells within r of the nearest have weight. The energy is V = A w (sqrt(1 + 4 U/w²) - 1) with the
//! width w: a spring of A/w at a well, with a torque of at most A.
//!
//! If only one well has weight, the steepest way down is the straight turn to it. If two have
//! weight, V is symmetric about the plane half way between them, and no way down crosses this
//! plane. So a sphere without inertia settles in the nearest well. The exception is a rim of order
//! r around the lines at which a third well is equally near.

use super::knock::{Meets, Touched};
use super::target::Target;
use super::{Anchor, Law, Now};
use crate::real::{Quat, Real, Vec3, atan2, fabs, sqrt};
use crate::render::around::Spot;
use crate::render::outline::Outline;
use crate::rotation::{from_parts, shortest, vector_part};

/// Largest number of orientations that a scene can give to a snaps effect one by one.
pub const MAX_OWN: usize = 16;
/// Largest number of orientations in any set into which the sphere can snap.
const MAX_WELLS: usize = 60;
/// Largest number of orientations of a set that can be equally near to the sphere's orientation.
/// For the symmetry groups it is six, at a corner of the tetrahedron's cells. For orientations
/// given one by one it can be all.
const MAX_NEAR: usize = MAX_OWN;

/// The set of orientations of the sphere into which a snaps effect pulls it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub enum SnapSet {
    /// The 12 rotations that bring a tetrahedron onto itself. They include half turns about the
    /// coordinate axes.
    Tetrahedron,
    /// The 24 rotations that bring a cube onto itself. They include quarter turns about the
    /// coordinate axes.
    Cube,
    /// The 60 rotations that bring an icosahedron onto itself. They include half turns about the
    /// coordinate axes.
    Icosahedron,
    /// Orientations given one by one in the effect's table of numbers, 1 to [`MAX_OWN`]. Each is a
    /// unit quaternion `[w, x, y, z]`.
    Own,
}

/// An effect that makes the sphere snap into the nearest orientation of a set.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Snaps {
    /// Reference orientation, relative to which the orientations of the set are given.
    pub target: Target,
    /// The orientations into which the sphere can snap.
    pub set: SnapSet,
    /// Largest torque that pulls the sphere to an orientation of the set, N m.
    pub strength: Real,
    /// Width of the energy well around each orientation, rad; above 0. A smaller width makes a
    /// stiffer pull.
    pub width: Real,
    /// Rounding of the energy ridges between neighbouring orientations, dimensionless.
    /// [`Snaps::rounding`] computes a suitable value.
    pub rounding: Real,
    /// Viscous damping of the sphere, N m s/rad.
    pub damping: Real,
}

impl Snaps {
    /// Returns a suitable rounding of the energy ridges between the orientations of `set`.
    /// `figures` are the orientations given one by one for [`SnapSet::Own`].
    ///
    /// The rounding is a twentieth of the distance U between the nearest two orientations (U = sin²
    /// of half the angle between them). It is so small that the energy near the orientations
    /// themselves does not change. For the cube, the rounded ridges are 2 degrees wide.
    #[must_use]
    pub fn rounding(set: SnapSet, numbers: &[Real]) -> Real {
        let wells = Wells::new(set, numbers);
        let mut nearest: Real = 1.0;
        for i in 0..wells.all.len() {
            for j in 0..i {
                let c = dot(&wells.all[i], &wells.all[j]);
                nearest = nearest.min(1.0 - c * c);
            }
        }
        0.05 * nearest
    }

    /// Returns the orientations of the set relative to the reference. Each is a unit quaternion
    /// `[w, x, y, z]`. `numbers` are the orientations given one by one for [`SnapSet::Own`].
    #[must_use]
    pub fn orientations<'a>(&self, numbers: &'a [Real]) -> &'a [[Real; 4]] {
        Wells::new(self.set, numbers).all
    }

    /// Returns a smooth measure U of the distance from the orientation `x` to the nearest
    /// orientation of the set, and the gradient of U. U is 0 at each orientation of the set.
    #[inline]
    fn ground(&self, x: Quat, numbers: &[Real]) -> (Real, Vec3) {
        let wells = Wells::new(self.set, numbers);
        let at = [x.w, x.x, x.y, x.z];
        let mut c = [0.0; MAX_WELLS];
        let mut most: Real = 0.0;
        for i in 0..wells.all.len() {
            c[i] = dot(&at, &wells.all[i]);
            most = most.max(fabs(c[i]));
        }
        let floor = 1.0 - most * most;
        // The wells within the rounding, ascending by distance.
        let mut near: [(Real, usize); MAX_NEAR] = [(0.0, 0); MAX_NEAR];
        let mut count = 0;
        for i in 0..wells.all.len() {
            let u = 1.0 - c[i] * c[i];
            if u < floor + self.rounding && count < MAX_NEAR {
                let mut place = count;
                while place > 0 && near[place - 1].0 > u {
                    near[place] = near[place - 1];
                    place -= 1;
                }
                near[place] = (u, i);
                count += 1;
            }
        }
        // The level at which the positive weights (level - U_i)/r add up to 1.
        let (mut sum, mut level, mut used) = (0.0, 0.0, 0);
        for (k, (u, _)) in near[..count].iter().enumerate() {
            let next = (self.rounding + sum + u) / (k + 1) as Real;
            if next <= *u {
                break;
            }
            (sum, level, used) = (sum + u, next, k + 1);
        }
        let (mut energy, mut gradient) = (0.0, Vec3::ZERO);
        for (u, i) in &near[..used] {
            let weight = (level - u) / self.rounding;
            let g = wells.all[*i];
            let (w, g) = (g[0], Vec3::new(g[1], g[2], g[3]));
            energy += weight * (u + 0.5 * self.rounding * weight);
            gradient -= (g * x.w - vector_part(x) * w + vector_part(x).cross(g)) * (weight * c[*i]);
        }
        ((energy - 0.5 * self.rounding).max(0.0), gradient)
    }
}

/// The orientations of a set as quaternions. Two opposite quaternions are the same rotation, so the
/// table contains only one of them.
struct Wells<'a> {
    all: &'a [[Real; 4]],
}

impl<'a> Wells<'a> {
    fn new(set: SnapSet, numbers: &'a [Real]) -> Self {
        let all: &[[Real; 4]] = match set {
            SnapSet::Tetrahedron => &CUBE_TURNS[..12],
            SnapSet::Cube => &CUBE_TURNS,
            SnapSet::Icosahedron => &ICOSAHEDRON,
            SnapSet::Own => numbers.as_chunks().0,
        };
        Self { all: &all[..all.len().min(MAX_WELLS)] }
    }
}

#[inline]
fn dot(a: &[Real; 4], b: &[Real; 4]) -> Real {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}

const H: Real = 0.5;
#[cfg(not(feature = "f32"))]
const S: Real = core::f64::consts::FRAC_1_SQRT_2;
#[cfg(feature = "f32")]
const S: Real = core::f32::consts::FRAC_1_SQRT_2;

/// The rotations that bring a cube onto itself, as quaternions `[w, x, y, z]`. The first half of
/// the table holds the rotations that also bring a tetrahedron onto itself.
const CUBE: [[Real; 4]; 24] = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 1.0],
    [H, H, H, H],
    [H, H, H, -H],
    [H, H, -H, H],
    [H, H, -H, -H],
    [H, -H, H, H],
    [H, -H, H, -H],
    [H, -H, -H, H],
    [H, -H, -H, -H],
    [S, S, 0.0, 0.0],
    [S, -S, 0.0, 0.0],
    [S, 0.0, S, 0.0],
    [S, 0.0, -S, 0.0],
    [S, 0.0, 0.0, S],
    [S, 0.0, 0.0, -S],
    [0.0, S, S, 0.0],
    [0.0, S, -S, 0.0],
    [0.0, S, 0.0, S],
    [0.0, S, 0.0, -S],
    [0.0, 0.0, S, S],
    [0.0, 0.0, S, -S],
];

static CUBE_TURNS: [[Real; 4]; 24] = CUBE;

/// The rotations that bring an icosahedron onto itself, as quaternions `[w, x, y, z]`. They are the
/// rotations of the tetrahedron, and the even permutations of (phi, +-1, +-1/phi, 0)/2 with phi the
/// golden ratio.
static ICOSAHEDRON: [[Real; 4]; 60] = icosahedron();

const fn icosahedron() -> [[Real; 4]; 60] {
    #[allow(clippy::excessive_precision, reason = "f64 has the digits that f32 has not")]
    const PHI: Real = 1.618_033_988_749_895;
    const EVEN: [[usize; 4]; 12] = [
        [0, 1, 2, 3],
        [0, 2, 3, 1],
        [0, 3, 1, 2],
        [1, 0, 3, 2],
        [1, 2, 0, 3],
        [1, 3, 2, 0],
        [2, 0, 1, 3],
        [2, 1, 3, 0],
        [2, 3, 0, 1],
        [3, 0, 2, 1],
        [3, 1, 0, 2],
        [3, 2, 1, 0],
    ];
    let mut all = [[0.0; 4]; 60];
    let mut i = 0;
    while i < 12 {
        all[i] = CUBE[i];
        i += 1;
    }
    while i < 60 {
        let places = EVEN[(i - 12) / 4];
        let second = if i % 2 == 0 { H } else { -H };
        let third = if i % 4 < 2 { H } else { -H };
        all[i][places[0]] = H * PHI;
        all[i][places[1]] = second;
        all[i][places[2]] = third * (PHI - 1.0);
        i += 1;
    }
    all
}

impl Meets for Snaps {
    /// An orientation is touched within half of the width of its well, and left beyond its width.
    fn touched(&self, now: &mut Now<'_>, (): &(), held: [u16; 2]) -> [Option<Touched>; 2] {
        let x = now.relative();
        let at = [x.w, x.x, x.y, x.z];
        let (mut most, mut nearest): (Real, usize) = (-1.0, 0);
        let wells = Wells::new(self.set, now.numbers);
        for (i, well) in wells.all.iter().enumerate() {
            let c = fabs(dot(&at, well));
            if c > most {
                (most, nearest) = (c, i);
            }
        }
        let Some(well) = wells.all.get(nearest) else { return [None; 2] };
        let [w, gx, gy, gz] = *well;
        // The turn from the sphere's orientation to the orientation of the well.
        let left = shortest(from_parts(w, Vec3::new(gx, gy, gz)) * x.conjugate());
        let way = vector_part(left);
        let angle = 2.0 * atan2(sqrt(way.length_squared()), left.w);
        let place = nearest as u16 + 1;
        let reach = if held[0] == place { self.width } else { 0.5 * self.width };
        [(angle < reach).then_some(Touched { place, way }), None]
    }
}

impl Law for Snaps {
    type Memory = ();

    #[inline]
    fn render(&self, now: &mut Now<'_>, (): &mut ()) -> Vec3 {
        let x = now.relative();
        let (u, gradient) = self.ground(x, now.numbers);
        let slope = 2.0 * self.strength / (self.width * sqrt(1.0 + 4.0 * u / (self.width * self.width)));
        let mut torque = gradient * -slope;
        if self.damping > 0.0 {
            torque -= now.rate() * self.damping;
        }
        now.in_n(torque)
    }

    fn energy(&self, now: &mut Now<'_>, (): &()) -> Option<Real> {
        let x = now.relative();
        let (u, _) = self.ground(x, now.numbers);
        Some(self.strength * self.width * (sqrt(1.0 + 4.0 * u / (self.width * self.width)) - 1.0))
    }

    fn reference(&self) -> Option<(Quat, Anchor)> {
        Some(self.target.reference())
    }

    fn places(&self, numbers: &[Real], visit: &mut dyn FnMut(Spot, Quat, Vec3, ())) {
        // All wells are alike.
        if let Some([w, x, y, z]) = self.orientations(numbers).first() {
            visit(Spot::Notch, from_parts(*w, Vec3::new(*x, *y, *z)), Vec3::ZERO, ());
        }
    }

    fn outline<'a>(&self, numbers: &'a [Real], visit: &mut dyn FnMut(Outline<'a>)) {
        for [w, x, y, z] in self.orientations(numbers) {
            visit(Outline::Snap(from_parts(*w, Vec3::new(*x, *y, *z))));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that each table of rotations is a group: the product of any two rotations is in the
    /// table exactly once.
    #[test]
    fn the_tables_are_groups() {
        for (set, order, nearest) in [
            (SnapSet::Tetrahedron, 12, 0.75),
            (SnapSet::Cube, 24, 0.5),
            (SnapSet::Icosahedron, 60, 0.345_491_5),
        ] {
            let all = Wells::new(set, &[]).all;
            assert_eq!(all.len(), order);
            let quat = |g: &[Real; 4]| Quat::from_xyzw(g[1], g[2], g[3], g[0]);
            for a in all {
                assert!(fabs(dot(a, a) - 1.0) < 8.0 * Real::EPSILON);
                for b in all {
                    let product = quat(a) * quat(b);
                    let same = all.iter().filter(|g| fabs(product.dot(quat(g))) > 0.999).count();
                    assert_eq!(same, 1, "{set:?}: {product}");
                }
            }
            // sin² of 60, 45 and 36 degrees: half of the angle between the nearest two wells.
            assert!(fabs(Snaps::rounding(set, &[]) - 0.05 * nearest) < 1.0e-6);
        }
    }
}
