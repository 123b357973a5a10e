//! A virtual mass: T = -M_v dw/dt, smoothed.
//!
//! The acceleration comes from differences of the rate, a tick and more late, and through a first-order low-pass of time
//! constant `smoothing`: T = -M_v (dw/dt)/(1 + s smoothing). Without delay this is passive (its impedance M_v s/(1 + s smoothing) has a
//! positive real part), a mass below 1/smoothing and a damper of M_v/smoothing above. With delay it is stable only up to
//! a mass: with a = h/(smoothing + h) the filter's step and mu = M_v over the sphere's own inertia, one tick of delay is stable for
//! mu < 2/a - 1 and two for mu < 1/a. All virtual masses of a scene together are held below half of the latter: see
//! [`mass_scale`].

use super::{Law, Now};
use crate::real::{Mat3, Real, Vec3, fabs};

/// Resistance against being sped up or slowed down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertia {
    /// Virtual mass, symmetric positive semidefinite in N, kg m².
    pub mass: Mat3,
    /// Time constant of the acceleration's low-pass, s.
    pub smoothing: Real,
}

/// The part of the two-tick stability limit that is rendered.
const PART: Real = 0.5;

/// What is rendered of the virtual masses `masses` (gain included; each with its smoothing), 0 to 1: all of them, where
/// sum of a M_v <= 1/2 of the sphere's own `inertia` (kg m²), a = h/(smoothing + h), h = `period`; else their due part.
#[must_use]
pub(crate) fn mass_scale(masses: impl Iterator<Item = (Real, Real)>, inertia: Real, period: Real) -> Real {
    let load: Real = masses.map(|(mass, smoothing)| mass * period / (smoothing + period)).sum();
    let most = PART * inertia;
    if load > most { most / load } else { 1.0 }
}

impl Law for Inertia {
    /// The smoothed acceleration, rad/s².
    type Memory = Vec3;

    #[inline]
    fn render(&self, now: &mut Now<'_>, smooth: &mut Vec3) -> Vec3 {
        let raw = now.acceleration();
        let sum = self.smoothing + now.dt;
        if sum > 0.0 {
            *smooth += (raw - *smooth) * (now.dt / sum);
        }
        -(self.mass * *smooth) * now.shared.mass_scale
    }

    fn mass(&self) -> Option<(Real, Real)> {
        let row = |x: Real, y: Real, z: Real| fabs(x) + fabs(y) + fabs(z);
        let m = &self.mass;
        // The largest row sum bounds the largest eigenvalue, and is it for a diagonal matrix.
        let largest = row(m.x_axis.x, m.y_axis.x, m.z_axis.x)
            .max(row(m.x_axis.y, m.y_axis.y, m.z_axis.y))
            .max(row(m.x_axis.z, m.y_axis.z, m.z_axis.z));
        Some((largest, self.smoothing))
    }
}
