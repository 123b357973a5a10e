//! Counters over many ticks: damaged frames and energy, exactly at their limits.

use crate::prelude::*;
use hbot_core::design::rig::EnergyLimit;

fn damaged(bench: &mut Bench, frames: u16) -> Option<Cause> {
    bench.step_with(|inputs| inputs.corrupt_frames = frames).state.cause
}

#[test]
fn ten_damaged_frames_in_a_tick_are_a_fault_and_nine_are_not() {
    assert_eq!(damaged(&mut active(), 9), None);
    assert_eq!(damaged(&mut active(), 10), Some(Cause::LinkCorrupt));
}

#[test]
fn five_percent_of_damaged_frames_are_tolerated_for_ever_and_six_are_not() {
    // One frame in 20 ticks, and one in 16, at one frame a tick.
    for (every, after) in [(20, None), (16, Some(700..900))] {
        let mut bench = active();
        let fault = (0..20_000).find(|k| damaged(&mut bench, u16::from(k % every == 0)).is_some());
        match after {
            None => assert_eq!(fault, None, "one in {every}"),
            // The count rises by 1 - 16/20 in 16 ticks, from 0 to 10 in 800.
            Some(after) => {
                assert!(fault.is_some_and(|tick| after.contains(&tick)), "one in {every}: {fault:?}");
            }
        }
    }
}

#[test]
fn after_any_number_of_damaged_frames_the_link_recovers_in_200_ticks() {
    for frames in [100, u16::MAX] {
        let mut bench = active();
        assert_eq!(damaged(&mut bench, frames), Some(Cause::LinkCorrupt));
        // The count is at most 20 and falls by one in 20 ticks. Below 10 the link is good again.
        bench.run(194);
        assert!(matches!(bench.command(Command::Reset).reply(), Reply::Refused(_)), "{frames} frames");
        bench.run(6);
        assert_eq!(bench.command(Command::Reset).reply(), Reply::Done, "{frames} frames");
    }
}

#[test]
fn a_burst_of_energy_before_a_disable_does_not_count_after_it() {
    let limit = EnergyLimit { burst: 0.1, power: 1e-4 };
    let mut bench =
        Bench::active(altered(&rig(), |rig| rig.limits.energy = Some(limit)), CompiledScene::empty());
    // Gives out 90 % of the limit: 0.3 N m along 2 rad/s is 0.6 mJ a tick.
    let push = |bench: &mut Bench| {
        bench.command(stream(Vec3::X * 0.3, 1000));
        let before = bench.step().state.energy;
        let reached = (0..1000).find(|_| bench.turn(Vec3::X * 2.0).state.energy - before > 0.09);
        assert!(reached.is_some(), "0.09 J are reached");
        bench.sphere.omega = Vec3::ZERO;
        assert_eq!(bench.step().state.mode, Mode::Active);
    };
    push(&mut bench);
    bench.command(Command::Disable);
    assert!(!bench.run(100).drive.enable);
    assert_eq!(bench.command(Command::Enable).reply(), Reply::Done);
    assert_eq!(bench.run(600).state.mode, Mode::Active);
    push(&mut bench);
    // Without the disable the second burst would have been too much.
    let fault = (0..1000).find_map(|_| bench.turn(Vec3::X * 2.0).state.cause);
    assert_eq!(fault, Some(Cause::Overtorque));
}

/// Counts and rates agree all the time. What was the rate when the motors went off says nothing of
/// the first interval after they are on again.
#[test]
fn a_motion_that_ended_while_the_motors_were_off_is_no_fault_when_they_are_on_again() {
    for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE.normalize()] {
        let mut bench = Bench::active(rig(), CompiledScene::empty());
        let fast = axis * 25.0;
        assert!((0..30).all(|_| bench.turn(fast).state.cause.is_none()));
        bench.command(Command::Disable);
        let off = (0..1000).find(|_| !bench.turn(fast).drive.enable);
        assert!(off.is_some(), "the motors go off");
        bench.sphere.omega = Vec3::ZERO;
        bench.run(20);
        assert_eq!(bench.command(Command::Enable).reply(), Reply::Done);
        let fault = (0..200).find_map(|_| bench.step().state.cause);
        assert_eq!(fault, None, "after turning about {axis}");
    }
}
