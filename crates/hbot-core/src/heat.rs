//! How hot motors get: i² t by the torques that are asked of them.
//!
//! A winding's temperature follows the mean square of its current over its thermal time T, and with it that of the torque:
//! T d(s)/dt = (tau / tau_c)² - s. With the continuous torque tau_c held for ever s ends at 1, which is as hot as the motor may get. From
//! cold, a torque of k tau_c reaches that after T ln(k² / (k² - 1)).

use crate::device::MAX_JOINTS;
use crate::real::Real;
use crate::rig::Rig;

/// The heat of all motors.
#[derive(Debug, Clone)]
pub(crate) struct Heat {
    time_s: Real,
    joints: usize,
    /// 1 / tau_c² of each joint; 0 where it has no motor.
    scale: [Real; MAX_JOINTS],
    /// What the torques held now would end in.
    end: [Real; MAX_JOINTS],
    /// s of each joint, 0 cold to 1 as hot as it may get.
    share: [Real; MAX_JOINTS],
    too_hot: bool,
}

impl Heat {
    /// Cold motors that average over `time_s`.
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

    /// Heats the motors for `dt` seconds by the torques asked for last.
    #[inline]
    pub(crate) fn advance(&mut self, dt: Real) {
        // Implicit Euler: at any step it stays between where it was and where it goes.
        let gain = dt / (self.time_s + dt);
        let mut hot = false;
        for i in 0..self.joints {
            self.share[i] += (self.end[i] - self.share[i]) * gain;
            hot |= self.share[i] >= 1.0;
        }
        self.too_hot = hot;
    }

    /// Whether a motor is as hot as it may get.
    #[inline]
    pub(crate) fn too_hot(&self) -> bool {
        self.too_hot
    }

    /// Takes the torques to be held from now on, N m.
    #[inline]
    pub(crate) fn hold(&mut self, torque: &[Real; MAX_JOINTS]) {
        for i in 0..self.joints {
            self.end[i] = torque[i] * torque[i] * self.scale[i];
        }
    }
}
