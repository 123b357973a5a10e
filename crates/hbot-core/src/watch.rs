//! Judges the motion by the counts, apart from the rates that controllers report.
//!
//! Overspeed and slip in a single tick are judged by the rates, because the difference of two counts is
//! too coarse for that. A controller that reports wrong rates would then turn the sphere unseen. So the
//! counts are summed over blocks of 25 ms, which is long enough that a count is little of the sum, and
//! give the mean rate of the sphere and the mean slip of each wheel. Over two blocks each joint's counts
//! must agree with its rates.

use crate::device::{MAX_JOINTS, MAX_WHEELS};
use crate::kinematics::{Posture, wheel_velocity};
use crate::mode::Cause;
use crate::outputs::Slip;
use crate::real::{PI, Real, Vec3, fabs, floor, sqrt};
use crate::rig::Rig;

/// The length of a block, s.
const BLOCK_S: Real = 0.025;
/// A joint that moves this many times faster than it does at the limit of speed has not moved so: its
/// count is wrong.
const IMPOSSIBLE: Real = 4.0;
/// By how much counts and rates of a joint may disagree over two blocks, as a share of the larger of
/// the two ways. A rate that is filtered lags behind by some milliseconds; one half is the most that a
/// lag of 8 ms makes of a motion to and fro at 20 Hz.
const DISAGREEMENT: Real = 0.5;
/// And rad/s besides, of a joint at rest.
const DISAGREEMENT_RATE: Real = 0.1;
/// Counts that rounding may add to or take from the way over a block.
const GRAIN: Real = 2.0;
/// Of an interval of more ticks than this, or a reading that came later, slip and agreement are not
/// judged: nobody knows how the wheels stood in between.
const COARSE: u32 = 5;
/// Room for what the counts' rounding makes of a speed at the limit.
const MARGIN: Real = 1.05;

/// What the joints did between two readings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Interval<'a> {
    /// By how much each joint turned, rad.
    pub(crate) delta: &'a [Real; MAX_JOINTS],
    /// The rate of each joint at the end, rad/s.
    pub(crate) rate: &'a [Real; MAX_JOINTS],
    /// The turn of the sphere in N, rad.
    pub(crate) turn: Vec3,
    /// How long it took, ticks.
    pub(crate) ticks: u32,
    /// How much later than in the next tick the reading came, ticks. It was taken at some time between.
    pub(crate) late: u32,
}

/// One joint's way over a block, rad: by its counts and by its rates, each with its length.
#[derive(Debug, Clone, Copy, Default)]
struct Way {
    counted: Real,
    counted_length: Real,
    rated: Real,
    rated_length: Real,
}

/// Sums since the block's begin, and what the last blocks showed.
#[derive(Debug, Clone)]
pub(crate) struct Watch {
    /// Ticks of a block.
    block: u32,
    period_s: Real,
    /// The turn of each joint in a tick at [`IMPOSSIBLE`] times the limit of speed, rad.
    most: [Real; MAX_JOINTS],
    /// The turn of each joint for [`GRAIN`] counts, rad.
    grain: [Real; MAX_JOINTS],
    /// What [`GRAIN`] counts of both its joints are at the contact of the most sensitive wheel, m.
    grain_slip: Real,
    ticks: u32,
    /// The latest reading of the block and of the one before: by this much their times are uncertain.
    late: u32,
    last_late: u32,
    reading_late: u32,
    /// The wheels may have steered far between two readings of the block, so its slip is not known.
    coarse: bool,
    ways: [Way; MAX_JOINTS],
    last_ways: Option<[Way; MAX_JOINTS]>,
    last_ticks: u32,
    last_rate: [Real; MAX_JOINTS],
    turn: Vec3,
    slip: Slip,
    verdict: Option<Cause>,
}

impl Watch {
    pub(crate) fn new(rig: &Rig) -> Self {
        let period_s = rig.timing.period_s();
        let radius = rig.device.sphere_radius();
        let (mut most, mut grain) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        let mut grain_slip: Real = 0.0;
        for (i, wheel) in rig.device.wheels().iter().enumerate() {
            // The rows of G have the same length at every posture.
            let toe = wheel.axis_c1 / wheel.axis_c2;
            let rows = [1.0 / fabs(wheel.axis_c2), radius / wheel.spec().radius * sqrt(toe * toe + 1.0)];
            for (k, row) in rows.into_iter().enumerate() {
                let joint = &rig.joints[2 * i + k];
                grain[2 * i + k] = GRAIN * fabs(joint.radians_per_count());
                most[2 * i + k] = IMPOSSIBLE * rig.limits.speed * row * period_s;
            }
            let [u, v] = wheel_velocity(&rig.device, wheel, grain[2 * i], grain[2 * i + 1]);
            grain_slip = grain_slip.max(fabs(u) + fabs(v));
        }
        Self {
            block: floor(BLOCK_S / period_s + 0.999).max(1.0) as u32,
            period_s,
            most,
            grain,
            grain_slip,
            ticks: 0,
            late: 0,
            last_late: 0,
            reading_late: 0,
            coarse: false,
            ways: [Way::default(); MAX_JOINTS],
            last_ways: None,
            last_ticks: 0,
            last_rate: [0.0; MAX_JOINTS],
            turn: Vec3::ZERO,
            slip: [[0.0; 2]; MAX_WHEELS],
            verdict: None,
        }
    }

