//! Computes joint angles, rates and the turn of the sphere from a reading: the first stage of a
//! tick.

use crate::count::Count;
use crate::design::device::{MAX_JOINTS, MAX_WHEELS};
use crate::design::kinematics::Posture;
use crate::design::rig::{OdometryMethod, PathFit, Rig, Zero};
use crate::inputs::JointReadings;
use crate::motion::encoder::Encoder;
use crate::motion::odometry;
use crate::motion::path::Trail;
use crate::motion::rates::{Moved, Rates};
use crate::outputs::Slip;
use crate::real::{PI, Real, Vec3, fabs, sqrt};
use crate::safety::mode::Cause;
use crate::safety::watch::{Interval, Watch};

/// Largest joint rate that is still plausible, rad/s: about 100,000 turns a minute. A larger
/// reported rate is a fault.
const MAX_RATE: Real = 1.0e4;

/// Angles and rates of all joints, and the motion of the sphere that follows from them.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Joints {
    encoders: [Encoder; MAX_JOINTS],
    /// Number of the last command that a reading has answered. `None` before the first reading.
    sequence: Option<u32>,
    estimator: Rates,
    trail: Trail,
    pub(crate) posture: Posture,
    pub(crate) angle: [Real; MAX_JOINTS],
    pub(crate) rate: [Real; MAX_JOINTS],
    pub(crate) omega: Vec3,
    pub(crate) slip: Real,
    /// Compares the encoder counts with the joint rates and with the rig's limits, to detect
    /// faults.
    pub(crate) watch: Watch,
}

/// The result of taking a reading: how far the sphere has turned since the last one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Step {
    /// Turn of the sphere since the last reading, as a rotation vector in frame N, in rad.
    pub(crate) turn: Vec3,
    /// Numbers of two commands: the one that the last reading answered, and the one that this
    /// reading answers.
    pub(crate) answered: [u32; 2],
}

impl Joints {
    pub(crate) fn new(rig: &Rig) -> Self {
        let encoders = rig.joints.map(|joint| Encoder::new(&joint));
        Self {
            estimator: Rates::new(rig, &encoders),
            encoders,
            sequence: None,
            trail: Trail::START,
            posture: Posture::new(&rig.device, &[0.0; MAX_WHEELS]),
            angle: [0.0; MAX_JOINTS],
            rate: [0.0; MAX_JOINTS],
            omega: Vec3::ZERO,
            slip: 0.0,
            watch: Watch::new(rig),
        }
    }

    /// Returns true if `feedback` is newer than the last reading taken, and if its number is not
    /// later than `tick`. A reading with a number from the future is refused, because all correct
    /// readings after it would look old.
    #[inline]
    pub(crate) fn is_news(&self, feedback: &JointReadings, tick: u64) -> bool {
        (tick as u32).wrapping_sub(feedback.sequence) as i32 >= 0
            && self.sequence.is_none_or(|last| feedback.sequence.wrapping_sub(last) as i32 > 0)
    }

    /// Returns the number of the last command that a reading has answered, or `None` before the
    /// first reading.
    #[inline]
    pub(crate) fn answered(&self) -> Option<u32> {
        self.sequence
    }

    /// Returns true if the zeros of all steer joints are known. `first` is true if no motor
    /// controller has rebooted since the start.
    pub(crate) fn zeros_known(rig: &Rig, feedback: &JointReadings, first: bool) -> bool {
        (0..rig.device.joints()).step_by(2).all(|i| match rig.joints[i].zero {
            Zero::Assume => first,
            Zero::Absolute => true,
            Zero::Index => feedback.index_seen & (1 << i) != 0,
            Zero::Calibrate => false,
        })
    }

    /// Takes the first reading. Angles are measured from the motor controllers' zeros, and the
    /// sphere has not turned yet.
    pub(crate) fn start(&mut self, rig: &Rig, feedback: &JointReadings) -> Result<(), Cause> {
        for i in 0..rig.device.joints() {
            self.encoders[i].take(feedback.counts[i]);
        }
        self.begin(rig, feedback)
    }

