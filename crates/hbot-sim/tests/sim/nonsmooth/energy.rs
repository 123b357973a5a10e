//! Without input no step adds energy, for random devices and phenomena with parameters as extreme
//! as allowed.

use hbot_core::design::device::WheelSpec;
use hbot_sim::hand::Grip;
use hbot_sim::phenomena::{Eccentric, Gear, Pivoting, WheelModules};
use hbot_testing::rng::Rng;

use crate::prelude::*;

/// Returns zero one time in five, `huge` one time in five, and otherwise a random number between
/// `low` and `high`.
fn figure(dice: &mut Rng, low: f64, high: f64, huge: f64) -> f64 {
    match dice.below(5) {
        0 => 0.0,
        1 => huge,
        _ => dice.decade(low, high),
    }
}

/// Returns `value` in the share `share` of all calls.
fn some<T>(dice: &mut Rng, share: f64, value: impl FnOnce(&mut Rng) -> T) -> Option<T> {
    dice.chance(share).then(|| value(dice))
}

/// Returns a random device. One device in four has inertias that differ by up to six powers of ten;
/// the others have inertias like those of a real device. One device in twenty has joints without
/// inertia.
fn device(dice: &mut Rng) -> Option<Device> {
    let count = 2 + dice.below(7) as usize;
    let extreme = dice.chance(0.25);
    let spread = if extreme { 1.0e3 } else { 3.0 };
    let inertia = if dice.chance(0.05) { 0.0 } else { 1.0 };
    let specs: Vec<WheelSpec> = (0..count)
        .map(|_| {
            let steer_inertia = inertia * 3.0e-5 * dice.decade(1.0 / spread, spread);
            let drive_inertia = 4.0e-6 * dice.decade(1.0 / spread, spread);
            WheelSpec {
                axis: dice.vector(1.0),
                cone: dice.between(0.1, 1.2),
                toe: if dice.chance(0.5) { dice.between(-0.6, 0.6) } else { 0.0 },
                radius: dice.between(0.005, 0.05),
                steer_inertia,
                drive_inertia,
                axial_inertia: if dice.chance(0.5) {
                    0.4 * (steer_inertia * drive_inertia).sqrt()
                } else {
                    0.0
                },
            }
        })
        .collect();
    Device::new(dice.between(0.05, 0.2), 0.5 * dice.decade(1.0 / spread, spread), &specs).ok()
}

fn phenomena(dice: &mut Rng) -> Phenomena {
    Phenomena {
        joint_friction: some(dice, 0.5, |dice| JointFriction {
            coulomb: figure(dice, 1e-5, 1e-1, 10.0),
            viscous: figure(dice, 1e-6, 1e-2, 10.0),
            breakaway: figure(dice, 1e-5, 1e-1, 10.0),
            stribeck_rate: dice.decade(1e-3, 1e2),
        }),
        cage_friction: some(dice, 0.5, |dice| CageFriction { torque: figure(dice, 1e-5, 1e-1, 10.0) }),
        slip: some(dice, 0.5, |dice| Slip {
            mu: figure(dice, 1e-3, 1.0, 1e6),
            normal_force: figure(dice, 0.1, 100.0, 1e4),
        }),
        pivoting: some(dice, 0.4, |dice| Pivoting {
            mu: figure(dice, 1e-3, 1.0, 1e6),
            normal_force: 10.0,
            patch_radius: figure(dice, 1e-5, 1e-2, 0.1),
        }),
        eccentric: some(dice, 0.4, |dice| Eccentric { offset: dice.vector(0.01).to_array() }),
        wheel_modules: some(dice, 0.4, |dice| WheelModules { mass: figure(dice, 1e-3, 0.2, 1.0) }),
        gear: some(dice, 0.4, |dice| Gear {
            backlash: figure(dice, 1e-4, 0.1, 1.0),
            efficiency: dice.between(0.01, 1.0),
            rotor_share: dice.between(0.01, 0.99),
        }),
        hand: some(dice, 0.3, |dice| Hand {
            stiffness: dice.decade(0.1, 30.0),
            damping: figure(dice, 1e-3, 1.0, 10.0),
            inertia: dice.decade(1e-6, 1e-2),
            amplitude: 0.0,
            ..Hand::default()
        }),
        ..Phenomena::default()
    }
}

