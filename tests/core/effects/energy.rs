//! Energy stored and absorbed by effects: every torque compared with its energy, along closed and
//! open paths.

use super::{Felt, anywhere, askew, axis, conservative, dissipative, end_stop, uneven};
use crate::bench;
use crate::prelude::*;
use hbot_core::render::effects::{Friction, Inertia};

/// Returns a random orientation in the range of a case.
fn somewhere(rng: &mut Rng, everywhere: bool) -> Quat {
    // The near ones are within 1.2 rad of the reference, and paths around them within 2.4 rad.
    if everywhere { anywhere(rng) } else { rotation::exp(rng.vector(0.68)) * askew().reference().0 }
}

/// Returns the negative gradient of the energy at `q`, N m, from central differences.
fn downhill(felt: &mut Felt, q: Quat) -> Vec3 {
    /// Step of the central differences, rad. The error h²/6 of a third derivative (900 x 0.05 for
    /// the texture) is 1e-11, and rounding 1e-16/h is 1e-10. Where a second derivative jumps, by
    /// 0.1/0.017 at a ridge of the icosahedron, the error is 6 h/4.
    const H: f64 = 1e-6;
    let mut slope = |axis: Vec3| {
        let ahead = felt.energy(rotation::exp(axis * H) * q);
        let behind = felt.energy(rotation::exp(axis * -H) * q);
        (ahead - behind) / (2.0 * H)
    };
    -Vec3::new(slope(Vec3::X), slope(Vec3::Y), slope(Vec3::Z))
}

#[test]
fn every_conservative_torque_is_the_gradient_of_its_energy() {
    let mut rng = Rng(1);
    for case in conservative() {
        let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
        for _ in 0..3000 {
            // The effect is new each time, because turns are counted from here.
            let mut felt = Felt::with_numbers(case.kind, &case.figures);
            let q = somewhere(&mut rng, case.everywhere);
            let torque = felt.at(q);
            worst = worst.max((torque - downhill(&mut felt, q)).length());
            largest = largest.max(torque.length());
        }
        assert!(worst < 2e-6, "{}: off by {worst:e}", case.name);
        assert!(largest > 0.02, "{}: the test saw at most {largest} N m", case.name);
    }
}

/// A wall of the twist fades if the axis swings far away. Its torque remains the gradient of its
/// energy there, which is 0 within the range.
#[test]
fn the_wall_of_a_twist_is_the_gradient_of_its_energy_at_any_swing() {
    let stop = EndStop { cone: None, ..end_stop(0.0) };
    let mut rng = Rng(6);
    let (mut worst, mut faded, mut free) = (0.0_f64, 0, 0);
    for _ in 0..3000 {
        // The turns are counted from here.
        let mut felt = Felt::new(Kind::EndStop(stop));
        let q = anywhere(&mut rng);
        let torque = felt.at(q);
        worst = worst.max((torque - downhill(&mut felt, q)).length());
        if torque == Vec3::ZERO {
            assert_eq!(felt.energy(q), 0.0);
            free += 1;
        }
        let x = askew().reference().0.conjugate() * q;
        faded += usize::from((x * axis()).dot(axis()) < -0.5 && torque.length() > 0.1);
    }
    // The energy of up to 12 J is rounded to 2e-15 J, which the differences divide by 2e-6 rad.
    assert!(worst < 2e-6, "off by {worst:e}");
    // A quarter of all swings is beyond 120 degrees, and the range is 1.1 of the 6.3 rad of a turn.
    assert!(faded > 300 && free > 300, "{faded} in the fade, {free} within the range");
}

/// The energy of a cone's wall is the work of a swing into it, also where the wall fades.
#[test]
fn the_energy_of_a_cone_is_the_work_that_a_swing_into_it_takes() {
    /// Step of the swing, rad. By the midpoint rule the error at a corner of the torque is at most
    /// an eighth of the jump in slope, 3 x 2.8/0.35 N m/rad, times the square of the step.
    const STEP: f64 = core::f64::consts::PI / 4000.0;
    let base = askew().reference().0;
    let across = axis().any_orthonormal_vector();
    for cone in [0.0, 0.5, 1.5, 2.7] {
        let mut felt = Felt::new(Kind::EndStop(EndStop { cone: Some(cone), twist: None, ..end_stop(0.0) }));
        let mut work = 0.0_f64;
        for k in 0..4000 {
            let at = |swing: f64| base * rotation::exp(across * swing);
            let from = STEP * f64::from(k);
            let energy = felt.energy(at(from));
            assert!((energy - work).abs() < 1e-4, "cone {cone}, swing {from}: {energy} J, not {work} J");
            work -= felt.at(at(from + 0.5 * STEP)).dot(base * across) * STEP;
        }
        assert!(work > 0.01, "cone {cone}: {work} J");
    }
}

