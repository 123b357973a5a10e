//! A virtual mass: T = -M_v dw/dt, smoothed.
//!
//! The acceleration comes from differences of the rate, so it is at least one tick late. It passes
//! through a first-order low-pass with the time constant `smoothing`: T = -M_v (dw/dt)/(1 + s
//! smoothing). Without delay this is passive, because its impedance M_v s/(1 + s smoothing) has a
//! positive real part. Below the frequency 1/smoothing it is a mass, above it a damper of
//! M_v/smoothing.
//!
//! With delay it is stable only up to a certain mass. Let h be the period, a = h/(smoothing + h)
//! the filter's step, and mu the ratio of M_v to the sphere's own inertia. With one tick of delay
//! it is stable for mu < 2/a - 1, with two ticks for mu < 1/a. All virtual masses of a scene
//! together are kept below half of the second limit, see [`mass_scale`].

use super::{Law, Now};
use crate::real::{Mat3, Real, Vec3, fabs};

/// An effect that makes the sphere seem heavier: a virtual mass that resists acceleration and
/// deceleration.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Inertia {
    /// Inertia of the virtual mass in frame N, kg m²: a symmetric, positive semidefinite matrix.
    pub mass: Mat3,
    /// Time constant of the low-pass filter for the sphere's angular acceleration, s.
    pub smoothing: Real,
}

/// Fraction of the stability limit up to which virtual masses are rendered. The limit is that for
/// two ticks of delay.
const PART: Real = 0.5;

/// Returns the factor, 0 to 1, by which all virtual masses of a scene are scaled so that the rig
/// stays stable. Each item of `masses` is a mass M_v (kg m², with its gain) and the time constant
/// of its smoothing (s).
///
/// Let h be the `period` and a = h/(smoothing + h). The factor is 1 if the sum of the products a
/// M_v is at most half of the sphere's own `inertia` (kg m²). Otherwise it scales this sum down to
/// the limit.
#[must_use]
pub(crate) fn mass_scale(masses: impl Iterator<Item = (Real, Real)>, inertia: Real, period: Real) -> Real {
    let load: Real = masses.map(|(mass, smoothing)| mass * period / (smoothing + period)).sum();
    let most = PART * inertia;
    if load > most { most / load } else { 1.0 }
}

/// Returns the largest row sum of `m`: an upper bound of its largest eigenvalue. For a diagonal
/// matrix both are equal.
pub(crate) fn largest(m: &Mat3) -> Real {
    let row = |x: Real, y: Real, z: Real| fabs(x) + fabs(y) + fabs(z);
    row(m.x_axis.x, m.y_axis.x, m.z_axis.x)
        .max(row(m.x_axis.y, m.y_axis.y, m.z_axis.y))
        .max(row(m.x_axis.z, m.y_axis.z, m.z_axis.z))
}

impl Law for Inertia {
    /// The smoothed angular acceleration of the sphere, rad/s².
    type Memory = Vec3;
    /// The bound of all masses keeps them stable, however late they are.
    const ELASTIC: bool = false;

    #[inline]
    fn render(&self, now: &mut Now<'_>, smooth: &mut Vec3) -> Vec3 {
        let raw = now.acceleration();
        let sum = self.smoothing + now.dt;
        if sum > 0.0 {
            *smooth += (raw - *smooth) * (now.dt / sum);
        }
        -(self.mass * *smooth) * now.shared.mass_scale
    }

    fn mass(&self) -> Option<(Mat3, Real)> {
        Some((self.mass, self.smoothing))
    }
}
