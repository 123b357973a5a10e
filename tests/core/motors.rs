//! Limits of the torque by motors and contacts.

use crate::bench::rig_with_grip;
use crate::prelude::*;
use crate::shaping::{ROUNDING, WOUND};
use hbot_core::allocation::{ContactArms, traction};
use hbot_core::design::rig::{Joint, Limits, RigParts};

/// Asserts that the joint torques make the torque that the state names, and load the contacts as
/// the state says.
fn assert_made(rig: &Rig, state: &State) {
    let joints = rig.device.joints();
    let steering: Vec<f64> = state.angle[..joints].iter().step_by(2).copied().collect();
    let made = Posture::new(&rig.device, &steering).torque_on_sphere(&state.joint_torque[..joints]);
    assert!((made - state.torque).length() < ROUNDING, "tick {}: {made}, not {}", state.tick, state.torque);
    let radius = rig.device.sphere_radius();
    let arms: Vec<_> = rig.device.wheels().iter().map(|wheel| ContactArms::of(wheel, radius)).collect();
    let load = rig.limits.traction.map_or(0.0, |grip| {
        traction(&arms, &state.joint_torque[..joints], grip.mu * grip.normal_force).min(1.0)
    });
    assert!((load - state.traction).abs() < 1e-12, "tick {}: {load}, not {}", state.tick, state.traction);
}

#[test]
fn torque_that_motors_or_contacts_limit_keeps_the_slew_limit() {
    // The wanted torques are far above what the motors can make or the contacts can hold, in
    // changing directions.
    for rig in [rig(), rig_with_grip(6.0)].map(|rig| altered(&rig, |rig| rig.limits.torque = 8.0)) {
        let mut bench = Bench::active(rig, CompiledScene::empty());
        let mut rng = Rng(5);
        let (mut last, mut limited) = (bench.step().state.torque, 0);
        for k in 0..4000 {
            let outputs = if k % 60 == 0 {
                bench.command(stream(rng.vector(8.0), 200))
            } else {
                bench.turn(Vec3::new(0.5, -0.3, 0.4))
            };
            let change = (outputs.state.torque - last).length();
            assert!(change <= TORQUE_RATE * DT + 1e-12, "tick {k}: {change}");
            limited += u32::from(outputs.state.scale < 0.99);
            last = outputs.state.torque;
            assert_made(&rig, &outputs.state);
        }
        assert!(limited > 2000, "{limited}");
    }
}

#[test]
fn a_torque_beyond_the_rig_keeps_its_direction() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let mut rng = Rng(12);
    for size in [3.0, 30.0, 1e3, 1e100, 1e160, 1e300] {
        let direction = rng.vector(1.0).normalize();
        bench.command(stream(direction * size, 40));
        let state = bench.run(39).state;
        // The torque is at most the rig's limit of 2 N m, or what the motors can make of it.
        assert!(state.torque.length() > 0.9, "{size:e} N m gives {}", state.torque);
        assert!(state.torque.length() < 2.0 + ROUNDING);
        assert!((state.torque.normalize() - direction).length() < 1e-9, "{size:e}");
        // The ratio of the torque sent and the torque wanted.
        assert!(
            (state.scale * (size / state.torque.length()) - 1.0).abs() < 1e-9,
            "{size:e}: {}",
            state.scale
        );
    }
}

#[test]
fn what_the_motors_cannot_give_is_left_out_of_the_size_alone() {
    let rig = altered(&rig(), |rig| {
        for joint in &mut rig.joints {
            joint.peak *= 0.02;
            joint.continuous = joint.peak;
        }
    });
    let mut bench = Bench::active(rig, CompiledScene::empty());
    let mut rng = Rng(13);
    for _ in 0..50 {
        let wanted = rng.vector(1.0).normalize();
        bench.command(stream(wanted, 40));
        let state = bench.run(39).state;
        assert!(state.scale > 0.0 && state.scale < 1.0, "scale {}", state.scale);
        assert!((state.torque.normalize() - wanted).length() < 1e-9);
        for (j, tau) in state.joint_torque[..4].iter().enumerate() {
            assert!(tau.abs() <= rig.joints[j].peak, "joint {j}: {tau}");
        }
        assert!(!state.deficient);
    }
}

