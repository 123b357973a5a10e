//! A rig without phenomena equals the ideal rig, bit by bit.

use hbot_sim::controller::EncoderKind;
use hbot_sim::phenomena::{Cogging, Encoder, Link, Motor, TorqueConstants};

use crate::prelude::*;

/// Returns the 64-bit FNV-1a hash of `bytes`.
fn hash(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .fold(0xCBF2_9CE4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3))
}

/// Runs two seconds with a hand and two without, and returns all bytes that the rig sent.
///
/// The run contains everything that a rig without phenomena can encounter: all kinds of encoders,
/// torque beyond the peak, an expired watchdog, a reboot, a damaged frame, and irregular times.
fn eventful(phenomena: Phenomena) -> Vec<u8> {
    let mut config = SimulatedConfig::new(&rig());
    config.phenomena = phenomena;
    config.joints[2].encoder = EncoderKind::Indexed;
    config.joints[1].encoder = EncoderKind::Incremental;
    config.phenomena.hand = Some(Hand::default());
    let mut rig = SimulatedRig::new(&config).unwrap();
    let mut reply = Vec::new();
    rig.receive(0, &frame(&ToController::Describe), &mut reply);
    for k in 1..=4000u32 {
        let swing = 0.02 * f64::from(k % 400) as f32 - 4.0;
        let torque = [0.02 * swing, -0.01 * swing, 0.3 * swing, 0.003 * swing];
        let mut bytes = frame(&ToController::Command(command(k, k % 900 > 2, &torque)));
        match k {
            700..730 => continue,
            1000 => {
                rig.inject(InjectedFault::Reboot);
                // Without it the rebooted controller would give no torque.
                bytes.splice(..0, frame(&ToController::Describe));
            }
            1500 => bytes[3] ^= 0x11,
            2000 => rig.set_hand(None),
            2500 => rig.set_state(brisk()),
            3000 => rig.set_external(Vec3::new(0.01, -0.02, 0.005)),
            3300 => rig.inject(InjectedFault::Slipped { joint: 1, angle: 0.5 }),
            3500.. => rig.advance_to(u64::from(k) * MS - u64::from(k) * 97 % MS),
            _ => {}
        }
        rig.receive(u64::from(k) * MS, &bytes, &mut reply);
    }
    reply
}

/// Without phenomena the rig sends exactly the bytes that it sent before phenomena were added to
/// the program. Their number and hash were recorded then.
#[test]
fn bytes_are_those_of_the_ideal_rig() {
    let bytes = eventful(Phenomena::default());
    assert_eq!((bytes.len(), hash(&bytes)), (301_096, 15_162_813_078_176_961_730));
}

/// Phenomena that are switched on with neutral parameters, such as a latency of 0, change no byte
/// that the rig sends.
#[test]
fn phenomena_of_nothing_change_no_byte() {
    let link =
        Link { latency_s: 0.0, command_latency_s: 0.0, jitter_s: 0.0, loss: 0.0, corrupt: 0.0, seed: 3 };
    let encoder = Encoder { step: 1, turn_error: 0.0, index_error: 0.0, seed: 3 };
    let motor = Motor {
        torque_scale: 1.0,
        lag_s: 0.0,
        steer_no_load_rate: f64::INFINITY,
        drive_no_load_rate: f64::INFINITY,
        thermal_time_s: f64::INFINITY,
    };
    let none = Phenomena::default();
    let ideal = eventful(none);
    for phenomena in [
        Phenomena { link: Some(link), ..none },
        Phenomena { encoder: Some(encoder), ..none },
        Phenomena { motor: Some(motor), ..none },
        Phenomena { torque_constants: Some(TorqueConstants { spread: 0.0, seed: 3 }), ..none },
    ] {
        assert!(eventful(phenomena) == ideal, "{phenomena:?}");
    }
}

/// With all phenomena of the motor controllers and the line, a tick allocates nothing either.
#[test]
fn a_tick_allocates_nothing_with_phenomena_and_without() {
    let hand = Some(Hand::default());
    let link = Link { loss: 0.1, corrupt: 0.1, latency_s: 5e-3, command_latency_s: 5e-3, ..Link::default() };
    let all = Phenomena {
        link: Some(link),
        encoder: Some(Encoder::default()),
        motor: Some(Motor::default()),
        torque_constants: Some(TorqueConstants::default()),
        cogging: Some(Cogging::default()),
        hand,
        ..Phenomena::default()
    };
    for phenomena in [Phenomena { hand, ..Phenomena::default() }, all] {
        let mut rig =
            SimulatedRig::new(&SimulatedConfig { phenomena, ..SimulatedConfig::new(&rig()) }).unwrap();
        let mut bytes = frame(&ToController::Describe);
        bytes.extend(frame(&ToController::Command(command(1, true, &[0.01; 4]))));
        let (mut reply, mut most) = (Vec::with_capacity(1024), 0);
        let counted = allocation_counter::measure(|| {
            for k in 1..1000 {
                reply.clear();
                rig.receive(k * MS, &bytes, &mut reply);
                most = most.max(reply.len());
            }
        });
        assert!(most > 0);
        assert_eq!((counted.count_total, counted.count_current), (0, 0), "{phenomena:?}");
    }
}
