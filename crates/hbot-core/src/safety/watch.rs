//! Checks the motion by encoder counts, independently of the rates that motor controllers report.
//!
//! Overspeed and slip in a single tick are computed from the rates, because the difference of two
//! counts is too coarse. A motor controller that reports wrong rates could then turn the sphere too
//! fast without being noticed. So the counts are also summed over blocks of 25 ms. A block is so
//! long that one count is a small part of the sum. It gives the mean rate of the sphere and the
//! mean slip of each wheel. Over two blocks the counts of each joint must also agree with its
//! rates.

use crate::count::Count;
use crate::design::device::{Device, MAX_JOINTS, MAX_WHEELS};
use crate::design::kinematics::{Posture, wheel_velocity};
use crate::design::rig::Rig;
use crate::motion::joints::largest_slip;
use crate::real::{PI, Real, Vec3, fabs, floor, sqrt};
use crate::safety::mode::Cause;

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
    /// Rate of each joint at the end of the interval, as its motor controller reports it, rad/s.
    pub(crate) rate: &'a [Real; MAX_JOINTS],
    /// Turn of the sphere, as a rotation vector in frame N, in rad.
    pub(crate) turn: Vec3,
    /// Duration of the interval, in ticks.
    pub(crate) ticks: u32,
    /// Number of ticks by which the reading came later than possible. It was taken at an unknown
    /// moment within this time.
    pub(crate) late: u32,
}

/// The motion of all joints over a block of readings, once by their encoder counts and once by
/// their rates. Each consists of the net change and the length of the path.
///
/// Each sum is an array over the joints, because the processor then adds two joints at a time.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
struct Ways {
    /// Motion by the encoder counts, rad.
    counted: [Real; MAX_JOINTS],
    counted_length: [Real; MAX_JOINTS],
    /// Motion by the rates: the sum of the rates at the start and at the end of each interval,
    /// times its ticks, rad/s. It becomes an angle by the factor of half a period.
    rated: [Real; MAX_JOINTS],
    rated_length: [Real; MAX_JOINTS],
}

