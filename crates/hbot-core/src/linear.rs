//! The linear algebra that the core needs beyond glam: symmetric 3x3 matrices with solvers and
//! eigenvectors, and the singular values of rows.

use crate::count::MAX_JOINTS;
use crate::real::{Real, Vec3, fabs, sqrt};

/// A symmetric 3x3 matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sym3 {
    xx: Real,
    yy: Real,
    zz: Real,
    xy: Real,
    xz: Real,
    yz: Real,
}

/// The adjugate of a symmetric 3x3 matrix M, with the invariants of M. It solves M x = v quickly,
/// by three dot products and a division.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Adjugate {
    adjugate: Sym3,
    /// Determinant of the matrix: the product of its three eigenvalues.
    det: Real,
    /// Sum of the products of each two of the three eigenvalues.
    pairs: Real,
    /// Trace of the matrix: the sum of its three eigenvalues.
    sum: Real,
}

impl Sym3 {
    pub(crate) const ZERO: Self = Self { xx: 0.0, yy: 0.0, zz: 0.0, xy: 0.0, xz: 0.0, yz: 0.0 };

    /// Adds the matrix I - n nᵀ for the unit vector `n`. A diagonal element such as 1 - n_x² is
    /// computed as n_y² + n_z², which loses no digits.
    #[inline]
    pub(crate) fn add_plane(&mut self, n: Vec3) {
        self.xx += n.y * n.y + n.z * n.z;
        self.yy += n.x * n.x + n.z * n.z;
        self.zz += n.x * n.x + n.y * n.y;
        self.xy -= n.x * n.y;
        self.xz -= n.x * n.z;
        self.yz -= n.y * n.z;
    }

    /// Adds the matrix `weight` g gᵀ: the outer product of `g` with itself, times `weight`.
    #[inline]
    pub(crate) fn add(&mut self, g: Vec3, weight: Real) {
        let h = g * weight;
        self.xx += g.x * h.x;
        self.yy += g.y * h.y;
        self.zz += g.z * h.z;
        self.xy += g.x * h.y;
        self.xz += g.x * h.z;
        self.yz += g.y * h.z;
    }

    pub(crate) fn trace(&self) -> Real {
        self.xx + self.yy + self.zz
    }

    #[inline]
    fn times(&self, v: Vec3) -> Vec3 {
        Vec3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }

    #[inline]
    pub(crate) fn adjugate(&self) -> Adjugate {
        let a = Self {
            xx: self.yy * self.zz - self.yz * self.yz,
            yy: self.xx * self.zz - self.xz * self.xz,
            zz: self.xx * self.yy - self.xy * self.xy,
            xy: self.xz * self.yz - self.xy * self.zz,
            xz: self.xy * self.yz - self.xz * self.yy,
            yz: self.xy * self.xz - self.xx * self.yz,
        };
        let det = self.xx * a.xx + self.xy * a.xy + self.xz * a.xz;
        let (pairs, sum) = (a.trace(), self.trace());
        Adjugate { adjugate: a, det, pairs, sum }
    }

    /// Returns the solution x of M x = v by LDLᵀ decomposition. Pivots below `floor` are raised to
    /// `floor`.
    ///
    /// If M is positive definite, the error grows only with the condition number of M. The error of
    /// [`Adjugate::solve`] grows with its square if two eigenvalues are small. If M is singular,
    /// the result solves the system of a positive definite matrix that differs from M by about
    /// `floor`.
    pub(crate) fn solve(&self, v: Vec3, floor: Real) -> Vec3 {
        let d1 = self.xx.max(floor);
        let (l21, l31) = (self.xy / d1, self.xz / d1);
        let d2 = (self.yy - l21 * self.xy).max(floor);
        let c32 = self.yz - l31 * self.xy;
        let l32 = c32 / d2;
        let d3 = (self.zz - l31 * self.xz - l32 * c32).max(floor);
        let y2 = v.y - l21 * v.x;
        let y3 = v.z - l31 * v.x - l32 * y2;
        let z = y3 / d3;
        let y = y2 / d2 - l32 * z;
        Vec3::new(v.x / d1 - l21 * y - l31 * z, y, z)
    }

