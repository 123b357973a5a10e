//! Designs very close to singular, and three motors where they lose a direction of torque.

use super::super::core::allocation::{Allocation, JointLimits, allocate};
use super::super::core::design::device::DeviceError;
use super::super::core::design::kinematics::Posture;
use super::super::core::design::singularity::{
    actuation_margin, boundary_determinant, interior_margin, interior_margin_over_all,
};
use super::super::core::{Device, Real, Vec3, WheelSpec};
use super::machine::{device, limits, wheels};
use hbot_testing::rng::Rng;

/// Returns nearly singular designs with a name and their smallest interior margin: a cone of 1e-3,
/// a toe of 89.9 degrees, and contacts that come within 0.1 degree of each other.
fn hairs() -> [(&'static str, [WheelSpec; 2], f64); 3] {
    let right_angle = core::f64::consts::FRAC_PI_2;
    let with = |alter: fn(&mut WheelSpec)| {
        let mut wheels = wheels();
        wheels.iter_mut().for_each(alter);
        wheels
    };
    // The axes are a right angle apart. The margin between contacts is sqrt(1 - cos g) = sqrt 2
    // sin(g/2).
    let margin = |gap: f64| core::f64::consts::SQRT_2 * (0.5 * gap).sin();
    let close = 0.1_f64.to_radians();
    [
        ("cone 1e-3", with(|wheel| wheel.cone = 1e-3), margin(right_angle - 2e-3)),
        (
            "toe 89.9 deg",
            with(|wheel| wheel.toe = 89.9_f64.to_radians() as Real),
            margin(right_angle - 0.349),
        ),
        ("0.1 deg apart", with(|wheel| wheel.cone = 44.95_f64.to_radians() as Real), margin(close)),
    ]
}

/// Asserts that an allocated torque is within the limits, is never opposed to the wanted torque,
/// and has its direction unless a deficiency is reported. Returns the deviation relative to the
/// wanted torque, and relative to its bound.
fn check(name: &str, posture: &Posture, limits: &JointLimits, wanted: Vec3, found: &Allocation) -> [Real; 2] {
    let torque = made(posture, found);
    for (tau, peak) in found.torque.iter().zip(limits.peak) {
        assert!(tau.abs() <= peak, "{name}: {found:?}");
    }
    assert!((0.0..=1.0).contains(&found.scale), "{name}: {found:?}");
    // If motors oppose each other, the torque is a difference and has the rounding of its terms,
    // some for each of sixteen joints.
    let terms: Real = posture.rows().iter().zip(found.torque).map(|(g, tau)| g.length() * tau.abs()).sum();
    let rounding = 128.0 * Real::EPSILON * terms;
    let size = wanted.length();
    assert!(torque.dot(wanted) >= -rounding * size, "{name}: {torque} against {wanted}, {found:?}");
    // No part of the torque exceeds the wanted one. The error is below 1 % for each of two axes
    // (see `allocate`).
    assert!(
        torque.length() <= 1.02 * found.scale * size + rounding,
        "{name}: {torque} for {wanted}, {found:?}"
    );
    if found.deficient {
        return [0.0; 2];
    }
    // Deviations of up to 1024 roundings are not reported. Moments of very different rows and costs
    // are solved by the fast method if it is accurate to one digit.
    let off = (torque - wanted * found.scale).length();
    let quick = if Real::EPSILON < 1e-10 { 1e-9 } else { 1e-3 };
    let unsaid = quick * found.scale * size + 1024.0 * Real::EPSILON * terms;
    assert!(off <= unsaid, "{name}: {torque} for {wanted}, {found:?}");
    [off / size, off / unsaid]
}

fn random(rng: &mut Rng, size: f64) -> Vec3 {
    Vec3::from_array([0; 3].map(|_| rng.between(-size, size) as Real))
}

fn made(posture: &Posture, found: &Allocation) -> Vec3 {
    posture.torque_on_sphere(&found.torque[..posture.rows().len()])
}

#[test]
fn a_hair_from_singular_torque_is_bounded_and_the_margin_known() {
    let mut rng = Rng(300);
    for (name, wheels, margin) in hairs() {
        let device = device(&wheels);
        let rounding = 64.0 * Real::EPSILON;
        assert!(
            (f64::from(interior_margin_over_all(&device)) - margin).abs() <= f64::from(rounding),
            "{name}"
        );
        for wheel in device.wheels() {
            let (a, b) = (f64::from(wheel.spec().cone), f64::from(wheel.spec().toe));
            let det = f64::from(device.sphere_radius() * wheel.spec().radius) * a.sin() * b.cos();
            let off = f64::from(boundary_determinant(&device, wheel)) / det - 1.0;
            // The cosine of an angle near 90 degrees has the rounding of the angle.
            assert!(off.abs() <= f64::from(rounding) / b.cos(), "{name}: {off:e}");
        }
        let limits = limits(&device);
        let (mut least, mut lost, mut deficient): (Real, Real, u32) = (Real::MAX, 0.0, 0);
        for k in 0..4000 {
            // Half of the steer angles are random. The others are where the contacts are nearest,
            // with each wheel turned towards the other.
            let near = [core::f64::consts::FRAC_PI_2, -core::f64::consts::FRAC_PI_2];
            let th =
                near.map(
                    |near| {
                        if k % 2 == 0 { rng.between(-4.0, 4.0) } else { near + rng.between(-1e-3, 1e-3) }
                    },
                );
            let posture = Posture::new(&device, &th.map(|th| th as Real));
            assert!(
                f64::from(interior_margin(&posture)) >= margin * (1.0 - 1e-3) - f64::from(rounding),
                "{name}"
            );
            least = least.min(interior_margin(&posture));
            // The sphere's turn is computed from joint rates, with an error of rounding over the
            // square of the margin.
            let omega = random(&mut rng, 3.0);
            let rates = posture.inverse(omega);
            let steepest = rates.iter().fold(1.0, |m: Real, rate| m.max(rate.abs()));
            let back = posture.forward(&device, &rates).omega;
            let known = rounding * steepest / (margin as Real * margin as Real);
            assert!((back - omega).length() <= known, "{name}: {} off, {known:e}", (back - omega).length());
            let wanted = random(&mut rng, if k % 3 == 0 { 10.0 } else { 0.1 });
            let found = allocate(posture.rows(), &limits, wanted);
            lost = lost.max(check(name, &posture, &limits, wanted, &found)[0]);
            deficient += u32::from(found.deficient);
        }
        println!(
            "{name}: interior margin {least:e} met ({margin:e} by design), {deficient} of 4000 deficient, off {lost:e}"
        );
        // Near the boundary singularity steering is some thousand times as strong as driving, but
        // the drives can make what they always can.
        let expected = if name == "0.1 deg apart" { 1..4000 } else { 0..1 };
        assert!(expected.contains(&deficient), "{name}: {deficient}");
    }
}

/// Returns a random design of two to eight wheels, or `None` if it is not legal. Cones go down to
/// 1e-3 and toes up to 89.9 degrees. Motors are strong, weak or dead.
fn any_design(rng: &mut Rng) -> Option<(Device, JointLimits)> {
    let count = rng.between(2.0, 9.0) as usize;
    let mut specs = wheels().into_iter().cycle().take(count).collect::<Vec<_>>();
    for spec in &mut specs {
        spec.axis = random(rng, 1.0).normalize();
        spec.cone = 10_f64.powf(rng.between(-3.0, 0.1)) as Real;
        let edge = [0.0, rng.between(-1.5, 1.5), 89.9_f64.to_radians()];
        spec.toe = edge[rng.between(0.0, 3.0) as usize] as Real;
    }
    let device = Device::new(0.102, 0.467, &specs).ok()?;
    let mut limits = limits(&device);
    for peak in &mut limits.peak[..2 * count] {
        *peak *= [0.0, 0.1, 1.0, 1.0][rng.between(0.0, 4.0) as usize];
    }
    Some((device, limits))
}

#[test]
fn no_design_ever_pushes_against_what_is_wanted() {
    let mut rng = Rng(302);
    let (mut designs, mut deficient, mut worst): (u32, u32, Real) = (0, 0, 0.0);
    while designs < 10_000 {
        let Some((device, limits)) = any_design(&mut rng) else { continue };
        designs += 1;
        for _ in 0..10 {
            let th: Vec<Real> = device.wheels().iter().map(|_| rng.between(-4.0, 4.0) as Real).collect();
            let posture = Posture::new(&device, &th);
            let size = 10_f64.powf(rng.between(-3.0, 1.0));
            let wanted = random(&mut rng, size);
            let found = allocate(posture.rows(), &limits, wanted);
            deficient += u32::from(found.deficient);
            worst = worst.max(check("any", &posture, &limits, wanted, &found)[1]);
        }
    }
    println!("{deficient} of 100000 deficient, else off by up to {worst:.2e} of the bound");
    assert!((1000..50_000).contains(&deficient));
}

#[test]
fn beyond_a_hair_a_design_is_refused() {
    let build = |alter: &dyn Fn(&mut WheelSpec)| {
        let mut wheels = wheels();
        wheels.iter_mut().for_each(alter);
        Device::new(0.102, 0.467, &wheels)
    };
    let refused = build(&|wheel| wheel.cone = 1e-7);
    assert!(matches!(refused, Err(DeviceError::BoundarySingular { .. })), "{refused:?}");
    let refused = build(&|wheel| wheel.toe = (core::f64::consts::FRAC_PI_2 - 4e-6) as Real);
    assert!(matches!(refused, Err(DeviceError::BoundarySingular { .. })), "{refused:?}");
    for cone in [core::f64::consts::FRAC_PI_4, 0.8] {
        let refused = build(&|wheel| wheel.cone = cone as Real);
        assert!(matches!(refused, Err(DeviceError::InteriorSingular { .. })), "{cone}: {refused:?}");
    }
}

#[test]
fn three_motors_lose_a_direction_gracefully() {
    let device = device(&wheels());
    let mut limits = limits(&device);
    // The drive of wheel 2 is dead. The rig is then singular where c3 of wheel 1 is perpendicular
    // to c2 of wheel 2.
    limits.peak[3] = 0.0;
    let driven = [true, true, true, false];
    let mut rng = Rng(301);
    const STEPS: u32 = 40_000;
    let (mut steepest, mut least, mut lost): (Real, Real, u32) = (0.0, 1.0, 0);
    for _ in 0..4 {
        let first = rng.between(-3.0, 3.0) as Real;
        let wanted = random(&mut rng, 0.2);
        let mut last: Option<(Allocation, Vec3)> = None;
        for k in 0..=STEPS {
            let second = (core::f64::consts::TAU * f64::from(k) / f64::from(STEPS)) as Real;
            let posture = Posture::new(&device, &[first, second]);
            let found = allocate(posture.rows(), &limits, wanted);
            let torque = made(&posture, &found);
            least = least.min(actuation_margin(&posture, &driven));
            lost += u32::from(found.deficient);
            assert!(found.torque[3] == 0.0 && torque.is_finite());
            assert!(torque.length() <= wanted.length() * (1.0 + 1e-3), "{torque} for {wanted}");
            if let Some((before, torque_before)) = last {
                // Each step is 1.6e-4 rad of steering.
                let jump = (torque - torque_before).length() / wanted.length();
                steepest = steepest.max(jump);
                let joints = found.torque.iter().zip(before.torque).map(|(a, b)| (a - b).abs());
                assert!(
                    joints.fold(0.0, Real::max) <= 0.1 && jump <= 0.1,
                    "{before:?} to {found:?} at {second}"
                );
            }
            last = Some((found, torque));
        }
    }
    println!("least margin {least:e}, deficient {lost} of {}, steepest {steepest:e} a step", 4 * STEPS);
    assert!(least < 1e-3 && lost > 0, "the surface was crossed");
}
