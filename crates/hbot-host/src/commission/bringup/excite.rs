//! Moves the sphere by the motors, gently and in many ways, so that friction, torque constants and
//! inertias show in how it moves.
//!
//! The sphere follows a wandering angular velocity by a soft controller. Torques that cancel each
//! other at the sphere (null-space torques) are added: only if the torque constants differ, they
//! move it. All torques stay far below the limits of motors, contacts and rig, and change slowly.

use std::f64::consts::TAU;
use std::fmt;

use hbot_core::allocation::{ContactArms, JointLimits, allocate, traction};
use hbot_core::design::kinematics::Posture;
use hbot_core::design::rig::Zero;
use hbot_core::inputs::{Complaints, JointReadings};
use hbot_core::{MAX_JOINTS, MAX_WHEELS, Mat3, Quat, Vec3};

use super::{Bench, Interrupted};

/// Largest joint torque, as a fraction of what the motor can hold continuously.
const MOST: f64 = 0.5;
/// Largest force at a contact, as a fraction of what friction holds.
const GRIP: f64 = 0.5;
/// Largest torque on the sphere, as a fraction of the rig's limit.
const TORQUE: f64 = 0.3;
/// Share of the largest joint torque that null-space torques take.
const AGAINST: f64 = 0.6;
/// Time in which a joint torque goes from nothing to its largest value, s.
const RISE_S: f64 = 0.05;
/// Time in which the motion begins and ends, s.
const FADE_S: f64 = 1.0;
/// Time constant of the controller of the sphere's speed, s, and of its integral part.
const FOLLOW_S: f64 = 0.1;
const INTEGRAL_S: f64 = 0.5;
/// Frequencies of the wandering, Hz: from the slowest to the fastest of the sines.
const WANDER_HZ: [f64; 2] = [0.06, 0.45];
/// Number of sines about each axis.
const SINES: usize = 5;
/// Time in which a joint must come to rest after its own test, s.
const BRAKE_S: f64 = 1.0;

/// Rate of a joint from which on it is braked with the whole torque, rad/s. Slower ones are braked
/// in proportion.
const BRAKED: f64 = 0.3;

/// How to move the sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Excitation {
    /// Time of the motion, s.
    pub seconds: f64,
    /// Speed of the sphere about each axis, root mean square, rad/s.
    pub wander: f64,
    /// Largest speed of the sphere, rad/s. If it is faster, the motors are switched off.
    pub fastest: f64,
}

/// The reason why an excitation ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ended {
    /// Its time is over.
    Done,
    /// The sphere, or a joint, turned faster than allowed.
    TooFast,
    /// The wheels slip: their rates contradict each other by this speed, m/s.
    Slips(f64),
    /// The zero of a steer joint is not known: nobody has calibrated it, or its encoder has not
    /// passed its index mark.
    NoZero(usize),
    /// A motor controller reported these complaints.
    Complains(Complaints),
}

impl fmt::Display for Ended {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Done => f.write_str("done"),
            Self::TooFast => f.write_str(
                "stopped: the sphere turned faster than --speed allows. Something pushes it, or a sign or a zero of the rig file is wrong",
            ),
            Self::Slips(speed) => write!(
                f,
                "stopped: the wheels contradict each other by {:.0} mm/s: one slips or lifts, or the rig file's geometry is wrong",
                1e3 * speed
            ),
            Self::NoZero(joint) => write!(
                f,
                "the zero of joint {} is not known: run `hbot rig calibrate` and enter its `zero`; with \"index\" turn the sphere until its \
                 encoder has passed the mark",
                joint + 1
            ),
            Self::Complains(_) => f.write_str("stopped: a motor controller complains (`hbot rig scan`)"),
        }
    }
}

/// One exchange of an excitation.
#[derive(Debug, Clone, Copy)]
pub struct Exchange {
    /// Time of the command, s.
    pub time_s: f64,
    /// The reading that answers the command.
    pub reading: JointReadings,
    /// Commanded joint torques, N m, in the sense of the joints.
    pub torque: [f64; MAX_JOINTS],
    /// Orientation of the sphere relative to that when the bench was opened.
    pub orientation: Quat,
}

