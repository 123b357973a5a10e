//! From feedback to joint angles, rates and the turn of the sphere: the first stage of a tick.

use crate::device::{MAX_JOINTS, MAX_WHEELS};
use crate::encoder::Encoder;
use crate::inputs::JointFeedback;
use crate::kinematics::{self, Posture};
use crate::mode::Cause;
use crate::odometry;
use crate::outputs::Slip;
use crate::path::Trail;
use crate::rates::{Moved, Rates};
use crate::real::{PI, Real, Vec3, fabs, sqrt};
use crate::rig::{OdometryMethod, PathFit, Rig, Zero};
use crate::watch::{Interval, Watch};

/// Rates above this are not a joint's, rad/s: 100,000 turns a minute.
const MAX_RATE: Real = 1.0e4;

/// The joints and the posture that they put the sphere in.
#[derive(Debug, Clone)]
pub(crate) struct Joints {
    encoders: [Encoder; MAX_JOINTS],
    /// The last command that feedback has answered.
    sequence: Option<u32>,
    estimator: Rates,
    trail: Trail,
    pub(crate) posture: Posture,
    pub(crate) angle: [Real; MAX_JOINTS],
    pub(crate) rate: [Real; MAX_JOINTS],
    pub(crate) omega: Vec3,
    pub(crate) slip: Real,
    /// Holds the counts against the rates and the limits.
    pub(crate) watch: Watch,
}

