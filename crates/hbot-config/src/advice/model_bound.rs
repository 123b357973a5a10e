//! Which local models of clients a loop keeps stable: a bound that costs microseconds, because a
//! client can send a model in every tick.
//!
//! Let v be a unit vector, complex in general, that swings in the loop with a model of the
//! stiffness K and the damping D. It sees the loop of one axis with the stiffness k = v*K v and the
//! damping b = v*D v, and with an inertia no smaller than the smallest one. So if every such pair
//! (k, b) is in the stable region of one axis, the loop of three axes is stable. The region is cut
//! off to a convex polygon within it: k <= c + s b for some lines. All pairs are on one side of a
//! line if the largest eigenvalue of K - s D is at most c.
//!
//! Half-spaces count as entered where they make it worse. Two that face each other count one at a
//! time, since the sphere cannot be in both.

use hbot_core::render::model::{HalfSpace, LocalModel};
use hbot_core::{Mat3, Vec3};

use super::StiffnessBound;

/// A model has to be stable with its stiffness times this, as a scene.
const MARGIN: f64 = 1.1;
/// Number of dampings at which the border is taken.
const SAMPLES: usize = 24;
/// Cosine beyond which two normals count as opposite.
const OPPOSITE: f64 = -0.99;

/// The models that a loop keeps stable.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelBound {
    /// Damping (N m s/rad) and largest stiffness (N m/rad) at the corners of the region, from small
    /// to large damping.
    corners: Vec<[f64; 2]>,
}

/// Why a model is not stable, at the axis about which it is worst.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnstableModel {
    /// Axis in frame N, a unit vector.
    pub axis: Vec3,
    /// Stiffness about the axis, N m/rad, with the half-spaces that count.
    pub stiffness: f64,
    /// Damping about the axis, N m s/rad, with the half-spaces that count.
    pub damping: f64,
    /// Largest stiffness that is stable with this damping, N m/rad. 0 if none is.
    pub stable: f64,
    /// Largest damping that is stable with any stiffness, N m s/rad.
    pub most_damping: f64,
}

impl ModelBound {
    /// Computes the bound from the border of springs about one axis.
    #[must_use]
    pub fn new(springs: &StiffnessBound) -> Self {
        let most = springs.most_damping().min(1.0e6) / MARGIN;
        let [_, best] = springs.most();
        // Close together where the border rises and near its top.
        let at = |k: usize| most * (k as f64 / (SAMPLES - 1) as f64).powi(2);
        let mut dampings: Vec<f64> = (0..SAMPLES).map(at).chain([best]).collect();
        dampings.sort_by(f64::total_cmp);
        let points: Vec<[f64; 2]> = dampings.iter().map(|b| [*b, springs.stable(*b) / MARGIN]).collect();
        let hull = upper_hull(&points);
        // The border bends outwards nearly everywhere. Where it does not, all of it is lowered.
        let part = points.iter().map(|[b, k]| {
            let of = height(&hull, *b);
            if of > 1.0e-9 { k / of } else { 1.0 }
        });
        let part = part.fold(1.0, f64::min);
        Self { corners: hull.into_iter().map(|[b, k]| [b, k * part]).collect() }
    }

    /// Returns the largest stiffness that is allowed with the damping `damping` (N m s/rad) about
    /// the same axis, N m/rad. 0 if no stiffness is.
    #[must_use]
    pub fn stable(&self, damping: f64) -> f64 {
        height(&self.corners, damping)
    }

