//! What a real rig shows besides the ideal one, each on request, none otherwise.
//!
//! The tables of figures are those of scene files (`[simulate]`, hbot-config): each phenomenon is one,
//! and its `default()` has the prototype's figures, or those usual of such parts. What is `None` costs
//! nothing: no state, no instruction but the look whether it is there. `docs/simulator.md` has the
//! equation, the source and the validation of each.
//!
//! | where it acts | phenomena |
//! |---|---|
//! | the plant | [`JointFriction`], [`CageFriction`], [`Slip`], [`Pivoting`], [`Eccentric`], [`WheelModules`], [`Gear`] |
//! | the controllers | [`Encoder`], [`Motor`] |
//! | the line | [`Link`] |
//! | the sphere | [`Hand`] |
//!
//! What is random comes from a seed: the same figures and the same bytes in give the same bytes out.

pub use hbot_config::scene::{
    CageFriction, Eccentric, Encoder, Gear, Hand, JointFriction, Link, Motor, Pivoting,
    Simulate as Phenomena, Slip, WheelModules,
};

/// The phenomena of the plant alone; a hand is not the plant's.
#[must_use]
pub fn of_plant(phenomena: &Phenomena) -> Phenomena {
    // All by name: a new phenomenon does not compile until somebody says whose it is.
    let Phenomena {
        joint_friction,
        cage_friction,
        slip,
        pivoting,
        eccentric,
        wheel_modules,
        gear,
        encoder: _,
        motor: _,
        link: _,
        hand: _,
    } = *phenomena;
    Phenomena {
        joint_friction,
        cage_friction,
        slip,
        pivoting,
        eccentric,
        wheel_modules,
        gear,
        ..Phenomena::default()
    }
}

/// The dry friction of a joint at `rate` (rad/s), N m; at rest the torque that it withstands. The
/// viscous part is not in it.
///
/// coulomb + (breakaway - coulomb) exp(-(rate / stribeck_rate)²), the Gaussian form of the Stribeck
/// curve (Armstrong-Hélouvry, Dupont and Canudas de Wit 1994). A breakaway below coulomb counts as
/// coulomb.
#[must_use]
pub fn dry_friction(friction: &JointFriction, rate: f64) -> f64 {
    let more = friction.breakaway - friction.coulomb;
    if !(more > 0.0) {
        return friction.coulomb;
    }
    let x = rate / friction.stribeck_rate;
    friction.coulomb + more * libm::exp(-x * x)
}

/// The largest friction force mu N of a contact, N.
#[must_use]
pub fn largest_grip(slip: &Slip) -> f64 {
    slip.mu * slip.normal_force
}

/// The largest torque of a contact about its normal c3, N m: that of a flat round patch under even
/// pressure, (2/3) mu N a (0.53 mN m by default).
///
/// Under Hertz's pressure, which is greater in the middle, it would be (3 pi/16) mu N a (Johnson,
/// *Contact Mechanics*, 1985), 12 % less: well within what one knows of a or mu.
#[must_use]
pub fn largest_pivoting_torque(pivoting: &Pivoting) -> f64 {
    2.0 / 3.0 * pivoting.mu * pivoting.normal_force * pivoting.patch_radius
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stribeck_curve_starts_at_breakaway_and_ends_at_coulomb() {
        let friction = JointFriction { breakaway: 5.0e-4, ..JointFriction::default() };
        assert_eq!(dry_friction(&friction, 0.0), 2.0e-4 + (5.0e-4 - 2.0e-4));
        // One e-th of the peak is left at the Stribeck rate, either way; rounding alone.
        for rate in [0.5, -0.5] {
            let expected = 2.0e-4 + 3.0e-4 / core::f64::consts::E;
            assert!((dry_friction(&friction, rate) - expected).abs() < 1e-18);
        }
        assert_eq!(dry_friction(&friction, 100.0), 2.0e-4);
        // No peak: the same at every rate, and a breakaway below Coulomb's counts as none.
        assert_eq!(dry_friction(&JointFriction::default(), 0.1), 2.0e-4);
        assert_eq!(dry_friction(&JointFriction { breakaway: 0.0, ..friction }, 0.0), 2.0e-4);
    }

    #[test]
    fn limits_are_those_of_the_physics_notes() {
        assert_eq!(largest_grip(&Slip::default()), 8.0);
        // 2/3 of 0.8 x 10 N x 0.1 mm, to rounding.
        assert!((largest_pivoting_torque(&Pivoting::default()) - 1.6e-3 / 3.0).abs() < 1e-18);
    }
}
