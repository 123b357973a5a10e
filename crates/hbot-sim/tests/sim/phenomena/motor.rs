//! Motor phenomena: torque scale, lag, back-EMF, heat. Most tests use the motor controllers alone,
//! so that nothing else moves.

use hbot_config::rig::Protocol;
use hbot_link::{Decoder, Feedback, JointFlags};
use hbot_sim::controller::{Lags, SimulatedControllers, SimulatedJoint, Truth};
use hbot_sim::phenomena::Motor;

use crate::prelude::*;

/// Parameters of a motor that gives exactly the commanded torque at any rate and for any time.
const IDEAL: Motor = Motor {
    torque_scale: 1.0,
    lag_s: 0.0,
    steer_no_load_rate: f64::INFINITY,
    drive_no_load_rate: f64::INFINITY,
    thermal_time_s: f64::INFINITY,
};
const STILL: [f64; 16] = [0.0; 16];
/// Peak torque of a steer and a drive motor, in N m, as single-precision numbers, as in commands.
const PEAK: [f32; 2] = [0.93, 0.14];
const CONTINUOUS: [f64; 2] = [0.073, 0.023];

fn controllers(motor: Motor) -> SimulatedControllers {
    let joints: Vec<_> = rig().joints[..4].iter().map(SimulatedJoint::from).collect();
    let joints: Vec<_> = joints.into_iter().map(|j| SimulatedJoint { reversed: false, ..j }).collect();
    let controllers =
        SimulatedControllers::new(Protocol::Hbot.into(), Lags::default(), &joints, &STILL, None);
    let mut controllers = controllers.expect("the simulated rig speaks hbot's own protocol");
    controllers.set_motor(Some(motor));
    let truth = Truth { angles: &STILL, rates: &STILL };
    controllers.hear(0, &frame(&ToController::Describe), &truth, &mut Vec::new());
    controllers
}

fn ask(controllers: &mut SimulatedControllers, enable: bool, torque: [f32; 4]) -> Feedback {
    let (truth, mut reply) = (Truth { angles: &STILL, rates: &STILL }, Vec::new());
    let command = ToController::Command(command(1, enable, &torque));
    controllers.hear(0, &frame(&command), &truth, &mut reply);
    let mut answer = None;
    Decoder::<FromController>::new().feed(&reply, |message| answer = message.ok());
    match answer {
        Some(FromController::Feedback(feedback)) => feedback,
        other => panic!("{other:?}"),
    }
}

/// A motor with lag approaches the commanded torque exactly exponentially, for any length of step.
/// The torque that is returned for a step has the exact impulse.
#[test]
fn a_lag_is_an_exact_exponential() {
    let motor = Motor { lag_s: 5e-4, torque_scale: 0.95, ..IDEAL };
    let mut controllers = controllers(motor);
    ask(&mut controllers, true, [0.5, -0.1, 0.0, 0.0]);
    assert_eq!(controllers.torque()[0], 0.0, "nothing has gone by");
    let (mut t, mut impulse) = (0.0, [0.0; 2]);
    for h in [1e-3, 1e-4, 3.3e-4, 1e-6, 2e-3] {
        let held = controllers.drive(h, || STILL);
        t += h;
        for j in 0..2 {
            impulse[j] += held[j] * h;
            let end = 0.95 * f64::from([0.5_f32, -0.1][j]);
            let gone = 1.0 - (-t / 5e-4_f64).exp();
            // The tolerances are a few roundings of numbers below 1.
            assert!((controllers.torque()[j] - end * gone).abs() < 2e-15, "joint {j} at {t} s");
            assert!((impulse[j] - end * (t - 5e-4 * gone)).abs() < 1e-17, "joint {j} at {t} s");
        }
    }
    // When the motors are switched off, the current decays with the lag and then becomes exactly
    // zero.
    ask(&mut controllers, false, [0.0; 4]);
    let before = controllers.torque()[0];
    controllers.drive(1e-3, || STILL);
    assert!((controllers.torque()[0] - before * (-2.0_f64).exp()).abs() < 2e-15);
    for _ in 0..30 {
        controllers.drive(1e-3, || STILL);
    }
    assert_eq!(controllers.torque(), &STILL);
    // A loss of power ends the current at once.
    ask(&mut controllers, true, [0.5; 4]);
    controllers.drive(1e-3, || STILL);
    controllers.inject(InjectedFault::Reboot, &STILL);
    assert_eq!(controllers.torque(), &STILL);
}

/// If a motor drives its joint, the available torque falls linearly from the peak at rest to zero
/// at the no-load rate. If it brakes the joint, the peak is available.
#[test]
fn back_emf_takes_torque_along_a_line() {
    let motor = Motor { steer_no_load_rate: 500.0, drive_no_load_rate: 60.0, ..IDEAL };
    let mut controllers = controllers(motor);
    for part in [0.0, 0.25, 0.5, 0.9, 1.0, 1.5] {
        for sign in [1.0_f32, -1.0] {
            ask(&mut controllers, true, [0.93 * sign, 0.14 * sign, 0.93 * sign, 0.14 * sign]);
            // The motors of wheel 1 drive, those of wheel 2 brake.
            let rate = part * f64::from(sign);
            let mut rates = STILL;
            rates[..4].copy_from_slice(&[500.0 * rate, 60.0 * rate, -500.0 * rate, -60.0 * rate]);
            let given = controllers.drive(1e-3, || rates);
            for j in 0..2 {
                let peak = f64::from(PEAK[j]);
                let wanted = peak * (1.0_f64 - part).max(0.0);
                assert!((given[j] * f64::from(sign) - wanted).abs() < 1e-15, "{part}: {given:?}");
                assert_eq!(given[2 + j] * f64::from(sign), peak, "braking: {part}");
            }
        }
    }
    // A torque below the available one is not changed.
    ask(&mut controllers, true, [0.1, 0.0, 0.0, 0.0]);
    assert_eq!(controllers.drive(1e-3, || [250.0; 16])[0], f64::from(0.1_f32));
}

