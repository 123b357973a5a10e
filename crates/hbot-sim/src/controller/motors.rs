//! Motors with lag, heat, back-EMF and a torque error: from commanded torque to acting torque.

use core::ops::Range;

use hbot_core::design::device::MAX_JOINTS;

use super::joint::Axis;
use crate::phenomena::Motor;
use crate::plant::JointTorques;

/// Size below which a decaying motor current is set to zero, to avoid slow computations with
/// subnormal numbers. The current is expressed as a joint torque, N m.
const NONE: f64 = 1.0e-15;

/// Currents and heat of all simulated motors. Each current is expressed as the joint torque (N m)
/// that it gives according to the motor controller. The true torque can differ.
#[derive(Debug, Clone)]
pub(super) struct Motors {
    motor: Motor,
    pub(super) current: JointTorques,
    /// Mean of the squared current of each motor over about its thermal time constant, N² m². The
    /// motor is hot if this mean reaches the square of its continuous torque.
    heat: JointTorques,
    /// Torques that act at the joints now, N m.
    pub(super) acting: JointTorques,
}

impl Motors {
    /// Creates cold motors. Their currents are those with which the motor controllers expect the
    /// torques `acting`, N m.
    pub(super) fn new(motor: Motor, acting: &JointTorques) -> Self {
        let mut motors = Self { motor, current: *acting, heat: [0.0; MAX_JOINTS], acting: [0.0; MAX_JOINTS] };
        motors.act();
        motors
    }

    /// Replaces the parameters of the motors. Their currents and heat are kept.
    pub(super) fn replace(&mut self, motor: Motor) {
        self.motor = motor;
        self.act();
    }

    /// Simulates that the motors of `joints` lose power: their currents become zero, and their heat
    /// stays.
    pub(super) fn reboot(&mut self, joints: Range<usize>) {
        self.current[joints].fill(0.0);
        self.act();
    }

    /// Advances the motor currents by `h` seconds towards the commanded torques `asked`, N m.
    /// Meanwhile the joints turn at `rates`, rad/s.
    ///
    /// `asked` is positive in the joint's positive direction and within the peak torque. Returns
    /// the mean torque of each joint over the `h` seconds, N m. A constant torque of this size
    /// gives the same impulse.
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

    /// Returns whether the motor of joint `j` gives less than the commanded torque `asked` because
    /// it is hot.
    pub(super) fn derates(&self, j: usize, axis: &Axis, asked: f64) -> bool {
        self.is_hot(j, axis) && asked.abs() > axis.joint.continuous
    }

    fn is_hot(&self, j: usize, axis: &Axis) -> bool {
        self.heat[j] >= axis.joint.continuous * axis.joint.continuous
    }

    /// Returns the largest torque that joint `j`'s motor can give in the direction of the commanded
    /// torque `asked`, N m. The supply voltage limits it at high rates, and heat limits it to the
    /// continuous torque.
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

/// Returns what fraction of a deviation remains while it decays exponentially with the time
/// constant `tau` (s). The first value is the fraction after `h` seconds, and the second its mean
/// over these seconds.
fn left(h: f64, tau: f64) -> (f64, f64) {
    if !(tau > 0.0) {
        return (0.0, 0.0);
    }
    let x = h / tau;
    let gone = -libm::expm1(-x);
    (1.0 - gone, gone / x)
}
