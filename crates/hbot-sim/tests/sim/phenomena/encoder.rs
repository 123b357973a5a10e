//! Encoder phenomena: coarse steps, an error that repeats every turn, and a wrong zero.

use core::f64::consts::TAU;

use hbot_link::{Feedback, JointFlags};
use hbot_sim::controller::EncoderKind;
use hbot_sim::phenomena::Encoder;

use crate::line::messages;
use crate::prelude::*;

/// Encoder parameters that cause no errors.
const EXACT: Encoder = Encoder { step: 1, turn_error: 0.0, index_error: 0.0, seed: 1 };

fn with(encoder: Option<Encoder>, kind: EncoderKind) -> SimulatedRig {
    let mut config = SimulatedConfig::new(&rig());
    for joint in &mut config.joints {
        (joint.encoder, joint.reversed) = (kind, false);
    }
    config.phenomena = Phenomena { encoder, ..Phenomena::default() };
    SimulatedRig::new(&config).unwrap()
}

fn read(rig: &mut SimulatedRig) -> Feedback {
    let mut reply = Vec::new();
    rig.receive(0, &frame(&ToController::Command(command(1, false, &[0.0; 4]))), &mut reply);
    match messages(&reply).pop() {
        Some(FromController::Feedback(feedback)) => feedback,
        other => panic!("{other:?}"),
    }
}

fn counts(rig: &mut SimulatedRig, steer: f64, drive: f64) -> [i32; 4] {
    rig.set_state(PlantState { steer: [steer; 8], drive: [drive; 8], ..PlantState::default() });
    let feedback = read(rig);
    core::array::from_fn(|j| feedback.joints[j].count)
}

#[test]
fn a_coarse_encoder_counts_in_steps() {
    let mut coarse = with(Some(Encoder { step: 64, ..EXACT }), EncoderKind::Absolute);
    let mut fine = with(None, EncoderKind::Absolute);
    for i in -500..500 {
        let angle = f64::from(i) * 0.0123;
        let (coarse, fine) = (counts(&mut coarse, angle, angle), counts(&mut fine, angle, angle));
        for j in 0..4 {
            assert_eq!(coarse[j], fine[j].div_euclid(64) * 64, "joint {j} at {angle}");
        }
    }
    let mut exact = with(Some(EXACT), EncoderKind::Absolute);
    assert_eq!(counts(&mut exact, 1.234, -5.6), counts(&mut fine, 1.234, -5.6));
}

/// Reads an encoder over one turn of its shaft and fits a sine to the error. Returns the amplitude
/// of the sine (rad of the encoder), its phase, and the largest residual.
fn fitted(rig: &mut SimulatedRig, joint: usize, gear: f64) -> (f64, f64, f64) {
    const N: u32 = 2000;
    let errors: Vec<(f64, f64)> = (0..N)
        .map(|i| {
            let turned = TAU * f64::from(i) / f64::from(N);
            let count = counts(rig, turned / gear, turned / gear)[joint];
            // A count stands for the middle of its interval.
            (turned, (f64::from(count) + 0.5) * TAU / 16384.0 - turned)
        })
        .collect();
    let mean =
        |f: &dyn Fn(f64, f64) -> f64| errors.iter().map(|(x, e)| f(*x, *e)).sum::<f64>() / f64::from(N);
    let (offset, sine, cosine) =
        (mean(&|_, e| e), 2.0 * mean(&|x, e| e * x.sin()), 2.0 * mean(&|x, e| e * x.cos()));
    let left = errors.iter().map(|(x, e)| (e - offset - sine * x.sin() - cosine * x.cos()).abs());
    (sine.hypot(cosine), cosine.atan2(sine), left.fold(0.0, f64::max))
}

#[test]
fn a_disc_out_of_centre_errs_by_a_sine_a_turn() {
    let count = TAU / 16384.0;
    let encoder = Encoder { turn_error: 0.02, ..EXACT };
    let mut seen = Vec::new();
    for (joint, gear) in [(0, 1.0), (1, 17.0), (2, 1.0), (3, 17.0)] {
        let (amplitude, phase, left) = fitted(&mut with(Some(encoder), EncoderKind::Absolute), joint, gear);
        // Counts give a uniform error of at most half a count. Averaged over 2000 readings it is a
        // small part of that.
        assert!((amplitude - 0.02).abs() < 0.1 * count, "joint {joint}: {amplitude}");
        assert!(left < 0.6 * count, "joint {joint}: {left}");
        seen.push(phase);
    }
    assert!((seen[0] - seen[2]).abs() > 0.01 && (seen[1] - seen[3]).abs() > 0.01, "{seen:?}");
    // The phase depends on the seed and on nothing else.
    let phase = |seed| fitted(&mut with(Some(Encoder { seed, ..encoder }), EncoderKind::Absolute), 0, 1.0).1;
    assert_eq!(phase(1), seen[0]);
    assert!((phase(2) - seen[0]).abs() > 0.01);
    // An incremental encoder starts at zero for any phase of its disc.
    assert_eq!(counts(&mut with(Some(encoder), EncoderKind::Incremental), 0.0, 0.0), [0; 4]);
}