/// Brakes a joint whose sign has just been found good, until it rests or a motor controller
/// complains, for a second at most. `most` is the largest torque, N m. The motors are switched off
/// at the end, even after an error.
///
/// # Errors
/// Fails if the controllers no longer answer, or if a stop was requested.
pub fn brake(bench: &mut Bench, joint: usize, most: f64) -> Result<(), Interrupted> {
    let result = brake_on(bench, joint, most.abs());
    bench.switch_off().and(result)
}

fn brake_on(bench: &mut Bench, joint: usize, most: f64) -> Result<(), Interrupted> {
    let mut rate = bench.exchange(None)?.rates[joint];
    for _ in 0..(BRAKE_S / bench.period_s()) as u32 {
        if !(rate.abs() > 1.0e-3) {
            break;
        }
        let mut torque = [0.0; MAX_JOINTS];
        torque[joint] = -most * (rate / BRAKED).clamp(-1.0, 1.0);
        let reading = bench.exchange(Some(&torque))?;
        if reading.complaints != Complaints::default() {
            break;
        }
        rate = reading.rates[joint];
    }
    Ok(())
}

/// Moves the sphere as `how` says, and calls `each` for every exchange. The motors are switched off
/// at the end, even after an error.
///
/// # Errors
/// Fails if the controllers no longer answer, or if a stop was requested.
pub fn excite(
    bench: &mut Bench,
    how: &Excitation,
    each: &mut dyn FnMut(&Exchange),
) -> Result<Ended, Interrupted> {
    let result = Excite::new(bench).run(bench, how, each);
    bench.switch_off()?;
    result
}

/// A running excitation.
struct Excite {
    joints: usize,
    arms: Vec<ContactArms>,
    /// Largest torque of each joint, N m, and 0 for joints without a motor.
    limits: JointLimits,
    /// Torques of the last command in the sense of the joints, N m.
    torque: [f64; MAX_JOINTS],
    /// Integral part of the controller, N m.
    integral: Vec3,
}

impl Excite {
    fn new(bench: &Bench) -> Self {
        let rig = bench.rig();
        let motor = |j: usize| {
            let joint = &rig.joints[j];
            if joint.peak > 0.0 { MOST * joint.continuous.min(joint.peak) } else { 0.0 }
        };
        let wheels = rig.device.wheels();
        Self {
            joints: rig.device.joints(),
            arms: wheels.iter().map(|wheel| ContactArms::of(wheel, rig.device.sphere_radius())).collect(),
            limits: JointLimits::of_device(&rig.device, motor),
            torque: [0.0; MAX_JOINTS],
            integral: Vec3::ZERO,
        }
    }

    fn run(
        mut self,
        bench: &mut Bench,
        how: &Excitation,
        each: &mut dyn FnMut(&Exchange),
    ) -> Result<Ended, Interrupted> {
        let rig = *bench.rig();
        let mut reading = bench.exchange(None)?;
        let unknown = |j: &usize| match rig.joints[*j].zero {
            Zero::Calibrate => true,
            Zero::Index => reading.index_seen & (1 << j) == 0,
            Zero::Assume | Zero::Absolute => false,
        };
        if let Some(joint) = (0..self.joints).step_by(2).find(unknown) {
            return Ok(Ended::NoZero(joint));
        }
        let begun_s = bench.time_s();
        loop {
            let time_s = bench.time_s() - begun_s;
            if time_s >= how.seconds {
                return Ok(Ended::Done);
            }
            let fade = (time_s / FADE_S).min((how.seconds - time_s) / FADE_S).clamp(0.0, 1.0);
            if let Some(ended) = self.command(bench, &reading, how, time_s, fade) {
                return Ok(ended);
            }
            let mut sent = self.torque;
            for (j, torque) in sent.iter_mut().enumerate().take(self.joints) {
                if rig.joints[j].reversed {
                    *torque = -*torque;
                }
            }
            reading = bench.exchange(Some(&sent))?;
            if reading.complaints != Complaints::default() {
                return Ok(Ended::Complains(reading.complaints));
            }
            each(&Exchange {
                time_s: bench.sent_s() - begun_s,
                reading,
                torque: self.torque,
                orientation: bench.orientation(),
            });
        }
    }

