//! Checks every tick against the promises of a rig. It uses its own model, which only knows the
//! inputs and the outputs of the ticks.

use crate::prelude::*;
use hbot_core::allocation::{ContactArms, traction};

use super::Seen;
use crate::bench::assert_finite;

/// Duration of the soft start, s.
const SOFT_START: f64 = 0.5;
/// Duration of the ramp at disable, s.
const DISABLE: f64 = 0.05;
/// Time after which the old torque is gone when a scene with a distant reference is loaded, s.
const FADE: f64 = 0.05;
/// Rounding of a torque that goes through the joints and back, N m.
const ROUNDING: f64 = 1e-9;

/// Actions of the session that the inputs of a tick do not show.
#[derive(Debug, Default)]
pub struct Told {
    /// Slots whose effects a load or a set has just placed.
    pub placed: Vec<u8>,
    /// Whether an enable was obeyed.
    pub enabled: bool,
}

pub struct Judge {
    rig: Rig,
    name: String,
    torque: Vec3,
    tick: Option<u64>,
    revision: u64,
    mode: Mode,
    /// Torque that the soft start and the ramp at disable allow, as a share of the limit.
    ramp: f64,
    /// Torque when the last soft start began, N m.
    carried: f64,
    /// Time since the last soft start began, s.
    carried_s: f64,
    /// Whether nobody has enabled torque since the last stop.
    stopped: bool,
    newest: Option<u32>,
}

impl Judge {
    pub fn new(rig: Rig, name: String) -> Self {
        Self {
            rig,
            name,
            torque: Vec3::ZERO,
            tick: None,
            revision: 0,
            mode: Mode::Unreferenced,
            ramp: 0.0,
            carried: 0.0,
            carried_s: 1.0,
            stopped: true,
            newest: None,
        }
    }

    pub fn judge(
        &mut self,
        inputs: &Inputs,
        told: &Told,
        scene: &CompiledScene,
        outputs: &Outputs,
        seen: &mut Seen,
    ) {
        assert_finite(outputs);
        let state = &outputs.state;
        let limits = &self.rig.limits;
        let elapsed = self.tick.map_or(1, |last| inputs.tick - last);
        let dt = elapsed.min(10) as f64 * DT;
        let size = state.torque.length();
        let what = || format!("{} tick {}: {state:?}", self.name, inputs.tick);
        // The ramps.
        let off = matches!(state.mode, Mode::Fault | Mode::Estop | Mode::Unreferenced);
        self.stopped = (self.stopped || matches!(state.mode, Mode::Fault | Mode::Estop)) && !told.enabled;
        self.ramp = match state.mode {
            Mode::Enabling | Mode::Active => (self.ramp + dt / SOFT_START).min(1.0),
            Mode::Idle => (self.ramp - dt / DISABLE).max(0.0),
            _ => 0.0,
        };
        let on = matches!(state.mode, Mode::Enabling | Mode::Active);
        let far = on && scene.revision() != self.revision && self.comes_from_afar(told, scene, outputs);
        self.carried_s += dt;
        if told.enabled && self.mode == Mode::Idle {
            // This happens within the ramp of a disable. References are anchored anew, which can
            // also place them far away.
            (self.carried, self.carried_s) = (self.torque.length(), 0.0);
        }
        if far {
            seen.far_changes += 1;
            (self.ramp, self.carried, self.carried_s) = (0.0, self.torque.length(), 0.0);
        }
        // One tick of tolerance for the order of operations in a tick.
        let ramp = if self.ramp > 0.0 || far { (self.ramp + dt / SOFT_START).min(1.0) } else { 0.0 };
        let carried = self.carried * (1.0 - (self.carried_s - dt) / FADE).clamp(0.0, 1.0);
        let ramped = limits.torque * ramp + carried;
        let reach = limits.torque_rate * dt;
        // The slew limit can keep the torque above the ramp, but then the torque does not grow.
        // After the ramp of a disable has ended, it falls as fast as the slew limit allows.
        let before = self.torque.length();
        let falling = if self.ramp == 0.0 { before - reach } else { before };
        let bound = ramped.min(limits.torque).max(falling) + ROUNDING;
        assert!(size <= limits.torque + ROUNDING, "above the limit: {}", what());
        assert!(size <= bound, "above the ramp: {size} > {bound}, {}", what());
        // The slew limit, which does not apply to stops.
        let change = (state.torque - self.torque).length();
        if off {
            assert!(size == 0.0 && !outputs.drive.enable, "torque without leave: {}", what());
        } else {
            // A direction that the wheels lose, and a torque that the motors can no longer hold
            // after steering, vanish at once. No software can hold them.
            let forced =
                change > reach + ROUNDING && (state.deficient || self.least_change(outputs) > 0.98 * reach);
            seen.forced += u64::from(forced);
            assert!(
                forced || change <= reach + ROUNDING,
                "slew: {change} > {reach} from {}, {}",
                self.torque,
                what()
            );
        }
        assert!(size == 0.0 || !self.stopped, "torque that nobody asked for: {}", what());
        // Motors and contacts.
        let joints = self.rig.device.joints();
        for (torque, joint) in state.joint_torque[..joints].iter().zip(&self.rig.joints) {
            assert!(torque.abs() <= joint.peak * (1.0 + 1e-12), "beyond a motor: {}", what());
        }
        if let Some(grip) = limits.traction {
            let arms: Vec<_> = self
                .rig
                .device
                .wheels()
                .iter()
                .map(|wheel| ContactArms::of(wheel, self.rig.device.sphere_radius()))
                .collect();
            let load = traction(&arms, &state.joint_torque[..joints], grip.mu * grip.normal_force);
            assert!(load <= 1.0 + 1e-9, "beyond a contact's grip, {load}: {}", what());
        }
        // The age of the newest reading.
        if let Some(feedback) = inputs.feedback {
            let newer = self.newest.is_none_or(|newest| feedback.sequence.wrapping_sub(newest) as i32 > 0);
            self.newest = if newer { Some(feedback.sequence) } else { self.newest };
        }
        // The age counts from the last command that was sent. Skipped ticks have sent none.
        let oldest = u64::from(self.rig.timing.timeout_ticks) + elapsed.max(1);
        if self.newest.is_some_and(|newest| inputs.tick - u64::from(newest) > oldest) {
            assert!(off, "torque of a reading that is too old: {}", what());
        }
        seen.powered += u64::from(outputs.drive.enable);
        seen.at_limit += u64::from(size > 0.99 * limits.torque);
        seen.enables += u64::from(told.enabled);
        seen.lost_links += u64::from(state.cause == Some(Cause::LinkLost) && self.mode != Mode::Fault);
        seen.stops += u64::from(state.mode == Mode::Estop && self.mode != Mode::Estop);
        seen.eased += u64::from(change > 0.999 * reach && state.scale < 0.999 && size < 0.99 * limits.torque);
        (self.torque, self.tick, self.mode, self.revision) =
            (state.torque, Some(inputs.tick), state.mode, scene.revision());
    }

