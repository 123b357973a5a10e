//! The angular velocity by each rate estimate: with lost readings, after implausible readings, and
//! with motors that count backwards.

use crate::prelude::*;
use hbot_config::RigConfig;
use hbot_config::advice::RateAdvice;
use hbot_core::motion::rates::step_response;

/// Each estimate with its largest allowed error of the sphere's rate, rad/s, at a steady turn of
/// 0.7 rad/s with 4096 x 4 counts.
const ESTIMATES: [(RateEstimate, f64); 5] = [
    (RateEstimate::Controller, 1e-3),
    // One count of each joint over the shortest step is 0.38 rad/s of the steering, and 0.066 of
    // that at the sphere, for two wheels.
    (RateEstimate::Difference, 0.13),
    // A filter of 100 Hz leaves half of that. It is 2 ms late, in which the steering rate changes
    // by 7 %.
    (RateEstimate::LowPass { cutoff_hz: 100.0 }, 0.1),
    (RateEstimate::AdaptiveWindow { tolerance_counts: 1, longest_ticks: 32 }, 0.06),
    (RateEstimate::Kalman { acceleration: 100.0 }, 0.06),
];

fn rig_with(rate: RateEstimate) -> Rig {
    altered(&rig(), |rig| (rig.methods.rate, rig.joints[1].reversed) = (rate, true))
}

/// Runs a tick in which the sphere turns. All counts from [`Bench`] run forwards, but the second
/// joint of this rig counts backwards.
fn turn(bench: &mut Bench, omega: Vec3, heard: bool) -> State {
    let mut reading = bench.feedback();
    reading.counts[1] = -reading.counts[1];
    reading.rates[1] = -reading.rates[1];
    bench.sphere.turn(omega, DT);
    bench.step_with(|inputs| inputs.feedback = heard.then_some(reading)).state
}

#[test]
fn lost_readings_make_no_rate_wrong() {
    let omega = Vec3::new(0.42, -0.336, 0.448);
    for (rate, within) in ESTIMATES {
        for lost in [1000, 7, 3] {
            let mut bench = Bench::new(rig_with(rate));
            let mut worst: f64 = 0.0;
            for k in 0..1500_u32 {
                // Sometimes two readings in a row are lost.
                let heard = k % lost != 0 && k % (5 * lost) != 1;
                let estimate = turn(&mut bench, omega, heard).omega;
                if k > 200 {
                    worst = worst.max((estimate - omega).length());
                }
            }
            assert!(worst < within, "{rate:?}, one in {lost} lost: {worst} rad/s");
        }
    }
}

#[test]
fn after_an_implausible_reading_rates_begin_anew() {
    let omega = Vec3::Y;
    for (rate, within) in ESTIMATES {
        let mut bench = Bench::new(rig_with(rate));
        for _ in 0..200 {
            turn(&mut bench, omega, true);
        }
        // The counts jump and return, so that the angles are right again.
        let jump = bench.rig().joints[0].counts_per_turn as i32 * 3 / 5;
        for jump in [jump, -jump] {
            bench.offset[0] += jump;
            assert_eq!(turn(&mut bench, omega, true).cause, Some(Cause::ImplausibleFeedback));
        }
        let after: Vec<Vec3> = (0..200).map(|_| turn(&mut bench, omega, true).omega).collect();
        // The jump leaves no trace: there is ordinary noise, and a start from zero if the estimate
        // has one.
        for (k, estimate) in after.iter().enumerate() {
            let off = (*estimate - omega).length();
            assert!(
                off < if k < 30 { omega.length() + within } else { 1.5 * within },
                "{rate:?}: {off} at {k}"
            );
        }
    }
}