    /// Checks a model.
    ///
    /// # Errors
    /// Fails if the loop may not keep it stable.
    pub fn check(&self, model: &LocalModel) -> Result<(), UnstableModel> {
        let mut worst: Option<(f64, UnstableModel)> = None;
        for ([slope, most], planes) in self.lines().map(|line| (line, entered(model.planes(), line[0]))) {
            let (mut stiffness, mut damping) = (model.stiffness, model.damping);
            for plane in planes.iter().flatten() {
                let outer = outer(plane.normal);
                stiffness += outer * plane.stiffness;
                damping += outer * plane.damping;
            }
            let sum = stiffness - damping * slope;
            let excess = largest_eigenvalue(&sum) - most;
            let scale =
                1.0e-9 * (most.abs() + sum.x_axis.length() + sum.y_axis.length() + sum.z_axis.length());
            if excess > scale && worst.as_ref().is_none_or(|(before, _)| excess > *before) {
                let axis = eigenvector(&sum, excess + most);
                let damping = axis.dot(damping * axis);
                let [[most_damping, _], ..] = self.corners[self.corners.len() - 1..] else { continue };
                let found = UnstableModel {
                    axis,
                    stiffness: axis.dot(stiffness * axis),
                    damping,
                    stable: self.stable(damping),
                    most_damping,
                };
                worst = Some((excess, found));
            }
        }
        worst.map_or(Ok(()), |(_, found)| Err(found))
    }

    /// Returns the largest fraction of its stiffness, 0 to 1, with which `model` is stable.
    ///
    /// # Errors
    /// Fails if its damping alone is not.
    pub fn softened(&self, model: &LocalModel) -> Result<f64, UnstableModel> {
        let at = |part: f64| {
            let mut soft = *model;
            soft.soften(part);
            self.check(&soft)
        };
        if at(1.0).is_ok() {
            return Ok(1.0);
        }
        at(0.0)?;
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..20 {
            let middle = 0.5 * (low + high);
            if at(middle).is_ok() { low = middle } else { high = middle }
        }
        Ok(low)
    }

    /// Returns slope s (1/s) and height c (N m/rad) of each line k = c + s b around the region.
    fn lines(&self) -> impl Iterator<Item = [f64; 2]> {
        self.corners.windows(2).map(|pair| {
            let [[b0, k0], [b1, k1]] = [pair[0], pair[1]];
            let slope = (k1 - k0) / (b1 - b0);
            [slope, k0 - slope * b0]
        })
    }
}

/// Returns the half-spaces that count at a line with the slope `slope`: those that bring the model
/// nearer to it. Of two that face each other only the worse counts.
fn entered(planes: &[HalfSpace], slope: f64) -> [Option<HalfSpace>; hbot_core::render::model::MAX_PLANES] {
    let weight = |plane: &HalfSpace| plane.stiffness - slope * plane.damping;
    let mut found = [None; hbot_core::render::model::MAX_PLANES];
    let mut paired = 0_u32;
    for (i, plane) in planes.iter().enumerate() {
        if paired & (1 << i) != 0 {
            continue;
        }
        let faces = |(j, other): &(usize, &HalfSpace)| {
            paired & (1 << j) == 0
                && plane.normal.dot(other.normal) < OPPOSITE
                && plane.offset + other.offset >= 0.0
        };
        let mut worse = *plane;
        if let Some((j, other)) = planes.iter().enumerate().skip(i + 1).find(faces) {
            paired |= 1 << j;
            if weight(other) > weight(plane) {
                worse = *other;
            }
        }
        if weight(&worse) > 0.0 {
            found[i] = Some(worse);
        }
    }
    found
}

/// Returns the height of a polygon at `x`, and 0 outside of it.
fn height(corners: &[[f64; 2]], x: f64) -> f64 {
    let piece = corners.windows(2).find(|pair| (pair[0][0]..=pair[1][0]).contains(&x));
    piece.map_or(0.0, |pair| {
        let part = (x - pair[0][0]) / (pair[1][0] - pair[0][0]);
        (pair[0][1] + part * (pair[1][1] - pair[0][1])).max(0.0)
    })
}

