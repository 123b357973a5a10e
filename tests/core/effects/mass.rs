//! Virtual masses: they feel like masses, and are limited to what the loop can render stably.

use super::Felt;
use crate::prelude::*;
use hbot_core::render::effects::{Inertia, Motion};

fn mass(mass: f64, smoothing: f64) -> Kind {
    Kind::Inertia(Inertia { mass: Mat3::from_diagonal(Vec3::splat(mass)), smoothing })
}

#[test]
fn a_steady_acceleration_is_opposed_by_the_mass() {
    let mut felt = Felt::new(mass(0.002, 0.01));
    let mut torque = Vec3::ZERO;
    for k in 0..200 {
        torque = felt.moving(Quat::IDENTITY, Vec3::Y * (3.0 * DT * f64::from(k)));
    }
    // At 3 rad/s², twenty time constants of smoothing leave an error of 2e-9.
    assert!((torque + Vec3::Y * 0.006).length() < 1e-10, "{torque}");
}

/// Simulates a free sphere with the rig's own inertia under the torque of `effects`, which acts
/// `delay` ticks late. The sphere is kicked once. Returns its largest and its final rate, rad/s.
fn kicked(effects: &[Kind], delay: usize) -> (f64, f64) {
    let rig = rig();
    let scene: Vec<_> =
        effects.iter().enumerate().map(|(i, kind)| effect(i as u8, 1 + i as u32, *kind)).collect();
    let scene = CompiledScene::new(1, &scene).unwrap();
    let mut renderer = Renderer::new(&rig);
    renderer.adopt(&scene, Quat::IDENTITY);
    let mut late = std::collections::VecDeque::from(vec![Vec3::ZERO; delay]);
    let (mut omega, mut most) = (Vec3::ZERO, 0.0_f64);
    for tick in 0..20_000 {
        late.push_back(renderer.render(&scene, &Motion { q: Quat::IDENTITY, omega }, tick, DT, 1.0));
        let torque = late.pop_front().unwrap();
        omega += torque * (DT / rig.device.sphere_inertia());
        if tick == 10 {
            omega += Vec3::X;
        }
        most = most.max(omega.length());
    }
    (most, omega.length())
}

#[test]
fn whatever_a_scene_asks_for_a_free_sphere_stays_calm() {
    for smoothing in [0.001, 0.003, 0.01, 0.1, 1.0] {
        for asked in [1e-3, 1e-2, 0.1, 1.0] {
            for delay in [0, 1, 2] {
                for kinds in
                    [vec![mass(asked, smoothing)], vec![mass(0.5 * asked, smoothing), mass(asked, 0.02)]]
                {
                    let (most, last) = kicked(&kinds, delay);
                    // The bound is the kick, and a ringing of at most equal size while the mass
                    // sets in.
                    assert!(most < 2.0, "{asked} kg m², {smoothing} s, {delay} ticks late: {most} rad/s");
                    assert!(last <= 1.0 + 1e-9, "{last} rad/s left");
                }
            }
        }
    }
}

/// The rendered mass has the upper bound of docs/effects.md: half of the sphere's inertia over a =
/// h/(smoothing + h).
#[test]
fn a_mass_beyond_the_bound_is_rendered_up_to_it() {
    let inertia = rig().device.sphere_inertia();
    let bound = 0.5 * inertia * (0.01 + DT) / DT;
    for (asked, want) in [(0.5 * bound, 0.5 * bound), (bound, bound), (3.0 * bound, bound)] {
        let mut felt = Felt::new(mass(asked, 0.01));
        let mut torque = Vec3::ZERO;
        for k in 0..300 {
            torque = felt.moving(Quat::IDENTITY, Vec3::Z * (DT * f64::from(k)));
        }
        assert!((torque.z + want).abs() < 1e-9, "asked for {asked}, {torque}");
    }
    // On the prototype the bound is 5.5 times the inertia of the sphere.
    assert!((bound / inertia - 5.5).abs() < 1e-9);
}