/// A cold motor gives its peak torque for the time T ln(n² / (n² - 1)), with n = peak / continuous.
/// Then it gives its continuous torque and reports overtemperature.
#[test]
fn heat_takes_a_motor_back_to_its_continuous_torque_in_time() {
    let time = 10.0;
    let mut controllers = controllers(Motor { thermal_time_s: time, ..IDEAL });
    let all = [PEAK[0], PEAK[1], PEAK[0], -PEAK[1]];
    let (mut seen, h) = ([None; 2], 1e-3);
    let flags = |feedback: &Feedback, j: usize| feedback.joints[j].flags;
    for k in 0..400 {
        let feedback = ask(&mut controllers, true, all);
        let given = controllers.drive(h, || STILL);
        for j in 0..2 {
            let hot = flags(&feedback, j).contains(JointFlags::OVERTEMPERATURE);
            if hot && seen[j].is_none() {
                seen[j] = Some(f64::from(k) * h);
            }
            let wanted = if hot { CONTINUOUS[j] } else { f64::from(PEAK[j]) };
            assert_eq!(given[j], wanted, "joint {j}, tick {k}");
            // A hot motor stays hot while the command asks for more than it can hold.
            assert_eq!(hot, seen[j].is_some());
        }
    }
    for j in 0..2 {
        let square = (f64::from(PEAK[j]) / CONTINUOUS[j]).powi(2);
        let wanted = time * (square / (square - 1.0)).ln();
        // The first command after that time reports it.
        let late = seen[j].unwrap() - wanted;
        assert!((0.0..=h).contains(&late), "joint {j}: {:?} against {wanted}", seen[j]);
    }
    // A hot motor gives a torque below its continuous torque in full, and reports nothing.
    let held = CONTINUOUS[0] as f32 * 0.99;
    let feedback = ask(&mut controllers, true, [held, 0.0, held, 0.0]);
    assert_eq!(flags(&feedback, 0), JointFlags::empty());
    assert_eq!(controllers.drive(h, || STILL)[0], f64::from(held));
    // A motor at rest cools by exp(-t/T). After T, 1/e of the heat is left, and the peak lasts
    // accordingly.
    ask(&mut controllers, false, [0.0; 4]);
    for _ in 0..10_000 {
        controllers.drive(h, || STILL);
    }
    let square = (f64::from(PEAK[1]) / CONTINUOUS[1]).powi(2);
    let wanted = time * ((square - (-1.0_f64).exp()) / (square - 1.0)).ln();
    let lasted = (0..).take_while(|_| {
        let feedback = ask(&mut controllers, true, all);
        controllers.drive(h, || STILL);
        !flags(&feedback, 1).contains(JointFlags::OVERTEMPERATURE)
    });
    let lasted = lasted.count() as f64 * h;
    // One tick is lost in reporting. The heat was less than one tick above the limit when cooling
    // began.
    assert!((lasted - wanted).abs() <= 2.0 * h, "{lasted} against {wanted}");
}

#[test]
fn a_motor_that_holds_its_continuous_torque_never_gets_hot() {
    let mut controllers = controllers(Motor { thermal_time_s: 0.01, ..IDEAL });
    // Slightly below the continuous torque, because a command cannot carry exactly 0.073.
    let held = [0.072_999_9, 0.022_999_9, 0.0, 0.0];
    for _ in 0..10_000 {
        let feedback = ask(&mut controllers, true, held);
        assert!(feedback.joints.iter().all(|joint| joint.flags.is_empty()));
        assert_eq!(controllers.drive(1e-3, || STILL)[0], f64::from(held[0]));
    }
}

/// The torque that moves the plant is the one that the motors give, including their torque scale
/// and lag.
#[test]
fn the_rig_s_plant_feels_what_its_motors_give() {
    let run = |motor: Option<Motor>| {
        let mut config = SimulatedConfig::new(&rig());
        config.phenomena = Phenomena { motor, ..Phenomena::default() };
        let mut rig = SimulatedRig::new(&config).unwrap();
        let mut reply = Vec::new();
        rig.receive(0, &frame(&ToController::Describe), &mut reply);
        let push = hbot_link::ToController::Command(command(1, true, &[0.0, 0.01, 0.0, 0.01]));
        rig.receive(0, &frame(&push), &mut reply);
        rig.advance_to(10 * MS);
        rig
    };
    let (ideal, still_ideal) = (run(None), run(Some(IDEAL)));
    assert_eq!(ideal.state(), still_ideal.state(), "nothing switched on: the same bits");
    let speed = |rig: &SimulatedRig| rig.state().omega.length();
    // A weak motor gives proportionally less speed, because the plant is nearly linear close to
    // rest. A motor with a lag is late by it.
    let weak = run(Some(Motor { torque_scale: 0.95, ..IDEAL }));
    assert!((speed(&weak) / speed(&ideal) - 0.95).abs() < 1e-3, "{} {}", speed(&weak), speed(&ideal));
    let late = run(Some(Motor { lag_s: 5e-4, ..IDEAL }));
    assert!((speed(&late) / speed(&ideal) - 0.95).abs() < 1e-3, "0.5 ms of 10: {}", speed(&late));
}
