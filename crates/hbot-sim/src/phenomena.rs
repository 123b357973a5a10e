//! Phenomena: properties of a real rig, such as friction, that the simulated rig shows on request.
//!
//! Without a request the simulated rig is ideal. The types are the tables of `[simulate]` in scene
//! files (hbot-config), one for each phenomenon. Their `default()` has the values of the prototype,
//! or typical values of such parts. A phenomenon that is `None` needs no state and costs only the
//! test for `None`. The equation of each is in `docs/simulator.md`.
//!
//! | where it acts | phenomena |
//! |---|---|
//! | the plant: friction | [`JointFriction`], [`CageFriction`], [`Slip`], [`Pivoting`] |
//! | the plant: weight and play | [`Eccentric`], [`Imbalance`], [`WheelModules`], [`Gear`] |
//! | the plant: parts that give way | [`Compliance`] |
//! | the motor controllers | [`Encoder`], [`Motor`] |
//! | the motors' shafts | [`TorqueConstants`], [`Cogging`] |
//! | the line | [`Link`] |
//! | the sphere | [`Hand`] |
//!
//! Random numbers come from a seed. Equal parameters and equal input bytes give equal output bytes.

pub use hbot_config::scene::Simulate as Phenomena;
pub use hbot_config::scene::simulate::*;

/// Returns a copy of `phenomena` without those that do not act in the plant.
#[must_use]
pub fn of_plant(phenomena: &Phenomena) -> Phenomena {
    Phenomena {
        encoder: None,
        motor: None,
        torque_constants: None,
        cogging: None,
        link: None,
        hand: None,
        ..*phenomena
    }
}

/// Returns the dry friction torque of a joint that turns at `rate` (rad/s), in N m. Viscous
/// friction is not included.
///
/// At `rate` 0 it is the largest torque that friction holds at rest.
///
/// The value is `coulomb + (breakaway - coulomb) exp(-(rate / stribeck_rate)²)`, the Gaussian form
/// of the Stribeck curve (Armstrong-Hélouvry, Dupont and Canudas de Wit 1994). If `breakaway` is
/// below `coulomb`, `coulomb` is used.
#[must_use]
pub fn dry_friction(friction: &JointFriction, rate: f64) -> f64 {
    let more = friction.breakaway - friction.coulomb;
    if !(more > 0.0) {
        return friction.coulomb;
    }
    let x = rate / friction.stribeck_rate;
    friction.coulomb + more * libm::exp(-x * x)
}

/// Returns the largest friction force of a contact, N. It is the friction coefficient times the
/// normal force.
#[must_use]
pub fn largest_grip(slip: &Slip) -> f64 {
    slip.mu * slip.normal_force
}

/// Returns the largest friction torque of a contact about its normal c3, N m.
///
/// It is (2/3) mu N a for a flat round patch of radius a under even pressure, with the friction
/// coefficient mu and the normal force N: 0.53 mN m by default. Under Hertzian pressure, which is
/// greater in the middle, it would be (3 pi/16) mu N a (Johnson, *Contact Mechanics*, 1985). That
/// is 12 % less, well within the uncertainty of a and mu.
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
        // At plus or minus the Stribeck rate 1/e of the peak is left. The tolerance is rounding.
        for rate in [0.5, -0.5] {
            let expected = 2.0e-4 + 3.0e-4 / core::f64::consts::E;
            assert!((dry_friction(&friction, rate) - expected).abs() < 1e-18);
        }
        assert_eq!(dry_friction(&friction, 100.0), 2.0e-4);
        // Without a peak, friction is equal at every rate. A breakaway below Coulomb means no peak.
        assert_eq!(dry_friction(&JointFriction::default(), 0.1), 2.0e-4);
        assert_eq!(dry_friction(&JointFriction { breakaway: 0.0, ..friction }, 0.0), 2.0e-4);
    }

    #[test]
    fn limits_are_those_of_the_physics_notes() {
        assert_eq!(largest_grip(&Slip::default()), 8.0);
        // 2/3 of 0.8 x 10 N x 0.1 mm. The tolerance is rounding.
        assert!((largest_pivoting_torque(&Pivoting::default()) - 1.6e-3 / 3.0).abs() < 1e-18);
    }
}