    /// Returns the eigenvalues in descending order, and their unit eigenvectors. They are found by
    /// cyclic Jacobi rotations.
    pub(crate) fn eigen(&self) -> ([Real; 3], [Vec3; 3]) {
        let mut a = [[self.xx, self.xy, self.xz], [self.xy, self.yy, self.yz], [self.xz, self.yz, self.zz]];
        let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        // Converges quadratically: after 3 to 5 sweeps the off-diagonal elements are zero to
        // rounding.
        for _ in 0..10 {
            let off = fabs(a[0][1]) + fabs(a[0][2]) + fabs(a[1][2]);
            if !(off > 0.25 * Real::EPSILON * (a[0][0] + a[1][1] + a[2][2])) {
                break;
            }
            for (p, q) in [(0, 1), (0, 2), (1, 2)] {
                rotate(&mut a, &mut v, p, q);
            }
        }
        let mut order = [0, 1, 2];
        order.sort_unstable_by(|&i, &j| a[j][j].total_cmp(&a[i][i]));
        (order.map(|i| a[i][i]), order.map(|i| Vec3::new(v[0][i], v[1][i], v[2][i])))
    }
}

impl Adjugate {
    /// Returns true if the smallest eigenvalue is certainly larger than `ratio` times the largest
    /// one, despite rounding errors.
    ///
    /// The quantity det / (pairs sum) is at most the ratio of the two eigenvalues, and at least a
    /// ninth of it. If it is above `ratio`, pairs / sum² is above ratio / 9. Rounding changes det
    /// by a few units in the last place of sum³. The second condition ensures that this error is
    /// smaller than the required det.
    #[inline]
    pub(crate) fn rank_above(&self, ratio: Real) -> bool {
        let flat = Real::max(ratio / 9.0, 8.0 * Real::EPSILON / ratio);
        self.det > ratio * self.pairs * self.sum && self.pairs > flat * self.sum * self.sum
    }

    /// Returns the solution x of M x = v for the matrix M whose adjugate this is. Divides each
    /// component by the determinant.
    #[inline]
    pub(crate) fn solve_by_division(&self, v: Vec3) -> Vec3 {
        self.adjugate.times(v) / self.det
    }

    /// Returns the solution x of M x = v for the matrix M whose adjugate this is. Faster than
    /// [`solve_by_division`](Self::solve_by_division), because it divides only once.
    #[inline]
    pub(crate) fn solve(&self, v: Vec3) -> Vec3 {
        self.adjugate.times(v) * (1.0 / self.det)
    }
}

/// Applies one Jacobi rotation to the symmetric matrix `a`, which makes the element a\[p\]\[q\]
/// zero. Applies the same rotation to the columns p and q of `v`.
fn rotate(a: &mut [[Real; 3]; 3], v: &mut [[Real; 3]; 3], p: usize, q: usize) {
    let apq = a[p][q];
    if apq == 0.0 {
        return;
    }
    let zeta = (a[q][q] - a[p][p]) / (2.0 * apq);
    let sign = if zeta < 0.0 { -1.0 } else { 1.0 };
    let t = sign / (fabs(zeta) + sqrt(1.0 + zeta * zeta));
    let c = 1.0 / sqrt(1.0 + t * t);
    let s = t * c;
    a[p][p] -= t * apq;
    a[q][q] += t * apq;
    a[p][q] = 0.0;
    a[q][p] = 0.0;
    let r = 3 - p - q;
    let (arp, arq) = (a[r][p], a[r][q]);
    a[r][p] = c * arp - s * arq;
    a[p][r] = a[r][p];
    a[r][q] = s * arp + c * arq;
    a[q][r] = a[r][q];
    for row in v {
        let (x, y) = (row[p], row[q]);
        row[p] = c * x - s * y;
        row[q] = s * x + c * y;
    }
}

/// Returns the singular values of `rows` (at most [`MAX_JOINTS`]) in descending order, and their
/// axes. `axes` is a first approximation of these axes.
///
/// Uses one-sided Jacobi rotations, because they are accurate even for the smallest singular value
/// (Demmel and Veselic 1992).
pub(crate) fn principal(rows: &[Vec3], mut axes: [Vec3; 3]) -> ([Real; 3], [Vec3; 3]) {
    let lengths = orthogonalise(rows, &mut axes);
    let mut order = [0, 1, 2];
    order.sort_unstable_by(|&i, &j| lengths[j].total_cmp(&lengths[i]));
    (order.map(|i| lengths[i]), order.map(|i| axes[i]))
}