    /// Returns the smallest change from the torque of the last tick that motors and contacts allow
    /// at the present posture, N m. It uses projected gradient descent on the joint torques.
    fn least_change(&self, outputs: &Outputs) -> f64 {
        let joints = self.rig.device.joints();
        let steering: Vec<f64> = outputs.state.angle[..joints].iter().step_by(2).copied().collect();
        let posture = Posture::new(&self.rig.device, &steering);
        let mut tau = outputs.state.joint_torque;
        let step = 0.2 / posture.rows().iter().map(|row| row.length_squared()).sum::<f64>();
        for _ in 0..20_000 {
            let left = self.torque - posture.torque_on_sphere(&tau[..joints]);
            for (j, row) in posture.rows().iter().enumerate() {
                let peak = self.rig.joints[j].peak;
                tau[j] = (tau[j] + step * row.dot(left)).clamp(-peak, peak);
            }
            if let Some(grip) = self.rig.limits.traction {
                for (i, wheel) in self.rig.device.wheels().iter().enumerate() {
                    let arms = [ContactArms::of(wheel, self.rig.device.sphere_radius())];
                    let load = traction(&arms, &tau[2 * i..2 * i + 2], grip.mu * grip.normal_force);
                    tau[2 * i..2 * i + 2].iter_mut().for_each(|t| *t /= load.max(1.0));
                }
            }
        }
        (self.torque - posture.torque_on_sphere(&tau[..joints])).length()
    }

    /// Returns whether the change of scene has placed a spring further from the sphere than
    /// `enable` accepts.
    fn comes_from_afar(&self, told: &Told, scene: &CompiledScene, outputs: &Outputs) -> bool {
        scene.effects().iter().any(|effect| {
            let far = matches!(effect.kind, Kind::Spring(_))
                && effect.kind.reference().is_some_and(|(reference, anchor)| {
                    // Within its dead band the sphere rests.
                    let away = effect.kind.excess(reference, outputs.state.q, &[]);
                    anchor == Anchor::Absolute
                        && away.is_some_and(|away| away > self.rig.limits.enable_max_angle + 1e-9)
                });
            far && !effect.leaving && told.placed.contains(&effect.slot)
        })
    }
}
