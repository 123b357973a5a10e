//! Tests of the computing time and the error that a rig's methods have: their choice, the readings
//! of the test motion, the ticks that are followed, and the comparison with the true orientation.

use super::*;

fn choice(odometry: OdometryMethod, ns: f64, error: f64) -> Expectation {
    Expectation { odometry, path: PathFit::Straight, ns, error, time_s: 10.0 }
}

#[test]
fn the_cheapest_that_is_good_enough() {
    let euler = choice(OdometryMethod::Euler, 100.0, 1e-2);
    let midpoint = choice(OdometryMethod::Midpoint, 104.0, 1e-4);
    let magnus = choice(OdometryMethod::Magnus4, 200.0, 1e-8);
    let all = [euler, midpoint, magnus];
    // The midpoint method costs the same as Euler to within 5 %, and is more accurate.
    assert_eq!(pick(&all, 1e-1), Ok(midpoint));
    assert_eq!(pick(&all, 1e-6), Ok(magnus));
    assert_eq!(pick(&all, 1e-12), Err(magnus));
    assert_eq!(pick(&[euler, magnus], 1e-1), Ok(euler));
}

fn prototype(alter: impl FnOnce(&mut RigParts)) -> Rig {
    hbot_config::RigConfig::prototype().rig.with(alter).unwrap()
}

/// Returns the prototype with encoders so fine that only the errors of the method and of the path
/// remain. Counts have 32 bits, so half a turn per tick can still be detected.
fn fine(alter: impl FnOnce(&mut RigParts)) -> Rig {
    prototype(|parts| {
        parts.joints.iter_mut().for_each(|joint| (joint.gear, joint.counts_per_turn) = (1.0, 1 << 30));
        alter(parts);
    })
}

#[test]
fn fine_encoders_leave_the_methods_error() {
    let error = |odometry, path| {
        of(&fine(|parts| (parts.methods.odometry, parts.methods.path) = (odometry, path))).error
    };
    let euler = error(OdometryMethod::Euler, PathFit::Straight);
    let midpoint = error(OdometryMethod::Midpoint, PathFit::Straight);
    let quadratic = error(OdometryMethod::Magnus4, PathFit::Quadratic);
    let cubic = error(OdometryMethod::Magnus4, PathFit::Cubic);
    assert!(euler > 100.0 * midpoint && midpoint > 10.0 * quadratic && quadratic > 3.0 * cubic);
}

#[test]
fn a_loop_too_slow_for_the_motion_is_told() {
    // The drive joints turn at about 20 rad/s, which is 8 rad in a tick.
    let rig = prototype(|parts| parts.timing.period_ns = 400_000_000);
    assert_eq!(of(&rig).error, f64::INFINITY);
}

/// Checks that [`of`], which programs call when they start, follows at most 20,000 ticks of the
/// test motion at any rate of the loop, and reports their duration. A search for a target
/// always covers 10 s.
#[test]
fn a_quick_loop_is_followed_for_a_shorter_time() {
    let at = |hz: u64| of(&prototype(|parts| parts.timing.period_ns = 1_000_000_000 / hz));
    for (hz, time_s, words) in
        [(1000, 10.0, "10 s"), (2000, 10.0, "10 s"), (8000, 2.5, "2.5 s"), (20_000, 1.0, "1 s")]
    {
        let expected = at(hz);
        assert_eq!(expected.time_s, time_s, "{hz} Hz");
        assert_eq!(expected.motion(), format!("{words} of a test motion (3 rad/s)"));
        assert!(expected.error > 0.0 && expected.error < 1.0e-3, "{hz} Hz: {expected:?}");
    }
    let rig = prototype(|parts| parts.timing.period_ns = 250_000);
    let whole = measured(&rig, &[(rig.methods.odometry, rig.methods.path)], TIME_NS)[0];
    // The part is the beginning of the whole, so its largest error cannot exceed that of the
    // whole.
    assert!(of(&rig).time_s == 5.0 && of(&rig).error <= whole.error);
}

#[test]
fn a_choice_replaces_the_odometry_method_and_the_path_alone() {
    let choice = Expectation { path: PathFit::Quadratic, ..choice(OdometryMethod::Midpoint, 1.0, 1.0) };
    for methods in [Methods::FAST, Methods::EXACT] {
        let chosen = choice.chosen(&methods);
        assert_eq!((chosen.odometry, chosen.path), (OdometryMethod::Midpoint, PathFit::Quadratic));
        assert_eq!(Methods { odometry: methods.odometry, path: methods.path, ..chosen }, methods);
    }
}

#[test]
fn a_time_is_given_in_three_digits() {
    for (time, given) in [(123.4, 123.0), (10.0, 10.0), (6.66666, 6.67), (0.60606, 0.606), (0.06666, 0.0667)]
    {
        assert_eq!(three_digits(time), given);
    }
}

#[test]
fn every_choice_that_makes_a_difference_is_measured_once() {
    let all = of_all(&prototype(|parts| parts.timing.period_ns = 5_000_000));
    let names: Vec<_> = all.iter().map(Expectation::name).collect();
    let expected = [
        "euler, straight",
        "midpoint, straight",
        "midpoint, quadratic",
        "midpoint, cubic",
        "magnus4, straight",
        "magnus4, quadratic",
        "magnus4, cubic",
    ];
    assert_eq!(names, expected);
    for choice in &all {
        assert!(choice.error > 0.0 && choice.error.is_finite() && choice.ns > 0.0, "{choice:?}");
        assert_eq!(choice.time_s, 10.0);
    }
}