/// The bound holds for what the scene renders: a mass times the gain of its effect, added up over
/// all effects.
#[test]
fn the_bound_of_masses_counts_each_with_its_gain() {
    let bound = 0.5 * rig().device.sphere_inertia() * (0.01 + DT) / DT;
    let cases: [(&[(f64, f64)], f64); 5] = [
        (&[(4.0, 0.125)], 0.5),
        (&[(4.0, 0.25)], 1.0),
        (&[(4.0, 0.5)], 1.0),
        (&[(2.0, 0.25), (0.8, 0.5)], 0.9),
        (&[(2.0, 0.5), (0.5, 2.0)], 1.0),
    ];
    for (masses, share) in cases {
        let effects: Vec<Effect> = masses
            .iter()
            .enumerate()
            .map(|(k, (asked, gain))| {
                let kind = mass(asked * bound, 0.01);
                Effect { gain: *gain, ..effect(k as u8, 1 + k as u32, kind) }
            })
            .collect();
        let scene = CompiledScene::new(1, &effects).unwrap();
        let mut renderer = Renderer::new(&rig());
        renderer.adopt(&scene, Quat::IDENTITY);
        let mut torque = Vec3::ZERO;
        for tick in 0..300 {
            let motion = Motion { q: Quat::IDENTITY, omega: Vec3::Z * (DT * tick as f64) };
            torque = renderer.render(&scene, &motion, tick, DT, 1.0);
        }
        // At 1 rad/s² the torque is the mass.
        assert!((torque.z + share * bound).abs() < 1e-9, "{masses:?}: {torque}, the bound is {bound}");
    }
}

#[test]
fn the_bound_of_a_mass_holds_about_every_axis() {
    let bound = 0.5 * rig().device.sphere_inertia() * (0.01 + DT) / DT;
    for about in [Vec3::ONE, Vec3::new(1.0, -1.0, 1.0), Vec3::new(-1.0, 1.0, 1.0), Vec3::new(1.0, 1.0, -1.0)]
    {
        // The mass is 3.1 times the bound about this axis, and a tenth of the bound across it. Each
        // row adds up to 3.1 times the bound too.
        let outer = Mat3::from_cols(about * about.x, about * about.y, about * about.z);
        let mass = (outer + Mat3::IDENTITY * 0.1) * bound;
        let mut felt = Felt::new(Kind::Inertia(Inertia { mass, smoothing: 0.01 }));
        let axis = about.normalize();
        let mut torque = Vec3::ZERO;
        for k in 0..300 {
            torque = felt.moving(Quat::IDENTITY, axis * (DT * f64::from(k)));
        }
        // At 1 rad/s² the torque is the mass.
        assert!((torque + axis * bound).length() < 1e-9, "about {about}: {torque}, the bound is {bound}");
    }
}

/// With a time step of 0 a renderer only evaluates the torque. A virtual mass then shows the torque
/// of the last tick, and the next tick is not changed.
#[test]
fn a_virtual_mass_is_not_moved_by_an_evaluation_between_two_ticks() {
    let mut rng = Rng(6);
    for smoothing in [0.0, 0.01] {
        let scene = CompiledScene::new(1, &[effect(0, 1, mass(1e-4, smoothing))]).unwrap();
        let mut plain = Renderer::new(&rig());
        plain.adopt(&scene, Quat::IDENTITY);
        let mut asked = plain.clone();
        let mut last = Vec3::ZERO;
        for tick in 0..200 {
            let motion = |omega| Motion { q: Quat::IDENTITY, omega };
            let between = asked.render(&scene, &motion(rng.vector(5.0)), tick, 0.0, 0.0);
            assert_eq!(between, last, "between ticks {tick}");
            let now = motion(rng.vector(1.0));
            last = asked.render(&scene, &now, tick, DT, 1.0);
            assert_eq!(last, plain.render(&scene, &now, tick, DT, 1.0), "tick {tick}");
        }
        assert!(last.length() > 1e-4, "{last}");
    }
}

#[test]
fn a_mass_that_is_enabled_again_at_another_rate_does_not_kick() {
    let scene = CompiledScene::new(1, &[effect(0, 1, mass(0.001, 0.001))]).unwrap();
    let mut bench = Bench::active(rig(), scene);
    for _ in 0..100 {
        bench.turn(Vec3::Y * 2.0);
    }
    bench.command(Command::Disable);
    for _ in 0..600 {
        bench.turn(Vec3::Y * 2.0);
    }
    bench.sphere.omega = Vec3::ZERO;
    assert_eq!(bench.run(100).state.mode, Mode::Idle);
    assert_eq!(bench.command(Command::Enable).reply(), Reply::Done);
    for k in 0..50 {
        let torque = bench.step().state.torque;
        assert!(torque.length() < 1e-12, "after {k} ms: {torque}");
    }
}
