//! Motors as they are: between the torque that is asked of them and the one that acts.

use core::ops::Range;

use hbot_core::device::MAX_JOINTS;

use super::joint::Axis;
use crate::phenomena::Motor;
use crate::plant::JointTorques;

/// Below this a current that fades is none, in N m: so it does not linger in numbers too small to be normal.
const NONE: f64 = 1.0e-15;

/// The currents and the heat of all motors. Currents are in N m of the joint, as the controller believes them to push.
#[derive(Debug, Clone)]
pub(super) struct Motors {
    motor: Motor,
    current: JointTorques,
    /// Mean square of the current over the thermal time, N² m².
    heat: JointTorques,
    /// The torques that act now, N m.
    pub(super) acting: JointTorques,
}

impl Motors {
    /// Cold motors that give `acting` at the moment.
    pub(super) fn new(motor: Motor, acting: &JointTorques) -> Self {
        let mut motors = Self { motor, current: *acting, heat: [0.0; MAX_JOINTS], acting: [0.0; MAX_JOINTS] };
        motors.act();
        motors
    }

    /// Has the figures replaced; currents and heat stay.
    pub(super) fn replace(&mut self, motor: Motor) {
        self.motor = motor;
        self.act();
    }

    /// Power lost at some joints: no current, and no cooler for it.
    pub(super) fn reboot(&mut self, joints: Range<usize>) {
        self.current[joints].fill(0.0);
        self.act();
    }

    /// Moves the currents on by `h` seconds towards what is asked (joint's sense, within the peak), with the joints turning
    /// at `rates`, and returns the mean torques over that time: held for as long they give the exact impulse.
    pub(super) fn drive(
        &mut self,
        h: f64,
        axes: &[Axis],
        asked: &JointTorques,
        rates: &[f64; MAX_JOINTS],
    ) -> JointTorques {
        // What of the way to its end a current still has to go: after h, and in the mean over h.
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

    /// Whether a motor gives less than is asked of it because it is hot.
    pub(super) fn derates(&self, j: usize, axis: &Axis, asked: f64) -> bool {
        self.is_hot(j, axis) && asked.abs() > axis.joint.continuous
    }

    fn is_hot(&self, j: usize, axis: &Axis) -> bool {
        self.heat[j] >= axis.joint.continuous * axis.joint.continuous
    }

    /// The largest torque that motor and supply give in the direction asked for, N m.
    fn limit(&self, j: usize, axis: &Axis, asked: f64, rate: f64) -> f64 {
        let peak = f64::from(axis.peak);
        let no_load =
            if j.is_multiple_of(2) { self.motor.steer_no_load_rate } else { self.motor.drive_no_load_rate };
        // The voltage that is left falls with the rate where the motor drives the joint on; where it brakes, back-EMF helps.
        let driven = if asked * rate > 0.0 { rate.abs() } else { 0.0 };
        let supply = peak * (1.0 - driven / no_load).max(0.0);
        if self.is_hot(j, axis) { supply.min(axis.joint.continuous) } else { supply }
    }

    fn act(&mut self) {
        self.acting = self.current.map(|current| current * self.motor.torque_scale);
    }
}

/// Of a first-order approach with time constant `tau`: what of the way is left after `h`, and in the mean over `h`.
fn left(h: f64, tau: f64) -> (f64, f64) {
    if !(tau > 0.0) {
        return (0.0, 0.0);
    }
    let x = h / tau;
    let gone = -libm::expm1(-x);
    (1.0 - gone, gone / x)
}