/// Returns the noise of the sphere's rate (rad/s) and the ripple of the torque of a spring of 1 N
/// m/rad without damping (N m), both rms of the length of the vector. The sphere moves by some mrad
/// at some Hz after the turn `before`. Also returns the steer angles there.
fn noise(rig: &Rig, before: Vec3) -> ([f64; 2], Vec<f64>) {
    const BLOCK: usize = 100;
    let n = rig.device.joints();
    let weights: Vec<Vec<f64>> = (0..n)
        .map(|joint| {
            let mut steps = [0.0; 128];
            assert!(step_response(rig, joint, &mut steps));
            let earlier = std::iter::once(0.0).chain(steps);
            steps.iter().zip(earlier).map(|(step, earlier)| step - earlier).collect()
        })
        .collect();
    let scene = CompiledScene::new(1, &[effect(0, 1, spring(1.0, 0.0, Quat::IDENTITY, Anchor::Absolute))]);
    let mut bench = Bench::active(*rig, scene.expect("one effect"));
    for _ in 0..200 {
        bench.turn(before * (1.0 / (200.0 * DT)));
    }
    let steer = bench.sphere.steering()[..n / 2].to_vec();
    let mut angles: Vec<[f64; MAX_JOINTS]> = Vec::new();
    let (mut squares, mut ticks, mut ripples) = (0.0, 0.0, Vec::new());
    for tick in 0..4000_u32 {
        let swing = |hertz: f64| 0.35 * libm::cos(std::f64::consts::TAU * hertz * f64::from(tick) * DT);
        let (pose, joints) = (bench.sphere.q, bench.sphere.angles());
        angles.insert(0, joints);
        angles.truncate(128);
        let state = bench.turn(Vec3::new(swing(5.3), swing(4.1), swing(3.7))).state;
        if tick < 200 {
            continue;
        }
        // What the estimate would make of angles that are not rounded.
        let rates: [f64; MAX_JOINTS] = core::array::from_fn(|joint| {
            let of = weights.get(joint).into_iter().flatten().zip(&angles);
            of.map(|(weight, angles)| weight * angles[joint]).sum()
        });
        let posture = Posture::new(&rig.device, &bench.sphere.steering()[..n / 2]);
        let exact = posture.forward(&rig.device, &rates[..n]).omega;
        squares += (state.omega - exact).length_squared();
        ticks += 1.0;
        let lead = 1.0e-6 * state.lead_us;
        ripples.push(state.torque + rotation::log(rotation::exp(exact * lead) * pose));
    }
    // The integrated orientation drifts slowly. A hand does not feel that.
    let mut ripple = 0.0;
    for block in ripples.chunks_exact(BLOCK) {
        let mean = block.iter().fold(Vec3::ZERO, |sum, r| sum + *r) * (1.0 / BLOCK as f64);
        ripple += block.iter().map(|r| (*r - mean).length_squared()).sum::<f64>() / (BLOCK - 1) as f64;
    }
    let blocks = (ripples.len() / BLOCK) as f64;
    ([(squares / ticks).sqrt(), (ripple / blocks).sqrt()], steer)
}

/// The noise that `rate_estimate = "auto"` computes from the weights of an estimate is that of the
/// control law in motion, in several postures. The spring's torque has both the rounding of the
/// angle and the noise of the rate.
#[test]
fn the_computed_noise_is_that_of_the_control_law() {
    // The rounding of coarser counts is less independent from tick to tick.
    for counts in [16384, 4096] {
        for rate in [
            RateEstimate::Difference,
            RateEstimate::LowPass { cutoff_hz: 100.0 },
            RateEstimate::Kalman { acceleration: 30.0 },
            RateEstimate::Kalman { acceleration: 300.0 },
        ] {
            let rig = altered(&rig(), |rig| {
                rig.methods.rate = rate;
                rig.torque_lag = 5.0e-4;
                rig.lead = Some(LeadTime::default());
                rig.limits.slip = 10.0;
                rig.limits.torque_rate = 1.0e5;
                rig.joints[..4].iter_mut().for_each(|joint| joint.counts_per_turn = counts);
            });
            for before in [Vec3::ZERO, Vec3::new(0.5, 0.3, -0.4), Vec3::new(-0.2, 0.6, 0.9)] {
                let (found, steer) = noise(&rig, before);
                let config = RigConfig { rig, torque_lag: 5.0e-4, ..RigConfig::prototype() };
                let quality = RateAdvice::at(&config, &steer).expect("legal inertias").quality(rate);
                for (found, want) in found.into_iter().zip([quality.noise, quality.ripple]) {
                    let ratio = found / want;
                    assert!((ratio - 1.0).abs() < 0.1, "{counts} {rate:?} {before}: {found}, not {want}");
                }
            }
        }
    }
}