/// Totals over all scenes that the test has run.
#[derive(Default)]
struct Tally {
    scenes: u32,
    steps: u32,
    /// Number of time steps in which the solver did not converge.
    unfinished: u32,
    /// Largest rise of energy in one time step, relative to the energy at the start plus the range
    /// of the weights' potential energy.
    rise: f64,
    /// Largest number of Newton steps that the solver needed in one time step.
    newton: u32,
}

/// Simulates one random scene for `steps` steps, checks that no step adds energy, and updates
/// `tally`. Does nothing if the seed gives no valid device or no nonsmooth phenomena.
fn run(seed: u64, steps: u32, tally: &mut Tally) {
    let mut dice = Rng(seed);
    let Some(device) = device(&mut dice) else { return };
    let phenomena = phenomena(&mut dice);
    let mut state = PlantState {
        q: hbot_core::rotation::exp(dice.vector(3.0)),
        omega: dice.vector(10.0),
        ..PlantState::default()
    };
    for i in 0..device.wheels().len() {
        (state.steer[i], state.drive[i]) = (dice.between(-9.0, 9.0), dice.between(-9.0, 9.0));
    }
    let h = dice.decade(1e-5, 1e-3);
    let Ok(mut dynamics) = Dynamics::new(&device, &phenomena, Method::Rk4, &state) else { return };
    if !dynamics.is_nonsmooth() {
        return;
    }
    let aside = hbot_core::rotation::exp(dice.vector(2.0));
    let grip = phenomena.hand.map(|hand| {
        dynamics.set_sphere_inertia(device.sphere_inertia() + hand.inertia);
        Grip::new(hand, 0.0, aside * state.q)
    });
    let total = |dynamics: &Dynamics, state: &PlantState| {
        dynamics.energy(state) + grip.map_or(0.0, |grip| grip.energy(0.0, state.q))
    };
    let swing = phenomena
        .eccentric
        .map_or(0.0, |e| device.sphere_mass() * 9.81 * Vec3::from_array(e.offset).length())
        + phenomena.wheel_modules.map_or(0.0, |m| m.mass * 9.81 * 0.3 * device.wheels().len() as f64);
    let mut before = total(&dynamics, &state);
    let scale = before.abs() + swing;
    tally.scenes += 1;
    for step in 0..steps {
        dynamics.step(&mut state, 0.0, h, &[0.0; 16], Vec3::ZERO, grip.as_ref());
        let now = total(&dynamics, &state);
        let effort = dynamics.effort().unwrap();
        let rise = (now - before) / scale;
        // The bound is a few times the velocity that the solver leaves of a sticking element, 1e-12
        // of what the impulses of the step would make. These are at most a few times the momentum.
        // The comparison also fails for NaN.
        assert!(rise <= 1e-11, "seed {seed}, step {step} of {h:e} s: {rise:e} {effort:?} {phenomena:?}");
        assert!((state.q.length() - 1.0).abs() < 4e-15, "seed {seed}, step {step}: {}", state.q.length());
        tally.steps += 1;
        tally.unfinished += u32::from(!effort.converged);
        tally.rise = tally.rise.max(rise);
        tally.newton = tally.newton.max(effort.newton);
        before = now;
    }
}

/// No step adds energy. Ten thousand random scenes with all combinations of phenomena run for a few
/// steps each, some of them longer.
#[test]
fn no_step_adds_energy() {
    let mut tally = Tally::default();
    let mut seed = 0;
    while tally.scenes < 10_000 {
        run(seed, if seed % 25 == 0 { 100 } else { 6 }, &mut tally);
        seed += 1;
    }
    println!(
        "{} scenes, {} steps: energy up by {:.1e} at most; {} steps not converged; at most {} Newton steps",
        tally.scenes, tally.steps, tally.rise, tally.unfinished, tally.newton
    );
    assert_eq!(tally.unfinished, 0);
}
