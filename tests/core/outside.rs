//! Measurements from outside with a sigma: a filter decides how far they correct the orientation.

use crate::prelude::*;

const DEGREE: f64 = core::f64::consts::PI / 180.0;

fn by_sigma(q: Quat, sigma: f64, tick: u64) -> Command {
    Command::AlignBySigma { q, sigma: Vec3::splat(sigma), weight: 1.0, tick }
}

/// Returns noise about each axis with the standard deviation `sigma`, rad.
fn noise(rng: &mut Rng, sigma: f64) -> Vec3 {
    // The sum of four uniform vectors of variance 1/3 each.
    let sum = (0..4).map(|_| rng.vector(1.0)).fold(Vec3::ZERO, |sum, v| sum + v);
    sum * (sigma * (3.0_f64 / 4.0).sqrt())
}

/// A camera with noise of a degree, 30 times a second and 50 ms late, while the sphere turns and a
/// spring acts. The orientation ends within half a degree, as its sigma says, and the torque never
/// changes by more than the slew limit.
#[test]
fn a_noisy_and_late_camera_helps_and_never_kicks() {
    let mut bench = Bench::active(rig(), spring_scene(1, 2.0, Vec3::X * 0.1));
    // The rig's orientation is wrong by 3 degrees from the start: the true one is q * off.
    let off = rotation::exp(Vec3::new(2.0, -2.0, 1.0) * DEGREE);
    let mut rng = Rng(17);
    let mut truth = std::collections::VecDeque::new();
    let (mut last, mut worst): (Option<Vec3>, f64) = (None, 0.0);
    for k in 0..6000 {
        let t = f64::from(k) * DT;
        let omega = Vec3::new((2.0 * t).sin(), 0.4, (3.1 * t).cos()) * 0.5;
        let reading = bench.feedback();
        let before = bench.sphere.q;
        bench.sphere.turn(omega, DT);
        truth.push_back((bench.tick, before * off));
        let late = (truth.len() > 50).then(|| truth.pop_front()).flatten();
        let measured = late
            .filter(|_| k % 33 == 0)
            .map(|(tick, q)| by_sigma(rotation::exp(noise(&mut rng, DEGREE)) * q, DEGREE, tick));
        let out = bench.step_with(|inputs| {
            inputs.feedback = Some(reading);
            measured.into_iter().for_each(|command| inputs.commands.push(command).unwrap());
        });
        if let Some(last) = last {
            assert!((out.state.torque - last).length() <= TORQUE_RATE * DT * (1.0 + 1e-9));
        }
        last = Some(out.state.torque);
        if k > 3000 {
            worst = worst.max(rotation::angle_between(out.state.q, before * off));
            let sigma = out.state.sigma.unwrap();
            assert!(sigma.max_element() < 0.5 * DEGREE, "{sigma}");
        }
    }
    // Three standard deviations would be rare over three seconds of correlated errors.
    assert!(worst < 1.0 * DEGREE, "{} degrees", worst / DEGREE);
}

#[test]
fn gravity_finds_the_tilt_and_leaves_the_heading() {
    let mut bench = Bench::new(rig());
    (0..3).for_each(|_| {
        bench.step();
    });
    let off = rotation::exp(Vec3::new(0.1, -0.05, 0.3));
    let down = -Vec3::Z;
    let mut rng = Rng(3);
    let q = bench.step().state.q * off;
    // The rig is sure of its orientation to a degree before.
    bench.command(by_sigma(bench.sphere.q, 0.5, bench.tick - 1));
    for _ in 0..400 {
        let body = q.conjugate() * (rotation::exp(noise(&mut rng, DEGREE)) * down);
        let command = Command::AlignDirection { body, world: down, sigma: DEGREE, tick: bench.tick - 1 };
        let Reply::Measured { used, .. } = bench.command(command).reply() else { panic!("measured") };
        assert!(used || rng.once_in(100), "one in a thousand may be refused");
    }
    let out = bench.step().state;
    let tilt = (out.q * (q.conjugate() * down)).angle_between(down);
    assert!(tilt < 0.5 * DEGREE, "{} degrees", tilt / DEGREE);
    let sigma = out.sigma.unwrap();
    assert!(sigma.x < 0.3 * DEGREE && sigma.y < 0.3 * DEGREE && sigma.z > 0.4, "{sigma}");
}

