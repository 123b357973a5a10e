//! Numbers that are NaN, infinite, too large or too small. They are refused at the input or have no
//! effect, and leave no trace.

use super::super::core::inputs::{Command, Stamp};
use super::super::core::outputs::{Refusal, Reply};
use super::super::core::render::effects::{Anchor, Spring, SpringLaw};
use super::super::core::safety::mode::{Cause, Mode};
use super::super::core::{Device, Mat3, Quat, Real, Vec3};
use super::machine::{ReadRig, wheels};

const NONE: [Real; 3] = [Real::NAN, Real::INFINITY, Real::NEG_INFINITY];
const HUGE: [Real; 4] = [Real::MAX, Real::MIN, 1e38, -1e38];

/// Returns numbers below the smallest normal one, and that number itself, whose square underflows
/// to zero.
fn tiny() -> [Real; 4] {
    [Real::from_bits(1), -Real::from_bits(1), Real::MIN_POSITIVE * 0.5, Real::MIN_POSITIVE]
}

#[test]
fn feedback_that_cannot_be_is_a_fault_with_zero_torque() {
    for bad in NONE.into_iter().chain(HUGE) {
        for joint in 0..4 {
            let mut machine = ReadRig::active();
            machine.rates[joint] = bad;
            let outputs = machine.step(|_| {});
            let cause = if bad.is_finite() { Cause::ImplausibleFeedback } else { Cause::NonFinite };
            assert_eq!(
                (outputs.state.mode, outputs.state.cause),
                (Mode::Fault, Some(cause)),
                "{bad} of {joint}"
            );
            assert!(!outputs.drive.enable && outputs.state.torque == Vec3::ZERO);
            machine.works_again("a rate");
        }
    }
}

#[test]
fn requests_that_cannot_be_are_refused_and_change_nothing() {
    let stamp = Stamp::default();
    for bad in NONE {
        for k in 0..4 {
            let mut v = Vec3::splat(0.1);
            v[k % 3] = bad;
            let mut q = [0.0, 0.0, 0.0, 1.0];
            q[k] = bad;
            let (q, unit) = (Quat::from_array(q), Quat::IDENTITY);
            let reference =
                |q, omega| Command::Reference { slot: 0, epoch: 1, q, omega, valid_ticks: 9, stamp };
            let mut machine = ReadRig::active();
            let before = machine.step(|_| {}).state;
            for command in [
                Command::Stream { torque: v, valid_ticks: 9, stamp },
                reference(unit, v),
                reference(q, Vec3::ZERO),
                Command::Align { q, weight: 1.0, tick: 3 },
                Command::Align { q: unit, weight: bad, tick: 3 },
                Command::Align { q: unit, weight: -0.001, tick: 3 },
                Command::Align { q: unit, weight: 1.001, tick: 3 },
                Command::Align { q: unit, weight: Real::MAX, tick: 3 },
                // Their lengths are no numbers.
                Command::Align { q: Quat::from_xyzw(0.0, Real::MAX, 0.0, 1.0), weight: 1.0, tick: 3 },
                reference(Quat::from_xyzw(Real::MIN, 0.0, 0.0, 1.0), Vec3::ZERO),
            ] {
                assert_eq!(machine.command(command), Reply::Refused(Refusal::NotFinite), "{command:?}");
                let state = machine.step(|_| {}).state;
                assert_eq!(
                    (state.torque, state.q, state.mode),
                    (before.torque, before.q, Mode::Active),
                    "{command:?}"
                );
            }
        }
    }
}

#[test]
fn what_is_huge_is_limited_or_a_fault() {
    for huge in HUGE {
        let mut machine = ReadRig::active();
        let command = Command::Stream { torque: Vec3::Y * huge, valid_ticks: 50, stamp: Stamp::default() };
        assert_eq!(machine.command(command), Reply::Done);
        for _ in 0..200 {
            // Torques are checked against the motors' peak torques in every tick.
            let state = machine.step(|_| {}).state;
            assert!(state.torque.length() <= 0.5 * (1.0 + 8.0 * Real::EPSILON), "{}", state.torque);
            assert!(matches!(state.cause, None | Some(Cause::NonFinite)), "{:?}", state.cause);
        }
        machine.works_again("a torque");
    }
}

#[test]
fn what_is_tiny_is_nothing() {
    for tiny in tiny() {
        let mut machine = ReadRig::active();
        let before = machine.step(|_| {}).state;
        machine.rates = [tiny; 16];
        let command = Command::Stream { torque: Vec3::splat(tiny), valid_ticks: 50, stamp: Stamp::default() };
        assert_eq!(machine.command(command), Reply::Done);
        let state = machine.run(100).state;
        assert_eq!((state.mode, state.q), (Mode::Active, before.q));
        assert!((state.torque - before.torque).length() <= 8.0 * Real::EPSILON, "{tiny:e}: {}", state.torque);
        machine.works_again("a denormal");
    }
}

#[test]
fn designs_and_springs_of_no_numbers_are_refused() {
    for bad in NONE {
        let mut one = wheels();
        one[0].axis.y = bad;
        assert!(Device::new(0.102, 0.467, &one).is_err());
        assert!(Device::new(bad, 0.467, &wheels()).is_err());
        assert!(Device::new(0.102, bad, &wheels()).is_err());
        for place in 0..9 {
            let mut m = Mat3::IDENTITY.to_cols_array();
            m[place] = bad;
            let m = Mat3::from_cols_array(&m);
            let spring = |k, d| Spring::new(SpringLaw::Quaternion, k, d, Quat::IDENTITY, Anchor::Absolute);
            assert_eq!(spring(m, Mat3::ZERO), None, "{m}");
            assert_eq!(spring(Mat3::IDENTITY, m), None, "{m}");
        }
    }
}