/// The expected errors were computed apart from hbot, with the kinematics of
/// docs/internals/physics.md and joint angles that are not rounded to counts: the classical
/// Runge-Kutta method with four steps a tick for the motion, Euler's method for the orientation.
/// Between 205 and 397 ticks the largest error grows by a quarter.
#[test]
fn the_error_is_that_of_the_ticks_of_the_given_time() {
    let rig = fine(|_| ());
    for (ticks, error) in [(2, 3.6986e-6), (3, 7.5138e-6), (205, 7.5299e-4), (397, 9.4591e-4)] {
        let choice = (OdometryMethod::Euler, PathFit::Straight);
        let found = measured(&rig, &[choice], ticks * rig.timing.period_ns)[0].error;
        // The counts change the smallest error by 0.1 % at most.
        assert!((found / error - 1.0).abs() < 5.0e-3, "{ticks} ticks: {found:e} instead of {error:e} rad");
    }
}

#[test]
fn the_rates_of_a_reading_are_those_at_which_its_counts_change() {
    let rig = fine(|parts| {
        parts.joints.iter_mut().skip(1).step_by(2).for_each(|joint| joint.reversed = true);
    });
    let h = 1.0e-4;
    let course: Vec<[f64; 8]> = MOTION.course(&rig.device, 0.0, h).take(1003).collect();
    let at = |tick: usize| reading(&rig, tick, h, &course[tick]).feedback.expect("a reading");
    for tick in [1, 500, 1001] {
        let [before, now, after] = [at(tick - 1), at(tick), at(tick + 1)];
        assert_eq!(now.sequence as usize, tick);
        for joint in 0..4 {
            let counts = f64::from(after.counts[joint].wrapping_sub(before.counts[joint]));
            let rate = counts * rig.joints[joint].radians_per_count().abs() / (2.0 * h);
            // Rounding to counts changes the difference by one count at most: 3e-5 rad/s.
            let off = (now.rates[joint] - rate).abs();
            assert!(off < 1.0e-4, "tick {tick}, joint {joint}: {} and {rate} rad/s", now.rates[joint]);
        }
    }
}

/// The first three readings do not count, because a cubic path needs three readings before its own.
/// From the fourth on, both orientations are turns since the fourth, wherever they began.
#[test]
fn orientations_are_compared_from_the_first_one_with_a_whole_path() {
    let mut run = Run::new(prototype(|_| ()), (OdometryMethod::Euler, PathFit::Straight));
    let (computed, truth) = (Quat::from_rotation_x(0.7), Quat::from_rotation_y(-1.3));
    let mut judge = |done: usize, angles: &[[f64; 2]]| {
        run.q = angles.iter().map(|[angle, _]| Quat::from_rotation_z(*angle) * computed).collect();
        let truths: Vec<[f64; 8]> = angles
            .iter()
            .map(|[_, angle]| Quat::from_rotation_z(*angle) * truth)
            .map(|q| [q.w, q.x, q.y, q.z, 0.0, 0.0, 0.0, 0.0])
            .collect();
        run.judge(done, &truths);
        run.error
    };
    let first = [[1.0, 0.0], [-2.0, 0.0], [2.5, 0.0], [0.0, 0.0], [0.5, 0.48], [1.0, 0.99]];
    for (done, angles, error) in
        [(0, &first[..], 0.02), (6, &[[2.0, 1.95]], 0.05), (7, &[[2.5, 2.5]], 0.05), (8, &[[0.3, 0.4]], 0.1)]
    {
        let found = judge(done, angles);
        assert!((found - error).abs() < 1.0e-12, "after {done} ticks: {found} instead of {error} rad");
    }
}

#[test]
fn the_computing_time_is_that_of_one_tick() {
    let (rig, h) = (prototype(|_| ()), 1.0e-3);
    let course: Vec<[f64; 8]> = MOTION.course(&rig.device, 0.0, h).take(CHUNK).collect();
    let readings: Vec<Inputs> = course.iter().enumerate().map(|(k, y)| reading(&rig, k, h, y)).collect();
    for ticks in [1, CHUNK] {
        let mut run = Run::new(rig, (rig.methods.odometry, rig.methods.path));
        let begun = Instant::now();
        run.take(&readings[..ticks]);
        let whole = begun.elapsed().as_secs_f64() * 1.0e9;
        assert_eq!((run.samples.len(), run.q.len()), (1, ticks));
        let ns = run.samples[0];
        assert!(ns > 20.0 && ns * ticks as f64 <= 1.001 * whole, "{ticks} ticks: {ns} ns each of {whole}");
    }
}

#[test]
fn the_time_of_a_tick_is_the_median_of_its_chunks() {
    let (odometry, path) = (OdometryMethod::Magnus4, PathFit::Cubic);
    let mut run = Run::new(prototype(|_| ()), (odometry, path));
    run.samples = vec![900.0, 100.0, 500.0, 300.0, 1.0e9];
    let found = expectations(&[(odometry, path)], 2_500_000_000, std::iter::once((&run, 0.5)));
    assert_eq!(found, [Expectation { odometry, path, ns: 500.0, error: 0.5, time_s: 2.5 }]);
}