    /// The largest turn, rad, by which `joint` can have moved in `ticks`; never more than half a turn,
    /// beyond which the way that it went is lost.
    #[inline]
    pub(crate) fn most(&self, joint: usize, ticks: u32) -> Real {
        (self.most[joint] * ticks as Real + self.grain[joint]).min(PI)
    }

    /// The fault that the counts showed last, if any.
    #[inline]
    pub(crate) fn verdict(&self) -> Option<Cause> {
        self.verdict
    }

    /// Forgets everything: nobody is to judge what was.
    pub(crate) fn restart(&mut self) {
        self.begin_block();
        self.last_ways = None;
        self.last_late = 0;
        self.verdict = None;
    }

    fn begin_block(&mut self) {
        self.ticks = 0;
        self.late = 0;
        self.coarse = false;
        self.ways = [Way::default(); MAX_JOINTS];
        self.turn = Vec3::ZERO;
        self.slip = [[0.0; 2]; MAX_WHEELS];
    }

    /// Takes the posture at the begin of an interval in which the sphere makes `turn` (rad, N).
    #[inline]
    pub(crate) fn begin(&mut self, rig: &Rig, posture: &Posture, turn: Vec3) {
        // The contact frames of begin and end, half each: exact to second order in the interval.
        let half = 0.5 * rig.device.sphere_radius();
        for (slip, frame) in self.slip.iter_mut().zip(posture.frames()) {
            slip[0] -= half * frame.c2.dot(turn);
            slip[1] += half * frame.c1.dot(turn);
        }
    }

    /// Takes the rest of the interval, with the posture at its end.
    #[inline]
    pub(crate) fn end(&mut self, rig: &Rig, posture: &Posture, moved: &Interval<'_>) {
        self.begin(rig, posture, moved.turn);
        let time = moved.ticks as Real * self.period_s;
        for (i, wheel) in rig.device.wheels().iter().enumerate() {
            let [u, v] = wheel_velocity(&rig.device, wheel, moved.delta[2 * i], moved.delta[2 * i + 1]);
            self.slip[i][0] += u;
            self.slip[i][1] += v;
        }
        for j in 0..rig.device.joints() {
            // The mean of the rates at both ends: after a gap the last one alone tells little.
            let counted = moved.delta[j];
            let rated = 0.5 * (self.last_rate[j] + moved.rate[j]) * time;
            self.last_rate[j] = moved.rate[j];
            let way = &mut self.ways[j];
            way.counted += counted;
            way.counted_length += fabs(counted);
            way.rated += rated;
            way.rated_length += fabs(rated);
        }
        self.turn += moved.turn;
        self.ticks = self.ticks.saturating_add(moved.ticks);
        // The times of both its ends are uncertain.
        self.late = self.late.max(moved.late).max(self.reading_late);
        self.reading_late = moved.late;
        self.coarse |= moved.ticks.max(self.late) > COARSE;
        if self.ticks >= self.block {
            self.verdict = self.judge(rig);
            self.last_ways = (!self.coarse).then_some(self.ways);
            self.last_ticks = self.ticks;
            self.last_late = self.late;
            self.begin_block();
        }
    }

    /// The fault that the block shows which ends now, the gravest first.
    #[inline(never)]
    fn judge(&self, rig: &Rig) -> Option<Cause> {
        // What was read late may have moved for longer.
        let late = self.late.max(self.last_late);
        let time = (self.ticks + late) as Real * self.period_s;
        let limits = &rig.limits;
        if sqrt(self.turn.length_squared()) > MARGIN * limits.speed * time {
            return Some(Cause::Overspeed);
        }
        let mut slip: Real = 0.0;
        for [u, v] in &self.slip[..rig.device.wheels().len()] {
            slip = slip.max(u * u + v * v);
        }
        if !self.coarse && sqrt(slip) > MARGIN * limits.slip * time + self.grain_slip {
            return Some(Cause::Slip);
        }
        // Neither is what the rates were between, or when the counts were read.
        let before = self.last_ways.as_ref().filter(|_| !self.coarse)?;
        let ticks = (self.ticks + self.last_ticks).max(1);
        let time = ticks as Real * self.period_s;
        let share = DISAGREEMENT + late as Real / ticks as Real;
        let disagrees = |j: usize| {
            let (now, before) = (&self.ways[j], &before[j]);
            let apart = fabs(now.counted + before.counted - now.rated - before.rated);
            let length =
                (now.counted_length + before.counted_length).max(now.rated_length + before.rated_length);
            apart > share * length + DISAGREEMENT_RATE * time + self.grain[j]
        };
        (0..rig.device.joints()).any(disagrees).then_some(Cause::ImplausibleFeedback)
    }
}