#[test]
fn a_measurement_that_cannot_be_is_answered_and_not_used() {
    let mut bench = Bench::new(rig());
    bench.step();
    bench.step();
    assert_eq!(bench.step().state.sigma, None, "nothing is known until a sigma comes");
    let here = bench.sphere.q;
    assert_eq!(bench.command(by_sigma(here, 0.01, 2)).reply(), Reply::Measured { angle: 0.0, used: true });
    let sigma = bench.step().state.sigma.unwrap();
    assert!((sigma - Vec3::splat(0.01)).length() < 1e-4, "{sigma}");
    let far = rotation::exp(Vec3::Y * 0.5) * here;
    let Reply::Measured { angle, used } = bench.command(by_sigma(far, 0.01, 2)).reply() else {
        panic!("measured")
    };
    assert!((angle - 0.5).abs() < 1e-9 && !used);
    assert_eq!(bench.step().state.q, here);
    // With the weight 0, or one of which the noise is no number, it is only compared.
    for weight in [0.0, 1e-308] {
        let compared = Command::AlignBySigma { q: far, sigma: Vec3::splat(9e-1), weight, tick: 2 };
        let Reply::Measured { angle, used } = bench.command(compared).reply() else { panic!("measured") };
        assert!((angle - 0.5).abs() < 1e-9 && !used);
        assert_eq!(bench.step().state.q, here);
    }
    // Wrong numbers and times are refused.
    let refused = |command, bench: &mut Bench| bench.command(command).reply();
    for sigma in [0.0, -1.0, 4.0, f64::NAN] {
        let reply = refused(by_sigma(here, sigma, 2), &mut bench);
        assert_eq!(reply, Reply::Refused(Refusal::NotFinite), "{sigma}");
        let direction = Command::AlignDirection { body: Vec3::X, world: Vec3::X, sigma, tick: 2 };
        assert_eq!(refused(direction, &mut bench), Reply::Refused(Refusal::NotFinite), "{sigma}");
    }
    let long = Command::AlignDirection { body: Vec3::X * 2.0, world: Vec3::X, sigma: 0.1, tick: 2 };
    assert_eq!(refused(long, &mut bench), Reply::Refused(Refusal::NotFinite));
    let ahead = by_sigma(here, 0.1, 1_000_000);
    assert_eq!(refused(ahead, &mut bench), Reply::Refused(Refusal::NotInHistory));
}

/// A correction runs at the rig's `align_rate` while the motors are on, as that of `align` does.
#[test]
fn a_correction_by_sigma_is_no_faster_than_the_rig_allows() {
    let slow = altered(&rig(), |rig| rig.limits.align_rate = 0.5);
    let mut bench = Bench::active(slow, CompiledScene::empty());
    let (q, tick) = (bench.sphere.q, bench.tick - 1);
    bench.command(by_sigma(rotation::exp(Vec3::Z * 0.1) * q, 0.01, tick));
    for k in 1..150 {
        let turned = rotation::angle_between(bench.step().state.q, q);
        assert!(turned <= 0.5 * DT * f64::from(k + 1) + 1e-9, "{turned} after {k} ticks");
    }
    // 0.1 rad at 0.5 rad/s take 0.2 s.
    assert!((rotation::angle_between(bench.run(60).state.q, q) - 0.1).abs() < 1e-3);
}

/// The uncertainty grows by what the rig file says of the drift, or by that of a drawing.
#[test]
fn the_uncertainty_of_a_rig_grows_by_its_drift() {
    for (drift, each) in [(None, 0.02), (Some(1.0e-3), 1.0e-3)] {
        let mut bench = Bench::new(altered(&rig(), |rig| rig.drift = drift));
        (0..3).for_each(|_| {
            bench.step();
        });
        bench.command(by_sigma(bench.sphere.q, 1e-3, bench.tick - 1));
        for _ in 0..2000 {
            bench.sphere.turn(Vec3::new(0.0, 2.0, 0.0), DT);
            bench.step();
        }
        // 4 rad and 2 s.
        let want = (1.0e-6 + 4.0 * each * each + 2.0e-8_f64).sqrt();
        let sigma = bench.step().state.sigma.unwrap();
        assert!((sigma - Vec3::splat(want)).length() < 1e-2 * want, "{drift:?}: {sigma}, not {want}");
    }
}
