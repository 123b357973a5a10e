//! Checks the motion by encoder counts, independently of the rates that motor controllers report.
//!
//! Overspeed and slip in a single tick are computed from the rates, because the difference of two
//! counts is too coarse. A motor controller that reports wrong rates could then turn the sphere too
//! fast without being noticed. So the counts are also summed over blocks of 25 ms. A block is so
//! long that one count is a small part of the sum. It gives the mean rate of the sphere and the
//! mean slip of each wheel. Over two blocks the counts of each joint must also agree with its
//! rates.

use crate::count::Count;
use crate::device::{MAX_JOINTS, MAX_WHEELS};
use crate::joints::largest_slip;
use crate::kinematics::{Posture, wheel_velocity};
use crate::mode::Cause;
use crate::outputs::Slip;
use crate::real::{PI, Real, Vec3, fabs, floor, sqrt};
use crate::rig::Rig;

/// Duration of a block, the time over which encoder counts are summed before they are checked, s.
const BLOCK_S: Real = 0.025;
/// Factor on the speed limit above which the motion of a joint is impossible. An encoder count that
/// shows a faster motion must be wrong.
const IMPOSSIBLE: Real = 4.0;
/// Largest permitted difference between a joint's motion by its encoder counts and by its rates,
/// over two blocks of readings. It is a fraction of the longer of the two motions. A filtered rate
/// lags by some milliseconds, and a lag of 8 ms in an oscillation of 20 Hz causes a difference of
/// one half.
const DISAGREEMENT: Real = 0.5;
/// Difference between encoder counts and rates that is permitted in addition to [`DISAGREEMENT`],
/// rad/s. It matters for a joint at rest.
const DISAGREEMENT_RATE: Real = 0.1;
/// Number of encoder counts by which rounding can change the measured motion of a joint over a
/// block of readings.
const GRAIN: Real = 2.0;
/// Longest interval between readings, and longest delay of a reading, in ticks, for which slip and
/// rates are still checked. Over a longer time the wheels can steer far, and their positions in
/// between are unknown.
const COARSE: u32 = 5;
/// Factor by which the limits of speed and slip are widened when a block is checked, to allow for
/// the rounding of the encoder counts.
const MARGIN: Real = 1.05;

/// The motion of the joints and of the sphere between two readings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Interval<'a> {
    /// Change of each joint's angle, rad.
    pub(crate) delta: &'a [Real; MAX_JOINTS],
    /// Rate of each joint at the end of the interval, rad/s.
    pub(crate) rate: &'a [Real; MAX_JOINTS],
    /// Turn of the sphere, as a rotation vector in frame N, in rad.
    pub(crate) turn: Vec3,
    /// Duration of the interval, in ticks.
    pub(crate) ticks: u32,
    /// Number of ticks by which the reading came later than possible. It was taken at an unknown
    /// moment within this time.
    pub(crate) late: u32,
}

/// The motion of one joint over a block of readings, once by its encoder counts and once by its
/// rates. Each consists of the net change and the length of the path, rad.
#[derive(Debug, Clone, Copy, Default)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
struct Way {
    counted: Real,
    counted_length: Real,
    rated: Real,
    rated_length: Real,
}

/// Checks the motion of the joints by encoder counts, in blocks of several readings. It holds the
/// sums since the start of the present block, and the results of earlier blocks.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Watch {
    /// Duration of a block of readings, in ticks.
    block: u32,
    period_s: Real,
    /// Angle that each joint turns in one tick at [`IMPOSSIBLE`] times the speed limit, rad.
    most: [Real; MAX_JOINTS],
    /// Angle that each joint turns in [`GRAIN`] encoder counts, rad.
    grain: [Real; MAX_JOINTS],
    /// Distance that the contact moves in [`GRAIN`] encoder counts of both joints, for the wheel
    /// for which it is largest, m.
    grain_slip: Real,
    ticks: u32,
    /// Largest delay of a reading in the present block, ticks. The times at which the block begins
    /// and ends are uncertain by this much. `last_late` is the largest delay in the block before.
    late: u32,
    last_late: u32,
    reading_late: u32,
    /// True if the wheels may have steered far between two readings of the present block. The slip
    /// in this block is then not checked.
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

    /// Returns the largest angle that `joint` can have turned in `ticks` ticks, rad. It is at most
    /// half a turn, because the direction of a larger motion would be ambiguous.
    #[inline]
    pub(crate) fn most(&self, joint: usize, ticks: u32) -> Real {
        (self.most[joint] * ticks as Real + self.grain[joint]).min(PI)
    }

    /// Returns the fault that the encoder counts of the last complete block of readings showed, if
    /// any.
    #[inline]
    pub(crate) fn verdict(&self) -> Option<Cause> {
        self.verdict
    }

    /// Clears all sums and results, so that earlier motion is no longer checked. `rate` holds the
    /// joint rates of the reading at which the next interval begins, rad/s.
    pub(crate) fn restart(&mut self, rate: &[Real; MAX_JOINTS]) {
        self.begin_block();
        self.last_rate = *rate;
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

    /// Starts an interval between two readings, with the posture at its start. `turn` is how far
    /// the sphere turns in the interval (rotation vector in frame N, rad).
    #[inline]
    pub(crate) fn begin<C: Count>(&mut self, count: C, rig: &Rig, posture: &Posture, turn: Vec3) {
        // The contact frames at the start and at the end count half each. This is exact to second
        // order in the interval.
        let half = 0.5 * rig.device.sphere_radius();
        for (slip, frame) in self.slip.iter_mut().zip(posture.first_frames(count)) {
            slip[0] -= half * frame.c2.dot(turn);
            slip[1] += half * frame.c1.dot(turn);
        }
    }

    /// Ends an interval between two readings: adds its motion to the sums of the block, with the
    /// posture at its end. Checks the block if it is complete.
    #[inline]
    pub(crate) fn end<C: Count>(&mut self, count: C, rig: &Rig, posture: &Posture, moved: &Interval<'_>) {
        self.begin(count, rig, posture, moved.turn);
        let time = moved.ticks as Real * self.period_s;
        for (i, wheel) in rig.device.first(count).iter().enumerate() {
            let [u, v] = wheel_velocity(&rig.device, wheel, moved.delta[2 * i], moved.delta[2 * i + 1]);
            self.slip[i][0] += u;
            self.slip[i][1] += v;
        }
        for j in 0..count.joints() {
            // The mean of the rates at both ends. After a gap the last rate alone is not enough.
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
        // The times of both ends of the interval are uncertain.
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

    /// Returns the most serious fault that the completed block of readings shows, if any.
    #[inline(never)]
    fn judge(&self, rig: &Rig) -> Option<Cause> {
        // A late reading may cover a longer motion.
        let late = self.late.max(self.last_late);
        let time = (self.ticks + late) as Real * self.period_s;
        let limits = &rig.limits;
        if sqrt(self.turn.length_squared()) > MARGIN * limits.speed * time {
            return Some(Cause::Overspeed);
        }
        let slip = largest_slip(&self.slip, rig.device.wheels().len());
        if !self.coarse && slip > MARGIN * limits.slip * time + self.grain_slip {
            return Some(Cause::Slip);
        }
        // After a gap or a delay, neither the rates in between nor the times of the counts are
        // known.
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