/// A closed path: turns about two fixed axes, each by its own trigonometric polynomial. It gives
/// the orientation and the exact rate.
struct ClosedPath {
    start: Quat,
    axes: [Vec3; 2],
    /// Coefficients of sin, 1 - cos, sin 2 and 1 - cos 2.
    terms: [[f64; 4]; 2],
}

impl ClosedPath {
    fn random(rng: &mut Rng, start: Quat, size: f64) -> Self {
        let unit = |rng: &mut Rng| rotation::exp(rng.vector(3.0)) * Vec3::X;
        let axes = [unit(rng), unit(rng)];
        let terms = [0, 1].map(|_| [0; 4].map(|_| rng.between(-size, size)));
        Self { start, axes, terms }
    }

    fn at(&self, t: f64) -> (Quat, Vec3) {
        let angle = |[a, b, c, d]: [f64; 4]| {
            let (s, k) = t.sin_cos();
            let (s2, k2) = (2.0 * t).sin_cos();
            (a * s + b * (1.0 - k) + c * s2 + d * (1.0 - k2), a * k + b * s + 2.0 * c * k2 + 2.0 * d * s2)
        };
        let [(one, one_rate), (two, two_rate)] = self.terms.map(angle);
        let first = rotation::exp(self.axes[0] * one);
        let q = first * rotation::exp(self.axes[1] * two) * self.start;
        (q, self.axes[0] * one_rate + first * (self.axes[1] * two_rate))
    }

    /// Returns the net work along the path, and the sum of the absolute work, J. It uses the
    /// trapezoid rule, which for a smooth periodic integrand is exact to rounding.
    fn work(&self, felt: &mut Felt, steps: usize) -> (f64, f64) {
        let h = core::f64::consts::TAU / steps as f64;
        let (mut sum, mut size) = (0.0, 0.0);
        for k in 0..steps {
            let (q, omega) = self.at(k as f64 * h);
            let power = felt.at(q).dot(omega);
            sum += power * h;
            size += power.abs() * h;
        }
        (sum, size)
    }
}

#[test]
fn around_a_thousand_closed_paths_no_conservative_effect_does_net_work() {
    /// Largest error of the trapezoid rule at corners of the torque's slope (rims of notches,
    /// walls, ridges), J. At one corner it is an eighth of the jump in slope times the square of a
    /// step: 1.6 N m/rad x (2 pi/12000 x 8 rad/s)² / 8 = 4e-6 J. There are some corners of either
    /// sign.
    const SMALL: f64 = 2e-5;
    let mut rng = Rng(2);
    for case in conservative() {
        let (mut worst, mut busiest) = (0.0_f64, 0.0_f64);
        for _ in 0..1000 {
            let start = somewhere(&mut rng, case.everywhere);
            let path = ClosedPath::random(&mut rng, start, if case.everywhere { 0.8 } else { 0.12 });
            let mut felt = Felt::with_numbers(case.kind, &case.figures);
            let (mut net, size) = path.work(&mut felt.clone(), 1500);
            if net.abs() > SMALL {
                // The error of the rule at a corner decreases with the square of the step, and work
                // does not.
                (net, _) = path.work(&mut felt, 12_000);
            }
            worst = worst.max(net.abs());
            busiest = busiest.max(size);
        }
        println!("{:28} {worst:8.1e} J of {busiest:.3} J", case.name);
        assert!(worst < SMALL, "{}: {worst:e} J", case.name);
        assert!(busiest > 0.01, "{}: only {busiest} J went to and fro", case.name);
    }
}

