//! The gears of the drive joints.

/// Play and losses of the gears on the drive joints. The encoder is on the motor's side of the gear; the wheel is on the
/// other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gear {
    /// The whole width of the play, rad of the joint, 0 to 1; default 0.5 degrees, of a small spur gearhead, assumed.
    pub backlash: f64,
    /// The part of the motor's power that reaches the wheel, and of the wheel's that reaches the motor where it is
    /// driven back, 0.01 to 1; default 0.9, of two stages, assumed.
    pub efficiency: f64,
    /// The part of the drive joint's inertia that sits on the motor's side of the gear, 0.01 to 0.99; default 0.8: seen
    /// through 17:1 the rotor's is most of it, assumed. Of a wheel with toe, a part of what the coupling of its joints leaves free,
    /// J_ph - J_c² / J_th.
    pub rotor_share: f64,
}

impl Default for Gear {
    fn default() -> Self {
        Self { backlash: 0.5 * core::f64::consts::PI / 180.0, efficiency: 0.9, rotor_share: 0.8 }
    }
}