/// What a reading brought.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Step {
    /// The turn of the sphere since the last reading, rad, in N.
    pub(crate) turn: Vec3,
    /// The commands that the last reading and this one answer.
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

    /// Whether `feedback` is newer than the last that was taken, and answers a command that has been sent before `tick`:
    /// one with a number of the future would make all later ones look old.
    #[inline]
    pub(crate) fn is_news(&self, feedback: &JointFeedback, tick: u64) -> bool {
        (tick as u32).wrapping_sub(feedback.sequence) as i32 >= 0
            && self.sequence.is_none_or(|last| feedback.sequence.wrapping_sub(last) as i32 > 0)
    }

    /// The last command that feedback has answered, if any has.
    #[inline]
    pub(crate) fn answered(&self) -> Option<u32> {
        self.sequence
    }

    /// Whether all steering zeros are known. `first`: these controllers have not rebooted since the start.
    pub(crate) fn zeros_known(rig: &Rig, feedback: &JointFeedback, first: bool) -> bool {
        (0..rig.device.joints()).step_by(2).all(|i| match rig.joints[i].zero {
            Zero::Assume => first,
            Zero::Absolute => true,
            Zero::Index => feedback.index_seen & (1 << i) != 0,
            Zero::Calibrate => false,
        })
    }

    /// Takes a reading as the first: angles from the controllers' zeros, no turn.
    pub(crate) fn start(&mut self, rig: &Rig, feedback: &JointFeedback) -> Result<(), Cause> {
        for i in 0..rig.device.joints() {
            self.encoders[i].take(feedback.counts[i]);
        }
        self.begin(rig, feedback)
    }

    /// Takes up from where the joints are; how they came there is not known.
    fn begin(&mut self, rig: &Rig, feedback: &JointFeedback) -> Result<(), Cause> {
        self.sequence = Some(feedback.sequence);
        self.trail = Trail::START;
        self.estimator.restart();
        self.watch.restart();
        self.update_rates(rig, feedback, None)?;
        self.locate(rig);
        Ok(())
    }

    /// Takes the next reading, which came `late` ticks after the tick in which it could be there: the
    /// turn of the sphere since the last one. `judged`: the motors are on, or a fault is to be reset,
    /// so that counts which the limit of speed rules out are refused.
    #[inline]
    pub(crate) fn advance(
        &mut self,
        rig: &Rig,
        feedback: &JointFeedback,
        late: u32,
        judged: bool,
    ) -> Result<Step, Cause> {
        let n = rig.device.joints();
        let last = self.sequence.unwrap_or(feedback.sequence.wrapping_sub(1));
        let ticks = feedback.sequence.wrapping_sub(last).max(1);
        let mut delta = [0.0; MAX_JOINTS];
        let mut start = [0.0; MAX_WHEELS];
        let mut plausible = true;
        for i in 0..n {
            delta[i] = self.encoders[i].peek(feedback.counts[i]);
            let most = if judged { self.watch.most(i, ticks.saturating_add(late)) } else { PI };
            plausible &= fabs(delta[i]) < most;
        }
        if !plausible {
            // Which way the sphere went is lost, but not where the joints are: the next reading is held against this one.
            for i in 0..n {
                self.encoders[i].advance(feedback.counts[i]);
            }
            self.begin(rig, feedback)?;
            return Err(Cause::ImplausibleFeedback);
        }
        for i in 0..n / 2 {
            start[i] = self.angle[2 * i];
        }
        self.update_rates(rig, feedback, Some((&delta, ticks)))?;
        for i in 0..n {
            self.encoders[i].advance(feedback.counts[i]);
        }
        self.sequence = Some(feedback.sequence);
        let turn = match (rig.methods.odometry, rig.methods.path) {
            // The frames at the step's start are those of the posture until it is moved on below.
            (OdometryMethod::Euler, _) => kinematics::forward(&rig.device, self.posture.frames(), &delta),
            (method, PathFit::Straight) => odometry::turn(&rig.device, method, &start, &delta),
            _ => self.advance_along_a_curve(rig, &start, &delta, ticks),
        };
        if judged {
            self.watch.begin(rig, &self.posture, turn);
        }
        self.locate(rig);
        if judged {
            let moved = Interval { delta: &delta, rate: &self.rate, turn, ticks, late };
            self.watch.end(rig, &self.posture, &moved);
        } else {
            self.watch.restart();
        }
        Ok(Step { turn, answered: [last, feedback.sequence] })
    }

    /// Takes one more reading into the path that is fitted to the last ones, and returns the turn along it (rad, N). Apart, so that it costs nothing where the path is straight.
    #[inline(never)]
    fn advance_along_a_curve(
        &mut self,
        rig: &Rig,
        start: &[Real; MAX_WHEELS],
        delta: &[Real; MAX_JOINTS],
        ticks: u32,
    ) -> Vec3 {
        let path = self.trail.step(rig.methods.path, delta, ticks as Real);
        odometry::turn_along(&rig.device, rig.methods.odometry, start, &path)
    }

    /// Sets the joint rates by the rig's estimate; `moved`: by how much (rad) and in how many ticks since the last reading.
    #[inline]
    fn update_rates(
        &mut self,
        rig: &Rig,
        feedback: &JointFeedback,
        moved: Option<(&[Real; MAX_JOINTS], u32)>,
    ) -> Result<(), Cause> {
        let mut rate = [0.0; MAX_JOINTS];
        for i in 0..rig.device.joints() {
            let reported = feedback.rates[i];
            if !reported.is_finite() {
                return Err(Cause::NonFinite);
            }
            if fabs(reported) > MAX_RATE {
                return Err(Cause::ImplausibleFeedback);
            }
            rate[i] = self.encoders[i].signed(reported);
        }
        if !matches!(self.estimator, Rates::Reported) {
            self.estimate_rates(rig, feedback, moved, &mut rate);
        }
        self.rate = rate;
        Ok(())
    }

    /// Moves the estimate from counts alone on by one reading, and sets `rate` to it; zero where there is only one reading. Apart, so that it costs nothing where the controllers report
    /// rates.
    #[inline(never)]
    fn estimate_rates(
        &mut self,
        rig: &Rig,
        feedback: &JointFeedback,
        moved: Option<(&[Real; MAX_JOINTS], u32)>,
        rate: &mut [Real; MAX_JOINTS],
    ) {
        let Some((delta, ticks)) = moved else {
            *rate = [0.0; MAX_JOINTS];
            return;
        };
        let mut counts = [0; MAX_JOINTS];
        for i in 0..rig.device.joints() {
            counts[i] = self.encoders[i].counted(feedback.counts[i]);
        }
        self.estimator.advance(rig, &self.encoders, &Moved { delta, counts: &counts, ticks }, rate);
    }

    /// Sets the angles, the posture, and what the rates say of the sphere.
    #[inline]
    fn locate(&mut self, rig: &Rig) {
        let n = rig.device.joints();
        let mut th = [0.0; MAX_WHEELS];
        for i in 0..n {
            self.angle[i] = self.encoders[i].angle();
        }
        for i in 0..n / 2 {
            th[i] = self.angle[2 * i];
        }
        self.posture.update(&rig.device, &th[..n / 2]);
        let forward = self.posture.forward(&rig.device, &self.rate);
        self.omega = forward.omega;
        self.slip = largest_slip(&forward.slip, n / 2);
    }

    /// A joint torque in its controller's own sense.
    #[inline]
    pub(crate) fn in_controller_sense(&self, joint: usize, torque: Real) -> Real {
        self.encoders[joint].signed(torque)
    }
}

#[inline]
fn largest_slip(slip: &Slip, wheels: usize) -> Real {
    let mut largest: Real = 0.0;
    for [u, v] in &slip[..wheels] {
        largest = largest.max(u * u + v * v);
    }
    sqrt(largest)
}
