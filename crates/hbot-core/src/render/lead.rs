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
use crate::real::Real;
use crate::render::effects::Motion;
use crate::rotation;

/// Largest angle by which the orientation is turned on, rad.
const LARGEST: Real = 0.2;

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
    #[inline(never)]
    pub(crate) fn of(&mut self, measured: Motion, age: u32) -> Motion {
        let age = age.min(self.oldest) as Real;
        let time = (self.least + self.each * age).min(self.longest);
        let speed2 = measured.omega.length_squared();
        let most = LARGEST / time;
        let time = if speed2 > most * most { LARGEST / crate::real::sqrt(speed2) } else { time };
        self.time = time;
        self.ahead = (time - age * self.period).max(0.0);
        // The product of two unit quaternions. It is used in this tick only, so no error grows.
        let q = rotation::exp(measured.omega * time) * measured.q;
        Motion { q, omega: measured.omega }
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