    /// Computes the next torques. Returns why the excitation must end, if it must.
    fn command(
        &mut self,
        bench: &Bench,
        reading: &JointReadings,
        how: &Excitation,
        time_s: f64,
        fade: f64,
    ) -> Option<Ended> {
        let (rig, period_s) = (bench.rig(), bench.period_s());
        let n = self.joints;
        let mut rates = [0.0; MAX_JOINTS];
        let mut steer = [0.0; MAX_WHEELS];
        for j in 0..n {
            let joint = &rig.joints[j];
            rates[j] = if joint.reversed { -reading.rates[j] } else { reading.rates[j] };
            if j % 2 == 0 {
                steer[j / 2] = f64::from(reading.counts[j]) * joint.radians_per_count();
            }
        }
        let posture = Posture::new(&rig.device, &steer[..n / 2]);
        let motion = posture.forward(&rig.device, &rates[..n]);
        // A rate that is not a number counts as too fast.
        if !(motion.omega.length() <= how.fastest) {
            return Some(Ended::TooFast);
        }
        let slip = motion.slip[..n / 2].iter().map(|[u, v]| u.hypot(*v)).fold(0.0, f64::max);
        if !(slip <= rig.limits.slip) {
            return Some(Ended::Slips(slip));
        }
        let wanted = wander(time_s) * (how.wander * fade);
        let off = wanted - motion.omega;
        let inertia = rig.device.sphere_inertia();
        let most = TORQUE * rig.limits.torque;
        self.integral += off * (inertia / (FOLLOW_S * INTEGRAL_S) * period_s);
        self.integral = self.integral.clamp_length_max(0.5 * most) * if fade < 1.0 { fade } else { 1.0 };
        let torque = (off * (inertia / FOLLOW_S) + self.integral).clamp_length_max(most);
        let mut joints = allocate(posture.rows(), &self.limits, torque).torque;
        self.add_null_space(&posture, time_s, fade, &mut joints);
        if let Some(grip) = rig.limits.traction {
            let load = traction(&self.arms, &joints[..n], GRIP * grip.mu * grip.normal_force);
            if load > 1.0 {
                joints.iter_mut().for_each(|torque| *torque /= load);
            }
        }
        for (j, wanted) in joints.iter().enumerate().take(n) {
            let most = self.limits.peak[j];
            let step = most * period_s / RISE_S;
            let next = self.torque[j] + (wanted - self.torque[j]).clamp(-step, step);
            self.torque[j] = next.clamp(-most, most);
        }
        None
    }

    /// Adds torques that make no torque on the sphere, as far as the limits of the motors allow.
    fn add_null_space(&self, posture: &Posture, time_s: f64, fade: f64, joints: &mut [f64; MAX_JOINTS]) {
        let (n, rows) = (self.joints, posture.rows());
        // Scaled by the limits, so that all motors take part, and less what they make together.
        let mut sum = Mat3::ZERO;
        let mut made = Vec3::ZERO;
        let mut free = [0.0; MAX_JOINTS];
        for j in 0..n {
            let most = self.limits.peak[j];
            let pace = TAU * (0.11 + 0.07 * j as f64);
            free[j] = AGAINST * most * fade * (pace * time_s + 2.4 * j as f64).sin();
            made += rows[j] * free[j];
            let row = rows[j] * most;
            sum += Mat3::from_cols(row * row.x, row * row.y, row * row.z);
        }
        if !(sum.determinant().abs() > 0.0) {
            return;
        }
        let back = sum.inverse() * made;
        let mut room: f64 = 1.0;
        for j in 0..n {
            let most = self.limits.peak[j];
            free[j] -= most * most * rows[j].dot(back);
            let left = (most - joints[j].abs()).max(0.0);
            if free[j].abs() > left {
                room = room.min(left / free[j].abs());
            }
        }
        (0..n).for_each(|j| joints[j] += room * free[j]);
    }
}

/// Returns a direction and size that wander: sums of sines about n1, n2 and n3 with the root mean
/// square 1 about each.
fn wander(time_s: f64) -> Vec3 {
    let about = |axis: usize| {
        let sines = (0..SINES).map(|k| {
            // Paces that are not multiples of each other: parts of the golden ratio.
            let part = ((3 * k + axis) as f64 * 0.618_033_988_75 + 0.1).fract();
            let pace = TAU * (WANDER_HZ[0] + (WANDER_HZ[1] - WANDER_HZ[0]) * part);
            (pace * time_s + 1.7 * (3 * k + axis) as f64).sin()
        });
        (2.0 / SINES as f64).sqrt() * sines.sum::<f64>()
    };
    Vec3::new(about(0), about(1), about(2))
}
