//! Estimates how hot the motors are from the torques asked of them (i² t).
//!
//! The temperature of a winding follows the mean square of its current, averaged over a thermal
//! time T. The torque is proportional to the current, so T d(s)/dt = (tau / tau_c)² - s. If the
//! continuous torque tau_c is held forever, s ends at 1, the hottest that the motor is allowed to
//! get. From cold, a torque of k tau_c reaches 1 after T ln(k² / (k² - 1)).

use crate::design::device::MAX_JOINTS;
use crate::design::rig::Rig;
use crate::real::Real;

/// The estimated heat of all motors, from the torques that they were commanded to make.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Heat {
    time_s: Real,
    #[cfg_attr(feature = "exact", serde(deserialize_with = "crate::exact::count::<_, 0, MAX_JOINTS>"))]
    joints: usize,
    /// 1 / tau_c² of each joint, 1/(N m)², with the motor's continuous torque tau_c. 0 if the joint
    /// has no motor.
    scale: [Real; MAX_JOINTS],
    /// Heat that each motor would reach if the present torques were held forever. 1 is as hot as
    /// allowed.
    end: [Real; MAX_JOINTS],
    /// Present heat of each joint's motor, from 0 (cold) to 1 (as hot as allowed).
    share: [Real; MAX_JOINTS],
    too_hot: bool,
}

impl Heat {
    /// Creates the estimate with all motors cold. `time_s` is the thermal time constant of the
    /// motors, s.
    pub(crate) fn new(rig: &Rig, time_s: Real) -> Self {
        let mut scale = [0.0; MAX_JOINTS];
        for (scale, joint) in scale.iter_mut().zip(&rig.joints[..rig.device.joints()]) {
            if joint.peak > 0.0 && joint.continuous > 0.0 {
                *scale = 1.0 / (joint.continuous * joint.continuous);
            }
        }
        Self {
            time_s,
            joints: rig.device.joints(),
            scale,
            end: [0.0; MAX_JOINTS],
            share: [0.0; MAX_JOINTS],
            too_hot: false,
        }
    }

    /// Advances the estimated heat by `dt` seconds, during which the motors made the latest
    /// torques.
    #[inline]
    pub(crate) fn advance(&mut self, dt: Real) {
        // Implicit Euler: with a step of any length the value stays between the old one and the end
        // value.
        let gain = dt / (self.time_s + dt);
        let mut hot = false;
        for i in 0..self.joints {
            self.share[i] += (self.end[i] - self.share[i]) * gain;
            hot |= self.share[i] >= 1.0;
        }
        self.too_hot = hot;
    }

    /// Returns true if at least one motor is as hot as allowed or hotter.
    #[inline]
    pub(crate) fn too_hot(&self) -> bool {
        self.too_hot
    }

    /// Sets the joint torques that the motors make from now on, N m.
    #[inline]
    pub(crate) fn hold(&mut self, torque: &[Real; MAX_JOINTS]) {
        for i in 0..self.joints {
            self.end[i] = torque[i] * torque[i] * self.scale[i];
        }
    }
}
