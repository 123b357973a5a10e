//! The allocation problem in coordinates in which every joint limit is 1.

use crate::device::MAX_JOINTS;
use crate::real::{Real, Vec3};

/// The rows of G in scaled coordinates. Joint k gives x_k in \[-1, 1\] at the cost x_k² / (2
/// give_k).
///
/// In these coordinates the sum of b_k b_kᵀ over all rows b_k is the unit matrix. So the steps of
/// the solvers do not depend on units, on the sizes of the limits, or on how unevenly the joints
/// turn the sphere. A problem of rank 2 or 1 has zeros in its last coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Problem {
    pub(super) n: usize,
    /// Number of coordinates in use, 1 to 3.
    pub(super) rank: usize,
    pub(super) rows: [Vec3; MAX_JOINTS],
    pub(super) give: [Real; MAX_JOINTS],
    /// Rounding error of a row, relative to its length.
    pub(super) rounding: Real,
}