#[test]
fn contacts_are_never_asked_for_more_than_they_hold() {
    let scene = spring_scene(1, 2.0, WOUND);
    let free = Bench::active(rig_with_grip(1e4), scene.clone()).step().state;
    let grip = 1e4 * free.traction;
    assert!(free.traction > 0.0 && free.traction < 1e-2, "{}", free.traction);
    // First just enough grip, then half of what is needed.
    let enough = Bench::active(rig_with_grip(grip * 1.001), scene.clone()).step().state;
    assert!((enough.torque - free.torque).length() < ROUNDING && enough.traction < 1.0);
    assert_eq!(enough.scale, 1.0);
    let short = Bench::active(rig_with_grip(grip * 0.995), scene.clone()).step().state;
    assert!((short.torque - free.torque * 0.995).length() < 1e-9, "{} of {}", short.torque, free.torque);
    assert_eq!(short.traction, 1.0);
    let mut bench = Bench::active(rig_with_grip(0.5 * grip), scene);
    let mut least = 2.0_f64;
    for _ in 0..200 {
        let state = bench.step().state;
        // Only the size is limited. The limit is computed anew in each tick, for a torque at most a
        // slew step away from the last.
        assert!((state.torque.normalize() - Vec3::X).length() < 1e-9);
        assert!(state.torque.x <= 0.5 * free.torque.x + ROUNDING);
        least = least.min(state.torque.x);
        // The contacts carry all that they can hold.
        assert_eq!(state.traction, 1.0);
        assert!(state.scale < 1.0);
    }
    assert!(least > 0.49 * free.torque.x, "{least}");
}

#[test]
fn motors_that_turn_the_other_way_are_told_so() {
    let forward = Bench::active(rig(), spring_scene(1, 2.0, WOUND)).step();
    let rig = altered(&rig(), |rig| (rig.joints[1].reversed, rig.joints[2].reversed) = (true, true));
    let backward = Bench::active(rig, spring_scene(1, 2.0, WOUND)).step();
    assert_eq!(forward.state.joint_torque, backward.state.joint_torque);
    for (j, sign) in [1.0, -1.0, -1.0, 1.0].into_iter().enumerate() {
        assert_eq!(backward.drive.torque[j], sign * forward.drive.torque[j]);
    }
}

#[test]
fn a_rig_of_eight_wheels_follows_its_sphere() {
    let mut rng = Rng(3);
    let mut wheels = || {
        [(); 8].map(|()| WheelSpec {
            axis: rng.vector(1.0).normalize(),
            cone: rng.between(0.15, 0.5),
            radius: 0.0155,
            ..WheelSpec::default()
        })
    };
    let device = (0..1000).find_map(|_| Device::new(0.102, 0.467, &wheels()).ok()).expect("a legal design");
    let joint = |peak| Joint { zero: Zero::Assume, ..Joint::new(1 << 20, peak) };
    let parts = RigParts::new(device).with_joints(joint(2.0), joint(0.5));
    let limits = Limits { traction: Some(Traction { mu: 0.5, normal_force: 4.0 }), ..Limits::default() };
    let eight = Rig::new(RigParts { limits, ..parts }).expect("a legal rig");
    let mut bench = Bench::active(eight, CompiledScene::empty());
    let omega = Vec3::new(0.5, -0.3, 0.4);
    let state = (0..100).map(|_| bench.turn(omega).state).last().expect("100 ticks");
    assert_eq!((state.mode, state.joints), (Mode::Active, 16));
    // A count of a steer joint is 6e-6 rad.
    assert!((state.omega - omega).length() < 1e-5, "{}", state.omega);
    let drift = rotation::angle_between(state.q, bench.sphere.q);
    // The reading is a tick old.
    assert!((drift - omega.length() * DT).abs() < 1e-6, "{drift} rad");
    for axis in [Vec3::X, Vec3::NEG_Y, Vec3::Z] {
        bench.command(stream(axis * 1e3, 40));
        for _ in 0..40 {
            assert_made(&eight, &bench.turn(omega).state);
        }
    }
}
