//! Motors with lag, heat, back-EMF and a torque error: from commanded torque to acting torque.

use core::ops::Range;

use hbot_core::device::MAX_JOINTS;

use super::joint::Axis;
use crate::phenomena::Motor;
use crate::plant::JointTorques;

/// Current below which a decaying current becomes zero, as a torque in N m. This avoids subnormal
/// numbers.
const NONE: f64 = 1.0e-15;

/// Currents and heat of all motors. A current is expressed as the joint torque (N m) that the motor
/// controller assumes it gives.
#[derive(Debug, Clone)]
pub(super) struct Motors {
    motor: Motor,
    current: JointTorques,
    /// Running mean of the squared current over the thermal time constant, N² m².
    heat: JointTorques,
    /// Torques that act at the joints now, N m.
    pub(super) acting: JointTorques,
}

impl Motors {
    /// Creates cold motors whose currents correspond to the torques `acting`, N m.
    pub(super) fn new(motor: Motor, acting: &JointTorques) -> Self {
        let mut motors = Self { motor, current: *acting, heat: [0.0; MAX_JOINTS], acting: [0.0; MAX_JOINTS] };
        motors.act();
        motors
    }

    /// Replaces the parameters. Currents and heat are kept.
    pub(super) fn replace(&mut self, motor: Motor) {
        self.motor = motor;
        self.act();
    }

    /// Power lost at some joints: no current, and no cooler for it.
    pub(super) fn reboot(&mut self, joints: Range<usize>) {
        self.current[joints].fill(0.0);
        self.act();
    }

    /// Advances the currents by `h` seconds towards the commanded torques `asked`, while the joints
    /// turn at `rates`.
    ///
    /// `asked` is in the joint's own sense and within the peak. Returns the mean torques over that
    /// time; applied for `h`, they give the exact impulse.
    pub(super) fn drive(
        &mut self,
        h: f64,
        axes: &[Axis],
        asked: &JointTorques,
        rates: &[f64; MAX_JOINTS],
    ) -> JointTorques {
        // Remaining fraction of a current's way to its final value: after h, and as the mean over
        // h.
        let (left, mean_left) = left(h, self.motor.lag_s);
        let (heat_left, _) = self::left(h, self.motor.thermal_time_s);
        let mut mean = [0.0; MAX_JOINTS];
        for (j, axis) in axes.iter().enumerate() {
            let limit = self.limit(j, axis, asked[j], rates[j]);
            let end = asked[j].clamp(-limit, limit);
            let way = self.current[j] - end;
            let amid = end + way * mean_left;
            self.current[j] = end + way * left;
            if end == 0.0 && self.current[j].abs() < NONE {
                self.current[j] = 0.0;
            }
            let square = amid * amid;
            self.heat[j] = square + (self.heat[j] - square) * heat_left;
            mean[j] = amid * self.motor.torque_scale;
        }
        self.act();
        mean
    }

    /// Returns whether a motor gives less than the commanded torque because it is hot.
    pub(super) fn derates(&self, j: usize, axis: &Axis, asked: f64) -> bool {
        self.is_hot(j, axis) && asked.abs() > axis.joint.continuous
    }

    fn is_hot(&self, j: usize, axis: &Axis) -> bool {
        self.heat[j] >= axis.joint.continuous * axis.joint.continuous
    }

    /// Returns the largest torque that motor and supply can give in the commanded direction, N m.
    fn limit(&self, j: usize, axis: &Axis, asked: f64, rate: f64) -> f64 {
        let peak = f64::from(axis.peak);
        let no_load =
            if j.is_multiple_of(2) { self.motor.steer_no_load_rate } else { self.motor.drive_no_load_rate };
        // If the motor drives the joint, the remaining voltage falls with the rate. If it brakes,
        // the back-EMF helps it.
        let driven = if asked * rate > 0.0 { rate.abs() } else { 0.0 };
        let supply = peak * (1.0 - driven / no_load).max(0.0);
        if self.is_hot(j, axis) { supply.min(axis.joint.continuous) } else { supply }
    }

    fn act(&mut self) {
        self.acting = self.current.map(|current| current * self.motor.torque_scale);
    }
}

/// Returns the remaining fraction of a first-order approach with time constant `tau`: after `h`,
/// and as the mean over `h`.
fn left(h: f64, tau: f64) -> (f64, f64) {
    if !(tau > 0.0) {
        return (0.0, 0.0);
    }
    let x = h / tau;
    let gone = -libm::expm1(-x);
    (1.0 - gone, gone / x)
}
