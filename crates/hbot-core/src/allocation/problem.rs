//! The allocation in coordinates in which every limit is 1.

use crate::device::MAX_JOINTS;
use crate::real::{Real, Vec3};

/// Rows of G in which joint k gives x_k within +-1 at the cost x_k² / (2 give_k).
///
/// In these coordinates the sum of b_k b_kᵀ is the unit matrix, so no step below depends on units, on the sizes of the
/// limits or on how unevenly the joints turn the sphere. A problem of rank 2 or 1 has zeros in the last coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Problem {
    pub(super) n: usize,
    /// How many coordinates are in use, 1 to 3.
    pub(super) rank: usize,
    pub(super) rows: [Vec3; MAX_JOINTS],
    pub(super) give: [Real; MAX_JOINTS],
    /// Rounding of a row, beside its length.
    pub(super) rounding: Real,
}
