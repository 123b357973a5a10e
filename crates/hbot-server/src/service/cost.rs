//! Measures the computing time that an effect adds to a tick, outside of the loop, with a separate
//! `Controller`.

use std::time::Instant;

use hbot_core::design::kinematics::Posture;
use hbot_core::design::rig::{RigParts, Zero, legal};
use hbot_core::inputs::{Command, Inputs, JointReadings, Stamp};
use hbot_core::{CompiledScene, Controller, MAX_JOINTS, MAX_WHEELS, Rig, Vec3};

/// Number of ticks before the timed ones. In these ticks the control law finds its zeros and is
/// enabled, and the processor's caches fill.
const WARM_UP: usize = 40;
/// Number of ticks whose computing time is measured.
const TIMED: usize = 200;
/// Angular velocity of the sphere during the measurement, rad/s. No component is zero, so that no
/// effect takes a shortcut for rest.
const OMEGA: Vec3 = Vec3::new(1.1, -0.7, 0.9);
/// Torque that a client streams during the measurement, N m. With it, both of the compared times
/// contain the cost of the torque allocation, which all effects share.
const TORQUE: Vec3 = Vec3::new(0.02, 0.01, -0.015);

/// Returns the time that each effect of a scene adds to a tick, ns: the median time with the effect
/// minus the median time without any effect. The measurement takes about 0.4 ms per effect.
pub(super) fn measure(rig: &Rig, scene: &CompiledScene) -> Vec<u64> {
    let rig = tolerant(rig);
    let inputs = inputs(&rig);
    let empty = CompiledScene::empty();
    let effects = scene.effects().iter().enumerate().filter(|(_, effect)| !effect.leaving);
    effects
        .map(|(i, _)| {
            let scene = scene.only(i);
            let (mut with, mut without) = (Controller::new(rig), Controller::new(rig));
            let (mut times, mut base) = (Vec::with_capacity(TIMED), Vec::with_capacity(TIMED));
            for (i, input) in inputs.iter().enumerate() {
                // Alternate the two, so that other load on the machine affects both.
                let spent = timed(&mut with, &scene, input);
                let idle = timed(&mut without, &empty, input);
                if i >= WARM_UP {
                    times.push(spent);
                    base.push(idle);
                }
            }
            median(times).saturating_sub(median(base))
        })
        .collect()
}

fn timed(controller: &mut Controller, scene: &CompiledScene, inputs: &Inputs) -> u64 {
    let start = Instant::now();
    std::hint::black_box(controller.tick(scene, std::hint::black_box(inputs)));
    u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX)
}

fn median(mut times: Vec<u64>) -> u64 {
    let middle = times.len() / 2;
    *times.select_nth_unstable(middle).1
}

/// Returns a copy of `rig` with which the control law keeps rendering during the measurement: its
/// zeros are known at once, and its limits for faults are the widest legal ones.
fn tolerant(rig: &Rig) -> Rig {
    let alter = |parts: &mut RigParts| {
        parts.joints.iter_mut().for_each(|joint| joint.zero = Zero::Assume);
        parts.limits.speed = legal::SPEED.most;
        parts.limits.slip = legal::SLIP.most;
        parts.limits.enable_max_angle = legal::ENABLE_MAX_ANGLE.most;
    };
    rig.with(alter).unwrap_or(*rig)
}

/// Returns the inputs of the control law in all ticks of the measurement. The sphere turns at
/// [`OMEGA`] without slip, as the encoders measure it.
fn inputs(rig: &Rig) -> Vec<Inputs> {
    let joints = rig.device.joints();
    let mut angles = [0.0; MAX_JOINTS];
    let mut steering = [0.0; MAX_WHEELS];
    (0..WARM_UP + TIMED)
        .map(|i| {
            for (wheel, th) in steering.iter_mut().enumerate() {
                *th = angles[2 * wheel];
            }
            let rates = Posture::new(&rig.device, &steering[..joints / 2]).inverse(OMEGA);
            let mut feedback = JointReadings::new(i as u32, [0; MAX_JOINTS], [0.0; MAX_JOINTS]);
            for j in 0..joints {
                angles[j] += rates[j] * rig.timing.period_s();
                let joint = &rig.joints[j];
                feedback.counts[j] = (angles[j] / joint.radians_per_count()) as i32;
                feedback.rates[j] = if joint.reversed { -rates[j] } else { rates[j] };
            }
            let mut inputs = Inputs { feedback: Some(feedback), ..Inputs::quiet(i as u64) };
            let command = match i {
                2 => Some(Command::Enable),
                3 => Some(Command::Stream { torque: TORQUE, valid_ticks: u32::MAX, stamp: Stamp::default() }),
                _ => None,
            };
            if let Some(command) = command {
                // A tick takes more than one command, so this does not fail.
                let _ = inputs.commands.push(command);
            }
            inputs
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use hbot_config::{RigConfig, RunningScene, SceneFile};
    use hbot_core::safety::mode::Mode;

    use super::*;

    #[test]
    fn the_controller_renders_while_it_is_timed() {
        let rig = tolerant(&RigConfig::prototype().rig);
        let mut controller = Controller::new(rig);
        let inputs = inputs(&rig);
        let scene = CompiledScene::empty();
        let outputs: Vec<_> = inputs.iter().map(|input| controller.tick(&scene, input)).collect();
        for output in &outputs[WARM_UP..] {
            assert_eq!((output.state.mode, output.state.cause), (Mode::Enabling, None));
            assert!(output.state.fresh && output.state.torque.length() > 0.0);
        }
        let end = outputs.last().unwrap().state;
        // Encoder counts are rounded down, to about 4e-4 rad of a joint, so the angle is accurate
        // to about that.
        let turned = OMEGA.length() * (WARM_UP + TIMED) as f64 * 1e-3;
        let q = end.q;
        assert!((2.0 * q.w.abs().min(1.0).acos() - turned).abs() < 0.01, "{q:?}, {turned}");
    }

    #[test]
    fn every_effect_has_its_figure() {
        let config = RigConfig::prototype();
        let mut scene = RunningScene::new();
        let compiled = scene.load(SceneFile::default_scene());
        assert_eq!(measure(&config.rig, &compiled).len(), compiled.effects().len());
        assert!(measure(&config.rig, &CompiledScene::empty()).is_empty());
    }
}
