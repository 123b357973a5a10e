use super::loan::{Loan, Moment};
use crate::design::rig::Friction;
use crate::real::{Real, TURN, Vec3};

const DT: Real = 1.0e-3;
/// A sphere that turns at 1 rad/s, whose energies show no hand.
const TURNING: Moment =
    Moment { dt: DT, omega: Vec3::X, kinetic: 2.0e-3, given: 0.0, lost: 4.0e-6, quiet: true, still: false };

/// Advances `loan` by `ticks`. Without a hand the motors give what friction takes.
fn turned(loan: &mut Loan, now: Moment, ticks: u32, given: &mut Real) {
    for _ in 0..ticks {
        *given += now.given + now.lost;
        loan.advance(&Moment { given: *given, ..now }, true);
    }
}

#[test]
fn a_loan_lasts_a_turn_and_fades_over_the_next() {
    let (mut loan, mut given) = (Loan::START, 0.0);
    let ticks = |turns: Real| (turns * TURN / DT) as u32;
    turned(&mut loan, TURNING, ticks(0.99), &mut given);
    assert_eq!(loan.gain(), 1.0);
    turned(&mut loan, TURNING, ticks(0.51), &mut given);
    // The gain follows within 0.1 s, in which the sphere turns by 0.016 turns.
    assert!((loan.gain() - 0.5).abs() < 0.02, "{}", loan.gain());
    turned(&mut loan, TURNING, ticks(0.6), &mut given);
    assert_eq!(loan.gain(), 0.0);
    // A rest renews it: within 20 ms if the scene is quiet, else within 0.25 s.
    let rest = Moment { omega: Vec3::ZERO, lost: 0.0, still: true, ..TURNING };
    let mut other = loan.clone();
    turned(&mut loan, rest, 19, &mut given);
    assert_eq!(loan.gain(), 0.0);
    turned(&mut loan, rest, 101, &mut given);
    assert!(loan.gain() > 0.99);
    turned(&mut other, Moment { quiet: false, ..rest }, 240, &mut given);
    assert_eq!(other.gain(), 0.0);
    turned(&mut other, Moment { quiet: false, ..rest }, 120, &mut given);
    assert!(other.gain() > 0.99);
}

#[test]
fn a_sphere_that_turns_back_by_itself_is_held_by_a_hand() {
    for (quiet, renewed) in [(true, true), (false, false)] {
        let (mut loan, mut given) = (Loan::START, 0.0);
        turned(&mut loan, Moment { quiet, ..TURNING }, 14_000, &mut given);
        assert_eq!(loan.gain(), 0.0);
        // Turned across, then back.
        turned(&mut loan, Moment { quiet, omega: Vec3::Y, ..TURNING }, 100, &mut given);
        assert_eq!(loan.gain(), 0.0, "across is not back");
        turned(&mut loan, Moment { quiet, omega: -Vec3::X, ..TURNING }, 300, &mut given);
        assert_eq!(loan.gain() > 0.99, renewed);
    }
}

/// A hand that pushes against a spring, which takes 1 W, or that speeds the sphere up.
#[test]
fn energies_that_motors_and_friction_do_not_explain_show_a_hand() {
    for (name, power, renewed) in [("nobody", 0.0, false), ("pushes", -1.0, true), ("is pushed", 1.0, true)] {
        let (mut loan, mut given) = (Loan::START, 0.0);
        turned(&mut loan, TURNING, 14_000, &mut given);
        turned(&mut loan, Moment { given: power * DT, ..TURNING }, 300, &mut given);
        assert_eq!(loan.gain() > 0.9, renewed, "{name}");
    }
    // What the true friction takes more or less than the measured one is no hand.
    for part in [0.0, 0.5, 1.0] {
        let (mut loan, mut given) = (Loan::START, 0.0);
        turned(&mut loan, Moment { given: (part - 1.0) * TURNING.lost, ..TURNING }, 14_300, &mut given);
        assert_eq!(loan.gain(), 0.0, "{part} of the friction");
    }
}

#[test]
fn the_friction_that_is_fed_is_odd_flat_at_rest_and_below_the_measured_one() {
    let friction = Friction { coulomb: 2.0e-4, viscous: 1.0e-5 };
    let at = |rate| friction.against(rate, 0.02);
    assert_eq!(at(0.0), 0.0);
    for rate in [1.0e-5, 1.0e-3, 0.02, 0.3, 20.0] {
        assert_eq!(at(-rate), -at(rate));
        assert!(at(rate) < 2.0e-4 + 1.0e-5 * rate);
        // The energy it gives is at most what the friction takes.
        assert!(at(rate) * rate <= friction.loss(rate * rate));
    }
    // A hundredth of the smoothing gets a millionth of the dry friction.
    assert!((at(2.0e-4) - 1.0e-5 * 2.0e-4) < 2.001e-10);
    let along = friction.along(Vec3::new(0.0, 0.3, -0.4), 0.02);
    assert!((along - Vec3::new(0.0, 0.6, -0.8) * at(0.5)).length_squared() < 1.0e-20);
}
