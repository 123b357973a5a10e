//! Scenes far beyond the stiffness that the loop can render passively, with the passivity stage on.
//! The delivered energy is bounded and the loop comes to rest.

use crate::passivity::{BORDER, DT, Loop, TAP, guarded};
use crate::prelude::*;

fn scene(kind: Kind) -> CompiledScene {
    CompiledScene::new(1, &[effect(0, 1, kind)]).unwrap()
}

/// Returns the energy that a spring of `stiffness` (N m/rad) leaks in its first cycle, J, if it
/// holds the energy `held` and acts two ticks late: 2 pi times twice the tick in radians of its
/// oscillation.
fn leak(run: &Loop, stiffness: f64, held: f64) -> f64 {
    let tick = DT * (stiffness / run.rig.device.sphere_inertia()).sqrt();
    4.0 * core::f64::consts::PI * tick * held
}

#[test]
fn a_stiffness_of_condition_1e8_comes_to_rest() {
    let turn = Mat3::from_quat(rotation::exp(Vec3::new(0.5, -1.0, 0.7)));
    for times in [3.0, 30.0] {
        let most = times * BORDER;
        let k = turn * Mat3::from_diagonal(Vec3::new(most, most * 1e-4, most * 1e-8)) * turn.transpose();
        let k = (k + k.transpose()) * 0.5;
        for law in [SpringLaw::Geodesic, SpringLaw::Quaternion] {
            let spring = Spring::new(law, k, Mat3::ZERO, Quat::IDENTITY, Anchor::Absolute).unwrap();
            let mut run = Loop::new(guarded(RateEstimate::Controller), scene(Kind::Spring(spring)));
            run.motion.omega = TAP;
            let held = 0.5 * run.rig.device.sphere_inertia() * TAP.length_squared();
            run.run(6000);
            let (torque, rate) = run.largest(500);
            let bound = run.rig.methods.passivity.unwrap().allowance + leak(&run, most, held);
            println!("{times} {law:?}: {torque:e} N m, {rate:e} rad/s, {:e} J of {bound:e}", run.most);
            assert!(torque < 0.1 && rate < 0.1, "{times}, {law:?}: {torque} N m, {rate} rad/s");
            assert!(run.most < bound, "{times}, {law:?}: {} J of {bound} J", run.most);
        }
    }
}

#[test]
fn a_wall_hit_hard_gives_back_no_more_than_it_took() {
    for times in [3.0, 30.0] {
        let stop = EndStop {
            target: Target::N,
            axis: Vec3::Z,
            cone: None,
            twist: Some([-0.2, 0.2]),
            stiffness: times * BORDER,
            damping: 0.0,
        };
        let mut run = Loop::new(guarded(RateEstimate::Controller), scene(Kind::EndStop(stop)));
        run.motion.omega = Vec3::Z * 10.0;
        let held = 0.5 * run.rig.device.sphere_inertia() * 100.0;
        let mode = run.run(6000).mode;
        let (torque, rate) = run.largest(500);
        let bound = run.rig.methods.passivity.unwrap().allowance + leak(&run, times * BORDER, held);
        println!("{times}: {torque:e} N m, {rate:e} rad/s, {:e} J of {bound:e}", run.most);
        assert_eq!(mode, Mode::Active);
        assert!(run.most < bound, "{times}: {} J of {bound} J", run.most);
        assert!(torque < 0.1 && rate < 0.2, "{times}: {torque} N m, {rate} rad/s");
    }
}
