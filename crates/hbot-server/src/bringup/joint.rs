//! One joint under a small torque: whether it moves, which way its own counts go, and whether they and the rate that its controller
//! reports agree.

use std::fmt;

use hbot_core::MAX_JOINTS;
use hbot_core::inputs::Complaints;

use super::{Bench, Silent};
use crate::wire::Wire;

/// How long the torque rises, s.
const RISE_S: f64 = 0.1;
/// How long it is held at most, s.
const HOLD_S: f64 = 0.5;
/// It is over once the joint has turned so far, rad.
const FAR: f64 = 0.3;
/// Less than this is not moving, rad.
const STILL: f64 = 0.02;
/// Counts and rates that differ by more do not belong to each other.
const DISAGREEMENT: f64 = 0.1;

/// What one joint did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Which joint, from 0, in the order steer, drive of each wheel.
    pub joint: usize,
    /// The torque asked for, in the controller's sense, N m.
    pub torque: f64,
    /// By its counts, in the controller's sense, rad.
    pub moved: f64,
    /// By the rates that its controller reported, rad.
    pub by_rate: f64,
    /// The fastest that it was, rad/s.
    pub fastest: f64,
    /// What is to be said of it.
    pub verdict: Verdict,
}

/// What is to be said of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// It turns towards greater counts, and its rates agree with them.
    Good,
    /// It turned before there was any torque.
    Turns,
    /// It did not move.
    Stands,
    /// It turns towards smaller counts under a positive torque.
    Reversed,
    /// By its rates it turned this many times as far as by its counts.
    Gear(f64),
    /// It was stopped because it turned faster than was allowed.
    TooFast,
    /// Its controller complains.
    Complains(Complaints),
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Good => f.write_str("good"),
            Self::Turns => f.write_str("it turned before there was any torque: let it come to rest"),
            Self::Stands => f.write_str("it did not move: raise --torque, free the wheel, or check the motor's leads"),
            Self::Reversed => f.write_str(
                "its counts fall under a positive torque, which in a closed loop runs away: exchange two leads of the motor, or A and \
                 B of the encoder",
            ),
            Self::Gear(ratio) => write!(
                f,
                "its rates say {ratio:.3} times what its counts say: correct gear (by that factor) or counts_per_turn"
            ),
            Self::TooFast => f.write_str("stopped: it turned faster than --speed allows"),
            Self::Complains(complaints) => write!(f, "its controller complains: {complaints:?}"),
        }
    }
}

/// Pushes one joint with up to `torque` (N m, in its controller's sense) until it has turned a little, half a second has
/// passed, or it is faster than `speed` (rad/s). Motors are off at the end, whatever happens.
///
/// # Errors
/// The controllers fall silent.
pub fn test<W: Wire>(bench: &mut Bench<W>, joint: usize, torque: f64, speed: f64) -> Result<Outcome, Silent> {
    let result = push(bench, joint, torque, speed);
    let off = (0..3).try_for_each(|_| bench.exchange(None).map(drop));
    result.and_then(|outcome| off.map(|()| outcome))
}

fn push<W: Wire>(bench: &mut Bench<W>, joint: usize, torque: f64, speed: f64) -> Result<Outcome, Silent> {
    let period = bench.period_s();
    let before = bench.exchange(None)?;
    let start = before.counts[joint];
    let mut outcome =
        Outcome { joint, torque, moved: 0.0, by_rate: 0.0, fastest: 0.0, verdict: Verdict::Stands };
    // What would be called motion within the test without any torque says nothing of it; nor does a rate that is no number.
    if !(before.rates[joint].abs() <= STILL / HOLD_S) {
        outcome.verdict = Verdict::Turns;
        return Ok(outcome);
    }
    let mut last_rate = 0.0;
    for k in 1..=((RISE_S + HOLD_S) / period) as u32 {
        let mut asked = [0.0; MAX_JOINTS];
        asked[joint] = torque * (f64::from(k) * period / RISE_S).min(1.0);
        let reading = bench.exchange(Some(&asked))?;
        let rate = reading.rates[joint];
        outcome.moved = bench.turned(joint, reading.counts[joint].wrapping_sub(start));
        outcome.by_rate += 0.5 * (rate + last_rate) * period;
        outcome.fastest = outcome.fastest.max(rate.abs());
        last_rate = rate;
        if reading.complaints != Complaints::default() {
            outcome.verdict = Verdict::Complains(reading.complaints);
            return Ok(outcome);
        }
        // A rate that is not a number is not slow either.
        if !(rate.abs() <= speed) {
            outcome.verdict = Verdict::TooFast;
            return Ok(outcome);
        }
        if outcome.moved.abs() > FAR || outcome.by_rate.abs() > FAR {
            break;
        }
    }
    let along = outcome.moved * torque.signum();
    outcome.verdict = if along.abs() < STILL && outcome.by_rate.abs() < STILL {
        Verdict::Stands
    } else if along < 0.0 {
        Verdict::Reversed
    } else if !((outcome.by_rate / outcome.moved - 1.0).abs() < DISAGREEMENT) {
        Verdict::Gear(outcome.by_rate / outcome.moved)
    } else {
        Verdict::Good
    };
    Ok(outcome)
}
