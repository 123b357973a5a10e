//! Friction at the joints and in the cage.

/// Friction at every joint: Coulomb with a Stribeck peak, and viscous. A joint at rest truly sticks, up to
/// [`JointFriction::breakaway`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointFriction {
    /// Coulomb torque of a moving joint, N m, 0 to 10; default 2e-4, of small bearings, assumed (with the cage's it
    /// gives back-drive torques like the paper's table II).
    pub coulomb: f64,
    /// Viscous friction, N m s/rad, 0 to 10; default 1e-5, assumed.
    pub viscous: f64,
    /// The torque that a joint at rest withstands, N m, 0 to 10; default that of `coulomb`, so no Stribeck peak. A
    /// figure below `coulomb` counts as `coulomb`.
    pub breakaway: f64,
    /// The rate over which breakaway falls to Coulomb, rad/s, 1e-3 to 100; default 0.5, assumed. Without meaning where
    /// the two are equal.
    pub stribeck_rate: f64,
}

impl Default for JointFriction {
    fn default() -> Self {
        Self { coulomb: 2.0e-4, viscous: 1.0e-5, breakaway: 2.0e-4, stribeck_rate: 0.5 }
    }
}

impl JointFriction {
    /// The dry friction of a joint at `rate` (rad/s), N m; at rest what it withstands. The viscous part is not in it:
    /// coulomb + (breakaway - coulomb) exp(-(rate / stribeck_rate)²), the Gaussian form of the Stribeck curve
    /// (Armstrong-Hélouvry, Dupont and Canudas de Wit 1994).
    #[must_use]
    pub fn limit(&self, rate: f64) -> f64 {
        let more = self.breakaway - self.coulomb;
        if !(more > 0.0) {
            return self.coulomb;
        }
        let x = rate / self.stribeck_rate;
        self.coulomb + more * libm::exp(-x * x)
    }
}

/// Coulomb friction of the sphere in its cage, against its angular velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CageFriction {
    /// The largest torque, N m, 0 to 10; default 2e-3, which with that of the joints gives back-drive torques of about
    /// 4.2, 5.0, 4.1 mN m about n1, n2, n3 (the paper's: 5, 4, 4).
    pub torque: f64,
}

impl Default for CageFriction {
    fn default() -> Self {
        Self { torque: 2.0e-3 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stribeck_curve_starts_at_breakaway_and_ends_at_coulomb() {
        let friction = JointFriction { breakaway: 5.0e-4, ..JointFriction::default() };
        assert_eq!(friction.limit(0.0), 2.0e-4 + (5.0e-4 - 2.0e-4));
        // One e-th of the peak is left at the Stribeck rate, either way; rounding alone.
        for rate in [0.5, -0.5] {
            assert!((friction.limit(rate) - (2.0e-4 + 3.0e-4 / core::f64::consts::E)).abs() < 1e-18);
        }
        assert_eq!(friction.limit(100.0), 2.0e-4);
        // No peak: the same at every rate, and a breakaway below Coulomb's counts as none.
        assert_eq!(JointFriction::default().limit(0.1), 2.0e-4);
        assert_eq!(JointFriction { breakaway: 0.0, ..friction }.limit(0.0), 2.0e-4);
    }
}