    /// Starts measuring anew at the present joint angles, because the path of the joints up to now
    /// is not known.
    fn begin(&mut self, rig: &Rig, feedback: &JointReadings) -> Result<(), Cause> {
        self.sequence = Some(feedback.sequence);
        self.trail = Trail::START;
        self.estimator.restart();
        let count = rig.device.count();
        let rates = self.update_rates(count, rig, feedback, None);
        self.watch.restart(&self.reported(rig, feedback));
        rates?;
        self.locate(count, rig);
        Ok(())
    }

    /// Takes the next reading and returns the turn of the sphere since the last reading.
    ///
    /// `late` is the number of ticks by which the reading came later than possible, and `time` the
    /// time since the last reading, in ticks. `judged` is
    /// true if the motors are on or a fault is to be reset. In this case, changes of the encoder
    /// counts that are impossible within the speed limit are refused.
    #[inline]
    pub(crate) fn advance<C: Count>(
        &mut self,
        count: C,
        rig: &Rig,
        feedback: &JointReadings,
        (late, time): (u32, Real),
        judged: bool,
    ) -> Result<Step, Cause> {
        let n = count.joints();
        let last = self.sequence.unwrap_or(feedback.sequence.wrapping_sub(1));
        let ticks = feedback.sequence.wrapping_sub(last).max(1);
        let mut delta = [0.0; MAX_JOINTS];
        let mut plausible = true;
        for i in 0..n {
            delta[i] = self.encoders[i].peek(feedback.counts[i]);
            let most = if judged { self.watch.most(i, ticks.saturating_add(late)) } else { PI };
            plausible &= fabs(delta[i]) < most;
        }
        if !plausible {
            // The path of the sphere is lost, but the joint angles are known. The next reading is
            // compared with this one.
            for i in 0..n {
                self.encoders[i].advance(feedback.counts[i]);
            }
            self.begin(rig, feedback)?;
            return Err(Cause::ImplausibleFeedback);
        }
        self.update_rates(count, rig, feedback, Some((&delta, time)))?;
        for i in 0..n {
            self.encoders[i].advance(feedback.counts[i]);
        }
        self.sequence = Some(feedback.sequence);
        let turn = match (rig.methods.odometry, rig.methods.path) {
            // The posture still holds the frames at the start of the step. It is updated below.
            (OdometryMethod::Euler, _) => self.posture.omega_of(count, &rig.device, &delta),
            (method, PathFit::Straight) => {
                odometry::turn_of(count, &rig.device, method, &self.steer_angles(count), &delta)
            }
            _ => self.advance_along_a_curve(rig, &delta, ticks),
        };
        if judged {
            self.watch.begin(count, &self.posture, turn);
        }
        self.locate(count, rig);
        if !judged {
            self.watch.restart(&self.reported(rig, feedback));
        } else if matches!(self.estimator, Rates::Reported) {
            let moved = Interval { delta: &delta, rate: &self.rate, turn, ticks, late };
            self.watch.end(count, rig, &self.posture, &moved);
        } else {
            let moved = Interval { delta: &delta, rate: &self.reported(rig, feedback), turn, ticks, late };
            self.watch.end(count, rig, &self.posture, &moved);
        }
        Ok(Step { turn, answered: [last, feedback.sequence] })
    }

    /// Returns the joint rates that the motor controllers report, rad/s, with which the counts are
    /// compared: rates that the rig estimates from the counts always agree with them. A controller
    /// that reports no rate says 0: its rate is the estimated one.
    #[inline(never)]
    fn reported(&self, rig: &Rig, feedback: &JointReadings) -> [Real; MAX_JOINTS] {
        let mut rate = [0.0; MAX_JOINTS];
        for i in 0..rig.device.joints() {
            let reported = feedback.rates[i];
            let says = reported != 0.0 && fabs(reported) <= MAX_RATE;
            rate[i] = if says { self.encoders[i].signed(reported) } else { self.rate[i] };
        }
        rate
    }

    /// Computes the turn of the sphere from the last to this reading (rotation vector, rad, frame
    /// N), along a curve that is fitted to the last few readings. It is a separate function, so
    /// that it costs nothing if the rig uses straight paths.
    #[inline(never)]
    fn advance_along_a_curve(&mut self, rig: &Rig, delta: &[Real; MAX_JOINTS], ticks: u32) -> Vec3 {
        let path = self.trail.step(rig.methods.path, delta, ticks as Real);
        let start = self.steer_angles(rig.device.count());
        odometry::turn_along(&rig.device, rig.methods.odometry, &start, &path)
    }

