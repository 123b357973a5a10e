//! The angular velocity by each rate estimate: with lost readings, after implausible readings, and
//! with motors that count backwards.

use crate::bench::{Bench, DT, altered, rig};
use hbot_core::Vec3;
use hbot_core::mode::Cause;
use hbot_core::outputs::State;
use hbot_core::rig::{RateEstimate, Rig};

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
