//! Tests one joint with a small torque: whether it moves, in which direction its counts change, and
//! whether the counts agree with the rate that its controller reports.

use std::fmt;

use hbot_core::MAX_JOINTS;
use hbot_core::inputs::{Complaints, JointReadings};

use super::{Bench, Interrupted};

/// Time in which the test torque rises from zero to its full value, s.
const RISE_S: f64 = 0.1;
/// Usual longest time for which the full test torque is held, s.
pub const HOLD_S: f64 = 0.5;
/// Turn of the joint after which the test ends, rad.
const FAR: f64 = 0.3;
/// Time in which the torque of [`ramp`] rises from zero to its largest value, s. It rises with the
/// square of the time, so a light joint is not pushed by much more than it needs.
const RAMP_S: f64 = 4.0;
/// Turn of the joint after which [`ramp`] ends, rad.
const RAMP_FAR: f64 = 0.05;
/// Longest time for which a test waits for a joint to come to rest, s.
const REST_S: f64 = 2.0;
/// Time without motion after which a joint that has turned rests, s.
const SETTLED_S: f64 = 0.1;
/// Time in which the counts must stand before a [`ramp`], s, and the largest turn that counts as
/// standing, rad. A joint that creeps on so slowly does not reach [`RAMP_FAR`] without a torque.
const UNMOVED_S: f64 = 0.5;
const UNMOVED: f64 = 0.005;
/// Smallest turn of a joint that counts as motion, rad.
const STILL: f64 = 0.02;
/// Largest change of the counts of an encoder whose joint does not move.
const JITTER: u32 = 4;
/// Smallest relative difference between the turn by encoder counts and the turn by reported rates
/// that counts as a contradiction.
pub const DISAGREEMENT: f64 = 0.1;

/// The result of testing one joint with a small torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Number of the joint, from 0, in the order steer, drive of each wheel.
    pub joint: usize,
    /// Largest commanded torque, with the sign of the joint's controller, N m.
    pub torque: f64,
    /// Turn of the joint according to its encoder counts, with the controller's sign, rad.
    pub moved: f64,
    /// Turn of the joint according to the rates that its controller reported, rad.
    pub by_rate: f64,
    /// Largest speed of the joint during the test, rad/s.
    pub fastest: f64,
    /// The diagnosis of the joint.
    pub verdict: Verdict,
}

/// The diagnosis of a joint after a test with a small torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// The encoder counts rise under a positive torque and agree with the reported rates.
    Good,
    /// The joint already turned before the torque was applied, so it was not tested.
    Turns,
    /// According to the encoder counts, neither this joint nor any other has moved.
    Stands,
    /// The encoder counts of this joint did not change, but those of another joint did, which has
    /// this number.
    Another(usize),
    /// The encoder counts did not change, although the controller reports a rate of the joint.
    CountsStand,
    /// The encoder counts fall under a positive torque, so a closed loop would run away.
    Reversed,
    /// Encoder counts and reported rates disagree. The value is the turn by counts divided by the
    /// turn by rates: the gear ratio in the rig file is too small by this factor.
    Gear(f64),
    /// The test was stopped because the joint with this number turned faster than allowed.
    TooFast(usize),
    /// A motor controller reported these complaints, which ended the test.
    Complains(Complaints),
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Good => f.write_str("good"),
            Self::Turns => f.write_str("it turned before there was any torque: let it come to rest"),
            Self::Stands => f.write_str(
                "its counts hardly moved. Where the wheel did, its encoder is dead: check the encoder's cable, and do not raise \
                 --torque, since nothing watches how fast it turns. Where it did not: raise --torque, free the wheel, or check the motor's \
                 leads",
            ),
            Self::Another(joint) => write!(
                f,
                "its counts did not move, those of joint {} did: the motors or the encoders of the two are exchanged, or its own encoder \
                 is dead and the sphere has taken the other along (take it out)",
                joint + 1
            ),
            Self::CountsStand => f.write_str(
                "its counts did not move, though its controller reports a rate: check the encoder's cable and the controller's settings",
            ),
            Self::Reversed => f.write_str(
                "its counts fall under a positive torque, which in a closed loop runs away: exchange two leads of the motor, or A and \
                 B of the encoder",
            ),
            Self::Gear(ratio) if !ratio.is_finite() => {
                f.write_str("its counts move, but its controller reports no rate: correct its settings or its firmware")
            }
            Self::Gear(ratio) => write!(
                f,
                "its counts say {ratio:.3} times what its rates say: gear in the rig file is too small by that factor, its controller \
                 reports another rate than that of the joint after the gear, or `controller` is another joint's"
            ),
            Self::TooFast(joint) => write!(
                f,
                "stopped: joint {} turned faster than --speed allows. Lower --torque; a wheel that is free is quick",
                joint + 1
            ),
            Self::Complains(complaints) => {
                let all = [
                    (complaints.fault, "it reports a fault or has restarted: read its display or log"),
                    (complaints.watchdog, "nothing heard within its watchdog time: this machine was busy, or the line is bad"),
                    (complaints.overcurrent, "too much current: lower --torque, or check the motor's leads"),
                    (complaints.overtemperature, "too hot: let it cool down"),
                    (complaints.disobeyed, "its motor is on or off against the command: check supply, settings and errors"),
                    (complaints.not_finite, "it says a number that is none: check and calibrate its encoder and sensors"),
                ];
                let told: Vec<&str> = all.iter().filter(|(is, _)| *is).map(|(_, what)| *what).collect();
                write!(f, "a controller complains: {}", told.join("; "))
            }
        }
    }
}