/// Rotates the three orthonormal `axes` until they are the principal axes of `rows`. Then the
/// columns of the products row . axis are at right angles to each other. Returns the lengths of
/// these columns, which are the singular values, in the order of the axes. Takes at most
/// [`MAX_JOINTS`] rows.
fn orthogonalise(rows: &[Vec3], axes: &mut [Vec3; 3]) -> [Real; 3] {
    let m = rows.len();
    let mut columns = [[0.0; MAX_JOINTS]; 3];
    for (k, row) in rows.iter().enumerate() {
        for (column, axis) in columns.iter_mut().zip(*axes) {
            column[k] = row.dot(axis);
        }
    }
    let dot = |a: &[Real; MAX_JOINTS], b: &[Real; MAX_JOINTS]| -> Real {
        a.iter().zip(b).map(|(x, y)| x * y).sum()
    };
    // Converges quadratically: 3 columns need 4 to 6 sweeps.
    for _ in 0..12 {
        let mut largest: Real = 0.0;
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let (aa, bb) = (dot(&columns[i], &columns[i]), dot(&columns[j], &columns[j]));
            let ab = dot(&columns[i], &columns[j]);
            let scale = sqrt(aa * bb);
            if !(fabs(ab) > Real::EPSILON * scale) {
                continue;
            }
            largest = largest.max(fabs(ab) / scale);
            let zeta = (bb - aa) / (2.0 * ab);
            let sign = if zeta < 0.0 { -1.0 } else { 1.0 };
            let t = sign / (fabs(zeta) + sqrt(1.0 + zeta * zeta));
            let c = 1.0 / sqrt(1.0 + t * t);
            for k in 0..m {
                let (x, y) = (columns[i][k], columns[j][k]);
                columns[i][k] = c * (x - t * y);
                columns[j][k] = c * (y + t * x);
            }
            let (x, y) = (axes[i], axes[j]);
            axes[i] = (x - y * t) * c;
            axes[j] = (y + x * t) * c;
        }
        if largest < 4.0 * Real::EPSILON {
            break;
        }
    }
    columns.map(|c| sqrt(dot(&c, &c)))
}

/// Returns the vector `v`, shortened to the length `limit` if it is longer.
#[inline]
pub(crate) fn limited(v: Vec3, limit: Real) -> Vec3 {
    shortened(v, limit).0
}