/// The energy of a scene is the sum over its effects, each times its gain. Effects that leave, and
/// those whose torque is no gradient, have no part in it.
#[test]
fn the_energy_of_a_scene_is_the_sum_over_the_effects_that_store_it() {
    let spring = |slot: u8, stiffness: f64, gain: f64| {
        let kind = bench::spring(stiffness, 0.3, Quat::IDENTITY, Anchor::Absolute);
        Effect { gain, ..bench::effect(slot, 1 + u32::from(slot), kind) }
    };
    let damper = Kind::Damper(Damper::new(uneven(0.01, 0.02, 0.03)).unwrap());
    let other = bench::effect(9, 10, damper);
    let (soft, stiff) = (spring(0, 2.0, 0.5), spring(1, 3.0, 2.0));
    let leaving = Effect { leaving: true, fade_out_s: 1.0, ..spring(2, 100.0, 1.0) };
    let q = rotation::exp(Vec3::new(0.0, 0.4, 0.0));
    let energy = |effects: &[Effect]| {
        let scene = CompiledScene::new(1, effects).unwrap();
        let mut renderer = Renderer::new(&rig());
        renderer.adopt(&scene, q);
        renderer.energy(&scene, q)
    };
    // Half of the stiffness times the square of 0.4 rad.
    for (effects, want) in [
        (&[soft][..], 0.5 * 2.0 * 0.5 * 0.16),
        (&[stiff], 0.5 * 3.0 * 2.0 * 0.16),
        (&[soft, other, leaving, stiff], 0.5 * (2.0 * 0.5 + 3.0 * 2.0) * 0.16),
    ] {
        let sum = energy(effects).expect("a spring stores energy");
        assert!((sum - want).abs() < 1e-12, "{sum} J, not {want} J");
    }
    assert_eq!(energy(&[other]), None);
    assert_eq!(energy(&[leaving]), None);
    assert_eq!(energy(&[]), None);
}

#[test]
fn what_damps_never_pushes_along() {
    let mut rng = Rng(3);
    for (kind, figures) in dissipative() {
        let mut taken = 0.0_f64;
        for _ in 0..20_000 {
            let mut felt = Felt::with_numbers(kind, &figures);
            let q = anywhere(&mut rng);
            let omega = rng.vector(10.0);
            let still = felt.at(q);
            let power = (felt.moving(q, omega) - still).dot(omega);
            // The tolerance is the rounding of a torque of 10 N m at 17 rad/s.
            assert!(power <= 1e-13, "{kind:?} gives {power} W");
            taken = taken.max(-power);
        }
        assert!(taken > 0.01, "{kind:?} took at most {taken} W");
    }
}

/// Along any path from a place where its bristle was at rest, friction has absorbed more energy
/// than it stores. The torque at the end of a step times the step bounds the work of a held torque:
/// the energy is convex, so this work is more than the growth of the energy.
#[test]
fn friction_never_gives_more_than_its_bristle_holds() {
    let mut rng = Rng(4);
    let friction = Friction { torque: 0.05, stiffness: 5.0, damping: 0.0 };
    let held = 0.5 * friction.torque * friction.torque / friction.stiffness;
    let mut taken_most = 0.0_f64;
    for _ in 0..200 {
        let mut felt = Felt::new(Kind::Friction(friction));
        let mut q = anywhere(&mut rng);
        felt.at(q);
        let (mut taken, mut step) = (0.0, Vec3::ZERO);
        for _ in 0..5000 {
            step = step * 0.98 + rng.vector(1e-3);
            q = rotation::renormalized(rotation::exp(step) * q);
            let torque = felt.at(q);
            taken -= torque.dot(step);
            assert!(taken > -1e-15, "{taken} J taken since the start");
            assert!(torque.length() < friction.torque + 1e-15);
            taken_most = taken_most.max(taken);
        }
    }
    assert!(taken_most > 100.0 * held, "{taken_most} J: it slid");
}

/// The impedance of a virtual mass is positive real without delay. From rest it therefore absorbs
/// more energy than it gives back, for any motion.
#[test]
fn a_virtual_mass_never_gives_more_than_it_took() {
    let mut rng = Rng(5);
    for smoothing in [0.001, 0.01, 0.1] {
        for _ in 0..100 {
            let mut felt = Felt::new(Kind::Inertia(Inertia { mass: uneven(1e-4, 2e-4, 3e-4), smoothing }));
            let (mut omega, mut taken, mut gave) = (Vec3::ZERO, 0.0, 0.0_f64);
            felt.moving(Quat::IDENTITY, omega);
            for _ in 0..2000 {
                omega = omega * 0.99 + rng.vector(0.2);
                let power = felt.moving(Quat::IDENTITY, omega).dot(omega);
                taken -= power * DT;
                gave = gave.max(power);
                assert!(taken > -1e-15, "{taken} J");
            }
            assert!(gave > 0.0, "it gives back what it took");
        }
    }
}