/// Returns the upper convex hull of points that are sorted by x.
fn upper_hull(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut hull: Vec<[f64; 2]> = Vec::new();
    for &point in points {
        if hull.last().is_some_and(|last| last[0] == point[0]) {
            continue;
        }
        while let [.., a, b] = hull[..] {
            let turn = (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]);
            if turn < 0.0 {
                break;
            }
            hull.pop();
        }
        hull.push(point);
    }
    hull
}

fn outer(n: Vec3) -> Mat3 {
    Mat3::from_cols(n * n.x, n * n.y, n * n.z)
}

/// Returns the smallest eigenvalue of a symmetric matrix.
#[must_use]
pub fn smallest_eigenvalue(m: &Mat3) -> f64 {
    -largest_eigenvalue(&(*m * -1.0))
}

/// Returns the largest eigenvalue of a symmetric matrix, by Jacobi's rotations: exact to rounding
/// also where two eigenvalues are equal.
fn largest_eigenvalue(m: &Mat3) -> f64 {
    let mut a = m.to_cols_array_2d();
    // Rotations converge quadratically: after three sweeps nothing is left beside the diagonal.
    for _ in 0..6 {
        for (p, q, r) in [(0, 1, 2), (0, 2, 1), (1, 2, 0)] {
            let beside = a[p][q];
            if beside == 0.0 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * beside);
            let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let c = 1.0 / t.hypot(1.0);
            let (rp, rq) = (a[r][p], a[r][q]);
            a[p][p] -= t * beside;
            a[q][q] += t * beside;
            (a[p][q], a[q][p]) = (0.0, 0.0);
            (a[r][p], a[r][q]) = (c * (rp - t * rq), c * (t * rp + rq));
            (a[p][r], a[q][r]) = (a[r][p], a[r][q]);
        }
    }
    a[0][0].max(a[1][1]).max(a[2][2])
}

/// Returns a unit eigenvector of the symmetric matrix `m` for its eigenvalue `value`.
fn eigenvector(m: &Mat3, value: f64) -> Vec3 {
    let rest = *m - Mat3::IDENTITY * value;
    let rows = [rest.x_axis, rest.y_axis, rest.z_axis];
    let crosses = [rows[0].cross(rows[1]), rows[1].cross(rows[2]), rows[2].cross(rows[0])];
    let longest =
        |all: [Vec3; 3]| all.into_iter().max_by(|a, b| a.length().total_cmp(&b.length())).unwrap_or_default();
    let (cross, row) = (longest(crosses), longest(rows));
    let scale = row.length();
    if cross.length() > 1.0e-9 * scale * scale {
        return cross.normalize();
    }
    // All directions that are perpendicular to the row have this eigenvalue, or all directions.
    if scale > 0.0 { row.normalize().any_orthonormal_vector() } else { Vec3::X }
}

#[cfg(test)]
mod tests {
    use hbot_core::design::rig::LeadTime;
    use hbot_core::{Quat, rotation};

    use super::super::sampled::{HOLDS, Scene};
    use super::*;
    use crate::RigConfig;

    fn bounds() -> [(StiffnessBound, ModelBound); 2] {
        [None, Some(LeadTime::default())].map(|lead| {
            let mut config = RigConfig::prototype();
            config.rig = config.rig.with(|parts| parts.lead = lead).expect("a legal rig");
            let springs = StiffnessBound::of(&config).expect("legal inertias");
            let bound = ModelBound::new(&springs);
            (springs, bound)
        })
    }

    fn diagonal(turn: Vec3, values: [f64; 3]) -> Mat3 {
        let axes = Mat3::from_quat(rotation::exp(turn));
        axes * Mat3::from_diagonal(Vec3::from_array(values)) * axes.transpose()
    }

    fn model(stiffness: Mat3, damping: Mat3) -> LocalModel {
        LocalModel::new(Vec3::ZERO, stiffness, damping, Some(Quat::IDENTITY))
    }

