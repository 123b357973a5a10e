//! The allocation problem in coordinates in which every joint limit is 1.

use crate::design::device::MAX_JOINTS;
use crate::real::{Real, Vec3};

/// The allocation problem in scaled coordinates, in which the torque x_k of joint k has the limits
/// -1 and 1 and the cost x_k² / (2 give_k). The rows b_k are scaled rows of G.
///
/// In these coordinates, the sum of b_k b_kᵀ over all rows is the unit matrix. So the steps of the
/// solvers do not depend on units, on the sizes of the limits, or on how unevenly the joints turn
/// the sphere. A problem of rank 2 or 1 has zeros in its last coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Problem {
    pub(super) n: usize,
    /// Number of coordinates in use, 1 to 3. It is below 3 if torque about some axes is left out.
    pub(super) rank: usize,
    pub(super) rows: [Vec3; MAX_JOINTS],
    pub(super) give: [Real; MAX_JOINTS],
    /// Largest rounding error of a row, as a fraction of the row's length.
    pub(super) rounding: Real,
}
