//! What the contacts between wheels and sphere hold.

/// Set-valued Coulomb friction at each contact: the force between sphere and wheel along c1 and c2 is at most mu N; while
/// it is less they do not slip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slip {
    /// Friction coefficient, 0 to 5; default 0.8, usual for rubber on plastic.
    pub mu: f64,
    /// Normal force N of each wheel, N, 0 to 10,000; default 10, assumed.
    pub normal_force: f64,
}

impl Default for Slip {
    fn default() -> Self {
        Self { mu: 0.8, normal_force: 10.0 }
    }
}

impl Slip {
    /// The largest friction force mu N of a contact, N.
    #[must_use]
    pub fn limit(&self) -> f64 {
        self.mu * self.normal_force
    }
}

/// Coulomb friction of each contact patch against pivoting, the spin (dth/dt) cos a - w.c3 about its normal c3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pivoting {
    /// Friction coefficient, 0 to 5; default 0.8, usual for rubber on plastic.
    pub mu: f64,
    /// Normal force N of each wheel, N, 0 to 10,000; default 10, assumed.
    pub normal_force: f64,
    /// Radius a of the contact patch, m, 0 to 0.1; default 1e-4, of a hard tyre, assumed.
    pub patch_radius: f64,
}

impl Default for Pivoting {
    fn default() -> Self {
        Self { mu: 0.8, normal_force: 10.0, patch_radius: 1.0e-4 }
    }
}

impl Pivoting {
    /// The largest torque about c3 of a contact, N m: that of a flat round patch under even pressure, (2/3) mu N a
    /// (0.53 mN m by default). Under Hertz's pressure, which is greater in the middle, it would be (3 pi/16) mu N a
    /// (Johnson, *Contact Mechanics*, 1985), 12 % less: well within what one knows of a or mu.
    #[must_use]
    pub fn limit(&self) -> f64 {
        2.0 / 3.0 * self.mu * self.normal_force * self.patch_radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_those_of_the_physics_notes() {
        assert_eq!(Slip::default().limit(), 8.0);
        // 2/3 of 0.8 x 10 N x 0.1 mm, to rounding.
        assert!((Pivoting::default().limit() - 1.6e-3 / 3.0).abs() < 1e-18);
    }
}
