//! Set-valued laws between a velocity and an impulse, in the form that the solver needs.
//!
//! Each law is the subdifferential of a convex function g: the impulse p against a velocity u is in
//! dg(u). The solver works with the law's augmented Lagrangian (Rockafellar 1976; Alart and Curnier
//! 1991). With the last multiplier p0 and a penalty rho, the impulse is p = rho (y - prox(y)) with
//! y = u + p0 / rho. This is a continuous function of u. At p = p0 it equals the law itself for any
//! rho, so a sticking contact truly sticks.

use super::{MAX_SPEEDS, Vector};

/// Largest number of components that the velocity of one law can have.
pub(super) const MAX_DIMENSION: usize = 3;

/// A law that relates a velocity to an impulse: Coulomb friction, or a stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Law {
    /// Coulomb friction. The impulse acts against the velocity u. Its size is `limit` if u is not
    /// zero, and at most `limit` if u is zero. The convex function of the law is g = limit |u|.
    Friction {
        /// Largest impulse, N s or N m s. It is infinite for a direction in which the parts can
        /// never slide.
        limit: f64,
    },
    /// A stop that limits a velocity. The velocity never exceeds its bounds, and there is no
    /// impulse while it is within them. The bounds include zero. The convex function g of the law
    /// is the indicator function of the bounds.
    Gap {
        /// Lower bound of the velocity, at most 0.
        low: f64,
        /// Upper bound of the velocity, at least 0.
        high: f64,
    },
    /// A spring and damper that slides if the impulse on it reaches a limit. The impulse is `base +
    /// gain u` if this is not longer than `limit`. If it is longer, the impulse has the same
    /// direction and the length `limit`. The convex function of the law is quadratic in the middle
    /// and linear outside (Huber's function).
    Elastic {
        /// Largest impulse, N s.
        limit: f64,
        /// Impulse at the velocity 0, N s.
        base: [f64; 2],
        /// Growth of the impulse with the velocity, kg. Positive.
        gain: f64,
    },
}

/// One component of a law's velocity, as a linear combination of a few of the solver's speeds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Row {
    at: [u8; 8],
    by: [f64; 8],
    len: u8,
}

impl Row {
    pub(super) const EMPTY: Self = Self { at: [0; 8], by: [0.0; 8], len: 0 };

    /// Adds a term to the linear combination: `by` times the speed with index `at`.
    #[inline]
    pub(super) fn and(mut self, at: usize, by: f64) -> Self {
        self.at[usize::from(self.len)] = at as u8;
        self.by[usize::from(self.len)] = by;
        self.len += 1;
        self
    }

    /// Returns the index and the factor of each speed in this linear combination.
    #[inline]
    pub(super) fn terms(&self) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        let n = usize::from(self.len);
        self.at[..n].iter().zip(&self.by[..n]).map(|(at, by)| (usize::from(*at) % MAX_SPEEDS, *by))
    }

    /// Returns the value of this linear combination at `speeds`.
    #[inline]
    pub(super) fn dot(&self, speeds: &Vector) -> f64 {
        self.terms().map(|(at, by)| by * speeds[at]).sum()
    }

    /// Multiplies the factor of each speed by the entry of `scale` for that speed.
    #[inline]
    pub(super) fn scaled(mut self, scale: &Vector) -> Self {
        for (at, by) in self.at.iter().zip(&mut self.by).take(usize::from(self.len)) {
            *by *= scale[usize::from(*at) % MAX_SPEEDS];
        }
        self
    }
}

/// A law of friction or of a stop, together with the velocity to which it applies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Element {
    pub(super) law: Law,
    pub(super) dimension: usize,
    pub(super) rows: [Row; MAX_DIMENSION],
    /// Impulse that acts against the velocity. The transpose of `rows` times this impulse is
    /// subtracted from the momentum.
    pub(super) impulse: [f64; MAX_DIMENSION],
}

/// The impulse p that a law gives at one velocity u, and its derivative dp/du = along I + across d
/// dᵀ. The unit vector d is `direction`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Response {
    pub(super) impulse: [f64; MAX_DIMENSION],
    pub(super) along: f64,
    pub(super) across: f64,
    pub(super) direction: [f64; MAX_DIMENSION],
}

impl Element {
    /// Returns the impulse that the law gives at the velocity `u`, and the derivative of this
    /// impulse. `rho` is the penalty of the solver's present round, and `last` the impulse from its
    /// previous round.
    #[inline]
    pub(super) fn response(
        &self,
        u: &[f64; MAX_DIMENSION],
        last: &[f64; MAX_DIMENSION],
        rho: f64,
    ) -> Response {
        let none = [0.0; MAX_DIMENSION];
        let mut y = none;
        // A law that is smooth needs no multiplier: it gives its impulse at once.
        let (last, rho) = match &self.law {
            Law::Elastic { base: [x, y], gain, .. } => (&[*x, *y, 0.0], *gain),
            Law::Friction { .. } | Law::Gap { .. } => (last, rho),
        };
        for k in 0..self.dimension {
            y[k] = last[k] + rho * u[k];
        }
        match self.law {
            Law::Friction { limit } | Law::Elastic { limit, .. } => {
                let size = libm::sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2]);
                if size <= limit {
                    return Response { impulse: y, along: rho, across: 0.0, direction: none };
                }
                let direction = y.map(|y| y / size);
                let along = rho * limit / size;
                Response { impulse: direction.map(|d| d * limit), along, across: -along, direction }
            }
            Law::Gap { low, high } => {
                let beyond = y[0] - (y[0]).clamp(rho * low, rho * high);
                let along = if beyond == 0.0 { 0.0 } else { rho };
                Response { impulse: [beyond, 0.0, 0.0], along, across: 0.0, direction: none }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(law: Law, y: f64) -> Response {
        let element =
            Element { law, dimension: 1, rows: [Row::EMPTY; MAX_DIMENSION], impulse: [0.0; MAX_DIMENSION] };
        element.response(&[0.0; MAX_DIMENSION], &[y, 0.0, 0.0], 10.0)
    }

    #[test]
    fn limits_of_none_and_without_end() {
        assert_eq!(answer(Law::Friction { limit: 0.0 }, 3.0).impulse[0], 0.0);
        assert_eq!(answer(Law::Friction { limit: 0.0 }, 0.0).impulse[0], 0.0);
        assert_eq!(answer(Law::Friction { limit: f64::INFINITY }, -1e300).impulse[0], -1e300);
        assert_eq!(answer(Law::Friction { limit: 2.0 }, -3.0).impulse[0], -2.0);
        // Exactly at the limit it still sticks.
        assert_eq!(answer(Law::Friction { limit: 2.0 }, 2.0).along, 10.0);
    }

    #[test]
    fn a_gap_answers_beyond_its_ends_alone() {
        let law = Law::Gap { low: -1.0, high: 0.5 };
        for (y, impulse, along) in [(4.0, 0.0, 0.0), (-9.0, 0.0, 0.0), (6.0, 1.0, 10.0), (-12.0, -2.0, 10.0)]
        {
            let answer = answer(law, y);
            assert_eq!((answer.impulse[0], answer.along), (impulse, along), "{y}");
        }
        assert_eq!(answer(Law::Gap { low: 0.0, high: 0.0 }, 1e-300).impulse[0], 1e-300);
    }
}
