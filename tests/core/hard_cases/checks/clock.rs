//! Ticks that are late, repeated, in the past or far ahead, and feedback that stops.

use super::super::core::safety::mode::{Cause, Mode};
use super::super::core::{Real, Vec3};
use super::machine::ReadRig;

#[test]
fn a_tick_ten_periods_late_rides_through_and_one_too_late_is_a_fault() {
    // Each tick is as late as it may be, and the nine ticks in between are skipped.
    let mut machine = ReadRig::active();
    let before = machine.step(|_| {}).state;
    for k in 0..50 {
        machine.tick += 9;
        let state = machine.step(|inputs| inputs.lateness_ns = 20_000_000).state;
        assert_eq!((state.mode, state.cause), (Mode::Active, None), "{k}");
        assert!((state.torque - before.torque).length() <= 8.0 * Real::EPSILON);
    }
    for (late_ns, skipped) in [(20_000_001, 0), (u64::MAX, 0), (0, 10), (0, 1 << 40)] {
        let mut machine = ReadRig::active();
        machine.tick += skipped;
        let outputs = machine.step(|inputs| inputs.lateness_ns = late_ns);
        assert_eq!(outputs.state.mode, Mode::Fault, "{late_ns} ns, {skipped} skipped");
        assert_eq!(outputs.state.cause, Some(Cause::Deadline), "{late_ns} ns, {skipped} skipped");
        assert!(!outputs.drive.enable && outputs.state.torque == Vec3::ZERO);
        machine.works_again("late");
    }
}

#[test]
fn a_clock_that_stands_or_goes_back_moves_nothing() {
    for back in [0, 1, 10, 500] {
        let mut machine = ReadRig::idle();
        machine.run(600);
        machine.command(super::super::core::inputs::Command::Enable);
        let before = machine.run(100).state;
        let now = machine.tick - 1;
        for _ in 0..200 {
            machine.tick = now - back;
            let state = machine.step(|_| {}).state;
            assert_eq!(state.mode, Mode::Enabling, "{back}");
            // A ramp that continued would have ended long ago.
            let moved = (state.torque - before.torque).length();
            assert!(moved <= 8.0 * Real::EPSILON, "{back}: {moved:e}");
        }
        // The clock returns to its old value. The missing ticks count as skipped, and more than
        // nine of them are a fault.
        machine.tick = now + 1;
        let state = machine.step(|_| {}).state;
        if back < 10 {
            assert_eq!((state.mode, state.cause), (Mode::Enabling, None), "{back}");
            assert!(state.torque.length() > before.torque.length());
        } else {
            assert_eq!((state.mode, state.cause), (Mode::Fault, Some(Cause::Deadline)), "{back}");
            machine.works_again("a clock that went back");
        }
    }
}

#[test]
fn feedback_that_stays_away_ends_the_torque_and_comes_back() {
    let mut machine = ReadRig::active();
    for k in 1..=20 {
        let state = machine.step(|inputs| inputs.feedback = None).state;
        assert_eq!((state.mode, state.fresh), (Mode::Active, false), "{k}");
    }
    let outputs = machine.step(|inputs| inputs.feedback = None);
    assert_eq!(outputs.state.cause, Some(Cause::LinkLost));
    assert!(!outputs.drive.enable && outputs.state.torque == Vec3::ZERO);
    for _ in 0..200 {
        machine.step(|inputs| inputs.feedback = None);
    }
    machine.works_again("a link that was lost");
}