/// Tests one joint with a torque that rises to `torque`, N m, with its controller's sign, and is
/// held for `hold_s`. The test ends then, or when the joint has turned a little, or when any joint
/// turns faster than `speed`, rad/s. The motors are switched off at the end, even after an error.
///
/// # Errors
/// Fails if the controllers no longer answer, or if a stop was requested.
pub fn test(
    bench: &mut Bench,
    joint: usize,
    torque: f64,
    hold_s: f64,
    speed: f64,
) -> Result<Outcome, Interrupted> {
    push_and_stop(bench, joint, &Push::Fixed { torque, hold_s }, speed)
}

/// Tests one joint with a torque that rises slowly from zero to `most`, N m, with its controller's
/// sign. The test ends as soon as the joint has turned by 0.05 rad, or when any joint turns faster
/// than `speed`, rad/s. [`Outcome::torque`] is the torque that was reached: what moves the joint.
/// The motors are switched off at the end, even after an error.
///
/// # Errors
/// Fails if the controllers no longer answer, or if a stop was requested.
pub fn ramp(bench: &mut Bench, joint: usize, most: f64, speed: f64) -> Result<Outcome, Interrupted> {
    push_and_stop(bench, joint, &Push::Ramp(most), speed)
}

/// How the torque of a test rises, N m.
enum Push {
    /// To this torque, which is then held for a time, s.
    Fixed { torque: f64, hold_s: f64 },
    /// Slowly to this torque at most.
    Ramp(f64),
}

impl Push {
    /// Returns the torque `time` seconds after the start.
    fn torque(&self, time: f64) -> f64 {
        match self {
            Self::Fixed { torque, .. } => torque * (time / RISE_S).min(1.0),
            Self::Ramp(most) => most * (time / RAMP_S).min(1.0).powi(2),
        }
    }

    /// Returns how long the test lasts at most, s, and the turn after which it ends, rad.
    fn ends(&self) -> (f64, f64) {
        match self {
            Self::Fixed { hold_s, .. } => (RISE_S + hold_s, FAR),
            Self::Ramp(_) => (RAMP_S, RAMP_FAR),
        }
    }
}

fn push_and_stop(bench: &mut Bench, joint: usize, way: &Push, speed: f64) -> Result<Outcome, Interrupted> {
    let result = push(bench, joint, way, speed);
    bench.switch_off()?;
    result
}