/// Returns the vector `v`, shortened to the length `limit` if it is longer. Also returns the ratio
/// of the new length to the old one, 0 to 1.
#[inline]
pub(crate) fn shortened(v: Vec3, limit: Real) -> (Vec3, Real) {
    let length2 = v.length_squared();
    if !(length2 > limit * limit) {
        (v, 1.0)
    } else if length2 < Real::INFINITY {
        let share = limit / sqrt(length2);
        (v * share, share)
    } else {
        // Too long to square. A vector that is not finite stays not finite.
        let size = v.abs().max_element();
        let unit = v / size;
        let share = limit / sqrt(unit.length_squared());
        (unit * share, share / size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_and_eigenvectors_agree_with_the_matrix() {
        let mut m = Sym3::ZERO;
        for g in [Vec3::new(1.0, 2.0, -0.5), Vec3::new(-0.3, 0.7, 1.1), Vec3::new(0.2, -1.0, 0.4)] {
            m.add(g, 1.3);
        }
        let v = Vec3::new(0.4, -0.6, 1.7);
        // With a condition number below 100, the result has two digits fewer than the type.
        let bound = 200.0 * Real::EPSILON;
        assert!((m.times(m.solve(v, Real::EPSILON)) - v).length() < bound);
        assert!((m.times(m.adjugate().solve(v)) - v).length() < bound);
        let (values, vectors) = m.eigen();
        assert!(values[0] >= values[1] && values[1] >= values[2]);
        for (value, vector) in values.into_iter().zip(vectors) {
            assert!((m.times(vector) - vector * value).length() < bound);
            assert!(fabs(vector.length() - 1.0) < bound);
        }
        let ratio = values[2] / values[0];
        assert!(m.adjugate().rank_above(ratio / 9.1) && !m.adjugate().rank_above(ratio));
    }

    #[test]
    fn rounding_is_not_rank() {
        for k in 1..200 {
            let x = k as Real;
            let (a, b) = (Vec3::new(1.0 / x, 0.3 * x, 0.7), Vec3::new(0.2, 1.0 - 0.01 * x, 1.0 / (1.0 + x)));
            let mut m = Sym3::ZERO;
            m.add(a, 0.46);
            assert!(!m.adjugate().rank_above(1.0e-4), "one row: {a}");
            m.add(b, 1.7);
            assert!(!m.adjugate().rank_above(1.0e-4), "two rows: {a}, {b}");
        }
    }

    /// A generator of random numbers that are the same in every run.
    struct Random(u32);

    impl Random {
        /// Returns a random number from -0.5 to 0.5.
        fn number(&mut self) -> Real {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (self.0 >> 8) as Real / 16_777_216.0 - 0.5
        }

        fn vector(&mut self) -> Vec3 {
            Vec3::new(self.number(), self.number(), self.number())
        }
    }

    #[test]
    fn rank_is_what_the_eigenvalues_say_at_any_scale() {
        let mut random = Random(1);
        // Far below this ratio of eigenvalues, rounding can hide the rank.
        let least = 20.0 * sqrt(Real::EPSILON);
        for case in 0..200 {
            let q = crate::rotation::exp(random.vector() * 6.0);
            let [x, y] = [0; 2].map(|_| {
                let u = random.number() + 0.5;
                least + (1.0 - least) * u * u * u
            });
            let values: [Real; 3] = match case % 4 {
                0 => [1.0, 1.0, 1.0],
                1 => [1.0, 1.0, x],
                2 => [1.0, x, x],
                _ => [1.0, x, y],
            };
            let ratio = values[1].min(values[2]);
            for scale in [1.0e-6, 1.0, 1.0e6] {
                let mut m = Sym3::ZERO;
                for (axis, value) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().zip(values) {
                    m.add(q * axis, value * scale);
                }
                // The check may refuse ratios up to 9 times the required one.
                assert!(m.adjugate().rank_above(ratio / 9.1), "{values:?}, scale {scale:e}");
                assert!(!m.adjugate().rank_above(ratio * 1.01), "{values:?}, scale {scale:e}");
            }
        }
    }

    #[test]
    fn two_rows_have_no_third_direction_even_if_they_are_nearly_parallel() {
        let mut random = Random(1);
        // At this ratio and for these angles between the rows, the rounding error of the
        // determinant can exceed ratio times pairs times sum.
        let (ratio, angle) = (0.1 * sqrt(Real::EPSILON), 2.0 * sqrt(sqrt(Real::EPSILON)));
        for _ in 0..1000 {
            let a = random.vector();
            let b = a + random.vector() * (angle * (random.number() + 0.5));
            let mut m = Sym3::ZERO;
            m.add(a, 1.3);
            m.add(b, 0.7);
            assert!(!m.adjugate().rank_above(ratio), "{a}, {b}");
        }
    }

    #[test]
    fn principal_axes_are_orthonormal_and_separate_the_rows_at_any_scale() {
        let mut random = Random(1);
        // A few roundings, relative to the sum of the squared rows.
        let bound = 16.0 * Real::EPSILON;
        for case in 0..100 {
            // The rows are the nearer to one plane, the smaller `flat` is.
            let flat = [1.0, 1.0e-3, 1.0e-6][case % 3];
            let mut rows = [Vec3::ZERO; MAX_JOINTS];
            let n = 3 + case % 14;
            for row in &mut rows[..n] {
                let v = random.vector();
                *row = Vec3::new(v.x, v.y, 0.7 * (v.x + v.y) + flat * v.z);
            }
            for scale in [Real::EPSILON, 1.0, 1.0 / Real::EPSILON] {
                let rows = &rows.map(|row| row * scale)[..n];
                let squares: Real = rows.iter().map(|row| row.length_squared()).sum();
                let (lengths, axes) = principal(rows, [Vec3::X, Vec3::Y, Vec3::Z]);
                assert!(lengths[0] >= lengths[1] && lengths[1] >= lengths[2]);
                for i in 0..3 {
                    for j in 0..3 {
                        let same = if i == j { 1.0 } else { 0.0 };
                        let cosine = axes[i].dot(axes[j]);
                        assert!(fabs(cosine - same) <= bound, "case {case}, scale {scale:e}: {cosine}");
                        let moment: Real = rows.iter().map(|row| row.dot(axes[i]) * row.dot(axes[j])).sum();
                        let want = same * lengths[i] * lengths[j];
                        assert!(
                            fabs(moment - want) <= bound * squares,
                            "case {case}, scale {scale:e}: {moment:e}, not {want:e}"
                        );
                    }
                }
            }
        }
    }
}