    /// Returns the steer angle of each wheel, rad.
    #[inline(always)]
    fn steer_angles<C: Count>(&self, count: C) -> [Real; MAX_WHEELS] {
        let mut steer = [0.0; MAX_WHEELS];
        for i in 0..count.wheels() {
            steer[i] = self.angle[2 * i];
        }
        steer
    }

    /// Sets the joint rates by the method that the rig selects. `moved` holds the change of each
    /// joint's angle (rad) and the time since the last reading, in ticks.
    #[inline]
    fn update_rates<C: Count>(
        &mut self,
        count: C,
        rig: &Rig,
        feedback: &JointReadings,
        moved: Option<(&[Real; MAX_JOINTS], Real)>,
    ) -> Result<(), Cause> {
        for reported in &feedback.rates[..count.joints()] {
            if !(fabs(*reported) <= MAX_RATE) {
                let finite = reported.is_finite();
                return Err(if finite { Cause::ImplausibleFeedback } else { Cause::NonFinite });
            }
        }
        if !matches!(self.estimator, Rates::Reported) {
            self.estimate_rates(rig, feedback, moved);
            return Ok(());
        }
        for i in 0..count.joints() {
            self.rate[i] = self.encoders[i].signed(feedback.rates[i]);
        }
        Ok(())
    }

    /// Sets the joint rates to those estimated from encoder counts. They are zero if there is only
    /// one reading. It is a separate function, so that it costs nothing if the motor controllers
    /// report rates.
    #[inline(never)]
    fn estimate_rates(
        &mut self,
        rig: &Rig,
        feedback: &JointReadings,
        moved: Option<(&[Real; MAX_JOINTS], Real)>,
    ) {
        let Some((delta, ticks)) = moved else {
            self.rate = [0.0; MAX_JOINTS];
            return;
        };
        let mut counts = [0; MAX_JOINTS];
        for i in 0..rig.device.joints() {
            counts[i] = self.encoders[i].counted(feedback.counts[i]);
        }
        self.estimator.advance(rig, &self.encoders, &Moved { delta, counts: &counts, ticks }, &mut self.rate);
    }

    /// Updates the joint angles and the posture, and computes the sphere's angular velocity and the
    /// slip from the joint rates.
    #[inline(always)]
    fn locate<C: Count>(&mut self, count: C, rig: &Rig) {
        for i in 0..count.joints() {
            self.angle[i] = self.encoders[i].angle();
        }
        let forward = self.posture.follow(count, &rig.device, &self.angle, &self.rate);
        self.omega = forward.omega;
        self.slip = largest_slip(&forward.slip, count.wheels());
    }

    /// Converts a joint torque to the sign convention of the joint's motor controller.
    #[inline]
    pub(crate) fn in_controller_sense(&self, joint: usize, torque: Real) -> Real {
        self.encoders[joint].signed(torque)
    }
}

/// Returns the slip of the wheel that slips most, of the first `wheels` wheels, in the unit of
/// `slip`.
#[inline]
pub(crate) fn largest_slip(slip: &Slip, wheels: usize) -> Real {
    let mut largest: Real = 0.0;
    for [u, v] in &slip[..wheels] {
        largest = largest.max(u * u + v * v);
    }
    sqrt(largest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slip_has_two_components_and_that_of_the_worst_wheel_counts() {
        let slip = |first: [Real; 2], second: [Real; 2]| {
            let mut slip = [[9.0; 2]; MAX_WHEELS];
            (slip[0], slip[1]) = (first, second);
            largest_slip(&slip, 2)
        };
        for sign in [1.0, -1.0] {
            assert_eq!(slip([3.0 * sign, 0.0], [0.0; 2]), 3.0, "along c1 alone");
            assert_eq!(slip([0.0; 2], [0.0, 4.0 * sign]), 4.0, "along c2 alone");
            assert_eq!(slip([3.0 * sign, -4.0 * sign], [0.0; 2]), 5.0, "along both");
        }
        assert_eq!(slip([1.0, 1.0], [3.0, -4.0]), 5.0, "the second wheel slips more");
        assert_eq!(slip([3.0, -4.0], [1.0, 1.0]), 5.0, "the first wheel slips more");
        assert_eq!(slip([0.0; 2], [0.0; 2]), 0.0, "wheels that are not there do not count");
    }
}
