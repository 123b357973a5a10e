//! The lead at its bounds: the limit of speed, missing readings, and half a turn from the
//! reference.

use super::super::core::design::kinematics::Posture;
use super::super::core::design::rig::LeadTime;
use super::super::core::inputs::Command;
use super::super::core::safety::mode::Mode;
use super::super::core::{Real, Vec3};
use super::machine::{ReadRig, device, rig, spring_scene, wheels};

const FACTOR: Real = 1.1;
const PERIOD: Real = 1.0e-3;
const LAG: Real = 5.0e-4;
/// Stiffness of the spring of `spring_scene`, N m/rad.
const STIFFNESS: Real = 2.0;
/// Roundings of a rate that goes from the sphere to the joints and back, and of a torque.
const ROUNDING: Real = 1.0e3 * Real::EPSILON;

/// Creates an active machine with a lead, whose spring has its reference at `turn`.
fn led(turn: Vec3) -> ReadRig {
    let rig = rig().with(|rig| {
        rig.torque_lag = LAG;
        rig.lead = Some(LeadTime { factor: FACTOR, longest: 0.05 });
        rig.limits.reference_rate = 100.0;
        rig.limits.torque_rate = 1.0e4;
        rig.limits.speed = 30.0;
        rig.limits.slip = 10.0;
        rig.limits.enable_max_angle = 3.1;
    });
    let mut machine = ReadRig::active_with(rig.expect("a legal rig"));
    machine.scene = spring_scene(2, turn);
    machine.run(1200);
    machine
}

/// Sets the rates that the encoders report to those of the angular velocity `omega`, rad/s.
fn turning(machine: &mut ReadRig, omega: Vec3) {
    machine.rates = Posture::new(&device(&wheels()), &[0.0; 2]).inverse(omega);
}

#[test]
fn the_scene_is_led_by_the_rate_and_the_lead_ends_with_the_torque() {
    let mut machine = led(Vec3::ZERO);
    let omega = Vec3::new(1.0, -0.5, 0.25);
    turning(&mut machine, omega);
    machine.step(|_| {});
    let state = machine.step(|_| {}).state;
    let time = FACTOR * (1.5 * PERIOD + LAG);
    assert!((state.lead_us - 1.0e6 * time).abs() < 1.0e6 * ROUNDING, "{}", state.lead_us);
    // The rates of the wheels do not turn the encoders, so the sphere stays at the identity.
    assert!((state.torque + omega * (STIFFNESS * time)).length() < ROUNDING, "{}", state.torque);
    let stop = machine.step(|inputs| inputs.commands.push(Command::Estop).unwrap()).state;
    assert!(stop.torque == Vec3::ZERO && stop.lead_us == 0.0, "{stop:?}");
}

/// 29.9 rad/s for 12 ms would be 0.35 rad.
#[test]
fn at_the_limit_of_speed_the_lead_stays_within_its_angle() {
    let mut machine = led(Vec3::ZERO);
    turning(&mut machine, Vec3::X * 29.9);
    let mut state = machine.run(2).state;
    for _ in 0..8 {
        state = machine.step(|inputs| inputs.feedback = None).state;
        assert_eq!((state.mode, state.cause), (Mode::Active, None));
        assert!(state.torque.length() <= STIFFNESS * 0.2 + ROUNDING, "{}", state.torque);
    }
    assert!((state.torque.length() - STIFFNESS * 0.2).abs() < ROUNDING, "{}", state.torque);
    let time = 0.2 / state.omega.length();
    assert!((state.lead_us - 1.0e6 * time).abs() < 1.0e6 * ROUNDING, "{}", state.lead_us);
}

/// The direction at exactly half a turn is one of two. A lead in the direction of either rate does
/// not let it change from tick to tick.
#[test]
fn at_half_a_turn_the_torque_has_one_direction() {
    for rate in [0.0, 1.0, -1.0] {
        let mut machine = led(Vec3::Z * core::f64::consts::PI as Real);
        turning(&mut machine, Vec3::Z * rate);
        let first = machine.run(2).state.torque;
        // The spring asks for 6.3 N m; the limit is 0.5 N m.
        assert!((first.length() - 0.5).abs() < ROUNDING, "{first}");
        // Rates without counts are a fault soon.
        for _ in 0..8 {
            let torque = machine.step(|_| {}).state.torque;
            assert!((torque - first).length() < ROUNDING, "{rate}: {first} then {torque}");
        }
    }
}