fn push(bench: &mut Bench, joint: usize, way: &Push, speed: f64) -> Result<Outcome, Interrupted> {
    let (Push::Fixed { torque, .. } | Push::Ramp(torque)) = *way;
    let (lasts, far) = way.ends();
    let came = bench.time_s();
    let mut before = bench.exchange(None)?;
    // A joint that turns this fast would move noticeably during the test without any torque, so it
    // cannot be judged. A rate that is not a number is treated the same way.
    let rests = |reading: &JointReadings| reading.rates[joint].abs() <= STILL / HOLD_S;
    // When it was last seen turning. A rate that passes through zero is no rest. A ramp lasts long:
    // rates are too noisy to show that a joint rests, so it looks at the counts first.
    let ramps = matches!(way, Push::Ramp(_));
    let settled_s = if ramps { UNMOVED_S } else { SETTLED_S };
    let mut turned = if rests(&before) && !ramps { f64::NEG_INFINITY } else { came };
    let mut stood = before;
    while bench.time_s() - turned < settled_s && bench.time_s() - came < REST_S {
        before = bench.exchange(None)?;
        let crept = bench.turned(joint, before.counts[joint].wrapping_sub(stood.counts[joint]));
        if !rests(&before) || (ramps && crept.abs() > UNMOVED) {
            (turned, stood) = (bench.time_s(), before);
        }
    }
    let joints = bench.rig().device.joints();
    let moved = |bench: &Bench, reading: &JointReadings, j: usize| {
        bench.turned(j, reading.counts[j].wrapping_sub(before.counts[j]))
    };
    let mut outcome =
        Outcome { joint, torque, moved: 0.0, by_rate: 0.0, fastest: 0.0, verdict: Verdict::Stands };
    if bench.time_s() - turned < settled_s {
        return Ok(Outcome { torque: 0.0, verdict: Verdict::Turns, ..outcome });
    }
    // On a real line an exchange lasts longer than a period, so the times are those of the clock.
    let begun = bench.sent_s();
    let (mut last_rate, mut last, mut time, mut too_fast) = (0.0, before, 0.0, None);
    let mut sum = 0.0;
    while time < lasts {
        let mut asked = [0.0; MAX_JOINTS];
        asked[joint] = way.torque(time);
        if ramps {
            outcome.torque = asked[joint];
        }
        let reading = bench.exchange(Some(&asked))?;
        let passed = bench.sent_s() - begun - time;
        time += passed;
        let rate = reading.rates[joint];
        last = reading;
        outcome.moved = moved(bench, &reading, joint);
        sum += 0.5 * (rate + last_rate) * passed;
        // Rates that are late have not yet told of the last part of the turn.
        outcome.by_rate = sum + bench.rate_lag * rate;
        outcome.fastest = outcome.fastest.max(rate.abs());
        last_rate = rate;
        if reading.complaints != Complaints::default() {
            outcome.verdict = Verdict::Complains(reading.complaints);
            return Ok(outcome);
        }
        // Depending on the wiring, the motor can turn any joint. A rate that is not a number counts
        // as too fast.
        too_fast = (0..joints).find(|j| !(reading.rates[*j].abs() <= speed));
        if too_fast.is_some() {
            break;
        }
        if outcome.moved.abs() > far || outcome.by_rate.abs() > far {
            break;
        }
    }
    let along = outcome.moved * torque.signum();
    outcome.verdict = if along <= -STILL {
        // Reported even if the joint was too fast, because this is the reason why it would run
        // away.
        Verdict::Reversed
    } else if let Some(joint) = too_fast {
        Verdict::TooFast(joint)
    } else if along < STILL {
        let far = |j: &usize| moved(bench, &last, *j).abs();
        let furthest = (0..joints).filter(|j| *j != joint).max_by(|a, b| far(a).total_cmp(&far(b)));
        let counted = last.counts[joint].wrapping_sub(before.counts[joint]).unsigned_abs();
        match furthest.filter(|j| far(j) >= STILL) {
            // An encoder that is dead jitters by a count. One that counts is alive, and a gear that
            // is far too large in the rig file makes little of its counts.
            _ if outcome.by_rate.abs() >= STILL && counted > JITTER => {
                Verdict::Gear(outcome.moved / outcome.by_rate)
            }
            _ if outcome.by_rate.abs() >= STILL => Verdict::CountsStand,
            Some(other) => Verdict::Another(other),
            None => Verdict::Stands,
        }
    } else if !((outcome.by_rate / outcome.moved - 1.0).abs() < DISAGREEMENT) {
        Verdict::Gear(outcome.moved / outcome.by_rate)
    } else {
        Verdict::Good
    };
    Ok(outcome)
}
