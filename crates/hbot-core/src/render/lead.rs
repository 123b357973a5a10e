//! The lead: the scene is rendered at the pose that the sphere will have when the torque acts.
//!
//! A reading is `a` ticks old when it becomes a torque, the motors hold the torque for one period
//! h, and it follows the command with a lag. So the middle of the torque comes a h + h/2 + lag
//! after the reading. The lead turns the measured orientation q on by the measured rate w:
//!
//! ```text
//! t = min(c (a h + h/2 + lag), longest)        |t w| <= LARGEST
//! q_p = exp(t w) q
//! ```
//!
//! A spring then makes -K (x + t w): the delay takes away the damping K t, the lead gives it back.

use crate::design::rig::Rig;
use crate::real::{Quat, Real, Vec3, sqrt};
use crate::render::effects::Motion;
use crate::rotation;

/// Largest angle by which the orientation is turned on, rad.
const LARGEST: Real = 0.2;

/// Largest half of a turn for which a short series is exact to 2e-14, rad.
const SERIES: Real = 1.0 / 64.0;

/// Computes the pose at which the scene is rendered.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Lead {
    /// Lead for each tick of age, c h, and lead of a reading without age, c (h/2 + lag), s.
    each: Real,
    least: Real,
    /// Longest lead, s.
    longest: Real,
    /// Loop period h, s.
    period: Real,
    /// Largest age of a reading that is bridged, ticks.
    oldest: u32,
    /// Lead of this tick, s.
    time: Real,
    /// Time from the tick to the moment of the pose, s. References are led by it.
    ahead: Real,
}

impl Lead {
    /// Returns the lead of `rig`, or `None` if its scenes are rendered at the measured pose.
    pub(crate) fn new(rig: &Rig) -> Option<Self> {
        let lead = rig.lead?;
        let period = rig.timing.period_s();
        Some(Self {
            each: lead.factor * period,
            least: lead.factor * (0.5 * period + rig.torque_lag),
            longest: lead.longest,
            period,
            oldest: rig.timing.timeout_ticks,
            time: 0.0,
            ahead: 0.0,
        })
    }

    /// Returns the motion `measured`, turned on to the moment at which the torque of this tick
    /// acts. `age` is the number of ticks since the joints were measured.
    #[inline(always)]
    pub(crate) fn of(&mut self, measured: Motion, age: u32) -> Motion {
        let age = age.min(self.oldest) as Real;
        let time = self.least + self.each * age;
        let time = if time > self.longest { self.longest } else { time };
        let half = measured.omega * (0.5 * time);
        let x = half.length_squared();
        let (time, turn) = if x <= SERIES * SERIES {
            // Cosine of half the turn, and its sine over the angle. At 1/64 rad the next terms are
            // 2e-14 and 3e-15.
            let c = 1.0 - x * (0.5 - x * (1.0 / 24.0));
            let s = 1.0 - x * (1.0 / 6.0 - x * (1.0 / 120.0));
            (time, rotation::from_parts(c, half * s))
        } else {
            far(measured.omega, time)
        };
        self.time = time;
        let ahead = time - age * self.period;
        self.ahead = if ahead > 0.0 { ahead } else { 0.0 };
        // The product of two unit quaternions. It is used in this tick only, so no error grows.
        Motion { q: turn * measured.q, omega: measured.omega }
    }

    /// Lead of this tick, s.
    pub(crate) fn time(&self) -> Real {
        self.time
    }

    /// Time from this tick to the moment of the pose, s.
    pub(crate) fn ahead(&self) -> Real {
        self.ahead
    }

    pub(crate) fn rest(&mut self) {
        (self.time, self.ahead) = (0.0, 0.0);
    }
}

/// Returns the lead and the turn for a rate `omega` (rad/s) at which `time` (s) gives a turn beyond
/// the series. The turn is at most [`LARGEST`].
#[cold]
#[inline(never)]
fn far(omega: Vec3, time: Real) -> (Real, Quat) {
    let speed = sqrt(omega.length_squared());
    let time = if speed * time > LARGEST { LARGEST / speed } else { time };
    (time, rotation::exp(omega * time))
}