/// If an encoder's angle error varies over a turn, the rate that it reports has the matching error:
/// the reported rate, divided by the true rate, equals the slope of the encoder counts over the
/// true angle.
#[test]
fn the_rate_errs_with_the_angle() {
    let mut bad = with(Some(Encoder { turn_error: 0.1, ..EXACT }), EncoderKind::Absolute);
    let mut widest: f64 = 0.0;
    for i in 0..50 {
        let angle = f64::from(i) * 0.11;
        let state = PlantState { steer: [angle; 8], ..brisk() };
        bad.set_state(state);
        let rate = bad.joint_rates()[0];
        let told = f64::from(read(&mut bad).joints[0].rate);
        let h = 0.05;
        let (before, after) = (counts(&mut bad, angle - h, 0.0)[0], counts(&mut bad, angle + h, 0.0)[0]);
        let slope = f64::from(after - before) * TAU / 16384.0 / (2.0 * h);
        // One count over the interval is 4e-3. The error of the difference, h²/6 of the sine, is
        // 4e-5.
        assert!((told / rate - slope).abs() < 5e-3, "{angle}: {} {slope}", told / rate);
        widest = widest.max((told / rate - 1.0).abs());
    }
    assert!(widest > 0.09);
}

#[test]
fn a_zero_is_off_where_it_is_taken() {
    let off = Encoder { index_error: 0.1, ..EXACT };
    let count = 16384.0 / TAU;
    // Mounting error: equal at the start and after a reboot, and different for each joint.
    let mut rig = with(Some(off), EncoderKind::Absolute);
    let zeros = counts(&mut rig, 0.0, 0.0);
    assert!(zeros.iter().all(|zero| zero.abs() > 0) && zeros[0] != zeros[2], "{zeros:?}");
    assert!(f64::from(zeros[0].abs()) <= 0.1 * count + 1.0);
    assert!(f64::from(zeros[1].abs()) <= 0.1 * 17.0 * count + 1.0, "of the joint, behind the gear");
    rig.inject(InjectedFault::Reboot);
    assert_eq!(counts(&mut rig, 0.0, 0.0), zeros);
    // Index error: it acts when the index is passed, not before.
    let mut indexed = with(None, EncoderKind::Indexed);
    counts(&mut indexed, 0.5, 0.5);
    indexed.inject(InjectedFault::Reboot);
    indexed.set_phenomena(Phenomena { encoder: Some(off), ..Phenomena::default() });
    assert_eq!(counts(&mut indexed, 0.5, 0.5), [0; 4]);
    let passed = counts(&mut indexed, -0.1, -0.1);
    assert!(read(&mut indexed).joints[0].flags.contains(JointFlags::INDEX_SEEN));
    let exact = |gear: f64| (-0.1 * gear * count).floor() as i32;
    for (j, gear) in [1.0, 17.0, 1.0, 17.0].into_iter().enumerate() {
        // Both counts are rounded down.
        assert!((passed[j] - exact(gear) - zeros[j]).abs() <= 1, "joint {j}: {passed:?} {zeros:?}");
    }
}

/// When encoder errors are switched on or off while the rig runs, no encoder count jumps. The
/// server would take such a jump for a motion of the joint.
#[test]
fn counts_do_not_jump_when_errors_come_and_go() {
    for kind in [EncoderKind::Absolute, EncoderKind::Incremental] {
        let mut rig = with(None, kind);
        let before = counts(&mut rig, 0.7, -0.4);
        for encoder in [Some(Encoder { turn_error: 0.1, index_error: 0.5, ..EXACT }), None, Some(EXACT), None]
        {
            rig.set_phenomena(Phenomena { encoder, ..Phenomena::default() });
            let after = counts(&mut rig, 0.7, -0.4);
            // Rounding of a sum can move the result across a count.
            assert!((0..4).all(|j| (after[j] - before[j]).abs() <= 1), "{encoder:?}: {before:?} {after:?}");
        }
    }
}