impl Ways {
    const NONE: Self = Self {
        counted: [0.0; MAX_JOINTS],
        counted_length: [0.0; MAX_JOINTS],
        rated: [0.0; MAX_JOINTS],
        rated_length: [0.0; MAX_JOINTS],
    };
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
    ways: Ways,
    last_ways: Option<Ways>,
    last_ticks: u32,
    last_rate: [Real; MAX_JOINTS],
    turn: Vec3,
    /// Twice the angle that each joint would have turned if its wheel had rolled without slip, rad.
    /// `last_turn` is the turn of the sphere in the last interval of the block, of which one half
    /// is not in this sum yet.
    rolled: [Real; MAX_JOINTS],
    last_turn: Vec3,
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
            ways: Ways::NONE,
            last_ways: None,
            last_ticks: 0,
            last_rate: [0.0; MAX_JOINTS],
            turn: Vec3::ZERO,
            rolled: [0.0; MAX_JOINTS],
            last_turn: Vec3::ZERO,
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
        self.ways = Ways::NONE;
        self.turn = Vec3::ZERO;
        self.rolled = [0.0; MAX_JOINTS];
        self.last_turn = Vec3::ZERO;
    }

    /// Starts an interval between two readings, with the posture at its start. `turn` is how far
    /// the sphere turns in the interval (rotation vector in frame N, rad).
    ///
    /// Without slip a joint turns by the product of its row of G with the turn. The rows at the
    /// start and at the end of an interval count half each, which is exact to second order in the
    /// interval. The posture at the end of an interval is the one at the start of the next, so one
    /// product with the sum of both turns does for both halves.
    #[inline]
    pub(crate) fn begin<C: Count>(&mut self, count: C, posture: &Posture, turn: Vec3) {
        let turns = self.last_turn + turn;
        for (rolled, row) in self.rolled.iter_mut().zip(posture.first_rows(count)) {
            *rolled += row.dot(turns);
        }
    }

    /// Ends an interval between two readings: adds its motion to the sums of the block, with the
    /// posture at its end. Checks the block if it is complete.
    #[inline]
    pub(crate) fn end<C: Count>(&mut self, count: C, rig: &Rig, posture: &Posture, moved: &Interval<'_>) {
        let ticks = moved.ticks as Real;
        for j in 0..count.joints() {
            // The mean of the rates at both ends. After a gap the last rate alone is not enough.
            let counted = moved.delta[j];
            let rated = (self.last_rate[j] + moved.rate[j]) * ticks;
            self.last_rate[j] = moved.rate[j];
            self.ways.counted[j] += counted;
            self.ways.counted_length[j] += fabs(counted);
            self.ways.rated[j] += rated;
            self.ways.rated_length[j] += fabs(rated);
        }
        self.turn += moved.turn;
        self.last_turn = moved.turn;
        self.ticks = self.ticks.saturating_add(moved.ticks);
        // The times of both ends of the interval are uncertain.
        self.late = self.late.max(moved.late).max(self.reading_late);
        self.reading_late = moved.late;
        self.coarse |= moved.ticks.max(self.late) > COARSE;
        if self.ticks >= self.block {
            self.end_block(rig, posture);
        }
    }

    /// Checks the completed block, with the posture at its end, and begins the next one. It is a
    /// separate function, because most ticks do not complete a block.
    #[inline(never)]
    fn end_block(&mut self, rig: &Rig, posture: &Posture) {
        self.begin(rig.device.count(), posture, Vec3::ZERO);
        self.verdict = self.judge(rig);
        self.last_ways = (!self.coarse).then_some(self.ways);
        self.last_ticks = self.ticks;
        self.last_late = self.late;
        self.begin_block();
    }

    /// Returns the slip of the wheel that has slipped furthest in the completed block, m.
    fn slip(&self, device: &Device) -> Real {
        let mut slip = [[0.0; 2]; MAX_WHEELS];
        for (i, wheel) in device.wheels().iter().enumerate() {
            let slid = |j: usize| self.ways.counted[j] - 0.5 * self.rolled[j];
            slip[i] = wheel_velocity(device, wheel, slid(2 * i), slid(2 * i + 1));
        }
        largest_slip(&slip, device.wheels().len())
    }

    /// Returns the most serious fault that the completed block of readings shows, if any.
    fn judge(&self, rig: &Rig) -> Option<Cause> {
        // A late reading may cover a longer motion.
        let late = self.late.max(self.last_late);
        let time = (self.ticks + late) as Real * self.period_s;
        let limits = &rig.limits;
        if sqrt(self.turn.length_squared()) > MARGIN * limits.speed * time {
            return Some(Cause::Overspeed);
        }
        if !self.coarse && self.slip(&rig.device) > MARGIN * limits.slip * time + self.grain_slip {
            return Some(Cause::Slip);
        }
        // After a gap or a delay, neither the rates in between nor the times of the counts are
        // known.
        let before = self.last_ways.as_ref().filter(|_| !self.coarse)?;
        let ticks = (self.ticks + self.last_ticks).max(1);
        let time = ticks as Real * self.period_s;
        let share = DISAGREEMENT + late as Real / ticks as Real;
        let (now, half) = (&self.ways, 0.5 * self.period_s);
        let disagrees = |j: usize| {
            let counted = now.counted[j] + before.counted[j];
            let rated = (now.rated[j] + before.rated[j]) * half;
            let length = Real::max(
                now.counted_length[j] + before.counted_length[j],
                (now.rated_length[j] + before.rated_length[j]) * half,
            );
            fabs(counted - rated) > share * length + DISAGREEMENT_RATE * time + self.grain[j]
        };
        (0..rig.device.joints()).any(disagrees).then_some(Cause::ImplausibleFeedback)
    }
}