    /// What the polygon takes away of the border: 10 % of reserve, and pieces that are straight.
    #[test]
    fn springs_that_are_the_same_about_all_axes_are_allowed_up_to_nearly_the_border() {
        for (springs, bound) in bounds() {
            for damping in [0.005, 0.01, 0.02, 0.05, 0.1] {
                let border = springs.stable(damping);
                let allowed = bound.stable(damping);
                assert!(allowed <= border / MARGIN * (1.0 + 1e-9), "{damping}: {allowed}, {border}");
                assert!(allowed > 0.8 * border / MARGIN, "{damping}: {allowed}, {border}");
                let at = |part: f64| model(Mat3::IDENTITY * (allowed * part), Mat3::IDENTITY * damping);
                assert_eq!(bound.check(&at(0.99)), Ok(()), "{damping}");
                let found = bound.check(&at(1.02)).expect_err("beyond the bound");
                assert!((found.stable - allowed).abs() < 1e-6 && (found.damping - damping).abs() < 1e-9);
                let part = bound.softened(&at(2.0)).expect("softer");
                assert!((part - 0.5).abs() < 1e-3, "{part}");
            }
            assert!(
                bound.check(&model(Mat3::ZERO, Mat3::IDENTITY * (1.1 * springs.most_damping()))).is_err()
            );
            assert_eq!(bound.check(&LocalModel::NONE), Ok(()));
        }
    }

    /// Stiffness and damping of any two directions, half-spaces among them: what is allowed is
    /// stable in the loop of three axes.
    #[test]
    fn what_is_allowed_is_stable_in_the_loop_of_three_axes() {
        for (springs, bound) in bounds() {
            let (mut allowed, mut refused) = (0, 0);
            let mut seed = 1_u64;
            let mut random = || {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (seed >> 33) as f64 / (1_u64 << 31) as f64
            };
            for _ in 0..300 {
                let mut vector = |size: f64| [0; 3].map(|_| size * random());
                let most = springs.stable(0.05);
                let stiffness = diagonal(Vec3::from_array(vector(3.0)), vector(most));
                let damping = diagonal(Vec3::from_array(vector(3.0)), vector(0.1));
                let normal = Vec3::from_array(vector(1.0)).normalize();
                let [k, d, _] = vector(1.0);
                let mut all = model(stiffness, damping);
                let plane = HalfSpace { normal, offset: 0.1, stiffness: most * k, damping: 0.1 * d };
                all.add_plane(plane).expect("room for one");
                if bound.check(&all).is_err() {
                    refused += 1;
                    continue;
                }
                allowed += 1;
                for entered in [0.0, 1.0] {
                    let outer = outer(normal) * entered;
                    let scene = Scene {
                        stiffness: stiffness + outer * plane.stiffness,
                        damping: damping + outer * plane.damping,
                        masses: Vec::new(),
                    };
                    assert!(springs.sampled().is_stable(&scene, &HOLDS[0]), "{all:?}");
                }
            }
            assert!(allowed > 30 && refused > 30, "{allowed} allowed, {refused} refused");
        }
    }

    #[test]
    fn eigenvalues_and_eigenvectors_are_those_of_the_matrix() {
        for values in [[1.0, 2.0, 3.0], [5.0, 5.0, 1.0], [2.0, 2.0, 2.0], [1.0, 0.0, 0.0], [-1.0, -2.0, 4.0]]
        {
            let m = diagonal(Vec3::new(0.4, -1.0, 0.7), values);
            let largest = values.into_iter().fold(f64::MIN, f64::max);
            assert!((largest_eigenvalue(&m) - largest).abs() < 1e-12, "{values:?}");
            let least = values.into_iter().fold(f64::MAX, f64::min);
            assert!((smallest_eigenvalue(&m) - least).abs() < 1e-12, "{values:?}");
            let v = eigenvector(&m, largest_eigenvalue(&m));
            assert!((m * v - v * largest).length() < 1e-6 && (v.length() - 1.0).abs() < 1e-12, "{values:?}");
        }
    }
}
