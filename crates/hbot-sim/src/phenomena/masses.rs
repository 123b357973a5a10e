//! Masses and centres that are not where they should be.

use hbot_core::Vec3;

/// A sphere that is out of centre by d: gravity turns it, (R_s d) x (-m g n3), and the radius that a wheel rolls on is
/// R + d.c3 instead of R.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eccentric {
    /// d in sphere axes, m, each component -0.1 to 0.1; default (5e-4, 0, 0), the tolerance of a good printed or turned
    /// shell, assumed.
    pub offset: Vec3,
}

impl Default for Eccentric {
    fn default() -> Self {
        Self { offset: Vec3::new(5.0e-4, 0.0, 0.0) }
    }
}

/// The weight of each wheel's module, at the wheel's centre (R + r) c3: a torque on its steering joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelModules {
    /// Mass, kg, 0 to 100; default 0.05: wheel, drive motor and gear, assumed.
    pub mass: f64,
}

impl Default for WheelModules {
    fn default() -> Self {
        Self { mass: 0.05 }
    }
}
