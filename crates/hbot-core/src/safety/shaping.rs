//! Shapes the torque between the scene and the motors: blending, a client's stream, limits of size
//! and slew.

use crate::linear::{limited, shortened};
use crate::real::{Real, Vec3, sqrt};

/// Duration over which the torque blends from one scene to the next, s.
pub(crate) const BLEND_S: Real = 0.05;
/// Duration of the ramp in which a client's torque falls to zero after it has expired, s.
pub(crate) const STREAM_RAMP_S: Real = 0.02;

/// Prevents a step in torque when the scene changes. It adds a torque that is opposite to the step,
/// and lets this torque fall linearly to zero.
///
/// The step is the difference of the two scenes' torques at the motion of the last tick. So the
/// motion since the last tick acts at once, without blending. The steps of several changes add up,
/// and their sum always fades. So a spring still acts if a client sets one of its parameters in
/// every tick.
///
/// The torques must already be within the rig's torque limit L. Without this rule, the blend to a
/// scene that asks for a hundred times the limit would reach the limit at once. A step up to L
/// takes [`BLEND_S`]. A longer one, up to 2 L from one direction to the opposite, takes longer in
/// proportion. So a blend never changes the torque faster than L in [`BLEND_S`], the slope of a
/// fade of this time.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Blend {
    /// Torque that is added to the torque of the scene, N m. `speed` is its rate of change, N m/s.
    offset: Vec3,
    speed: Vec3,
    /// Clock of the blend, s. The blend ends when it reaches [`BLEND_S`]. It begins at 0, or at
    /// less if the blend takes longer.
    age_s: Real,
    /// Torque that the scene asked for in the last tick, N m, without the torque that the blend
    /// adds.
    last: Vec3,
}

impl Blend {
    pub(crate) const DONE: Self =
        Self { offset: Vec3::ZERO, speed: Vec3::ZERO, age_s: BLEND_S, last: Vec3::ZERO };

    /// Returns the torque that must be added to the scene's `torque` in this tick, N m. Call
    /// [`fade`](Self::fade) afterwards. `limit` is the rig's torque limit, N m.
    ///
    /// `before` is given only if the scene has changed since the last tick. It is the torque of the
    /// new scene at the motion of the last tick, N m.
    #[inline]
    pub(crate) fn added(&mut self, torque: Vec3, before: Option<Vec3>, limit: Real) -> Vec3 {
        if let Some(before) = before {
            self.begin(self.last - before, limit);
        }
        self.last = torque;
        self.offset
    }

    /// Adds `step` to the added torque, N m. The sum fades in the mean of the times that its two
    /// parts have left, weighted by their sizes. By the inequality of Cauchy and Schwarz, it then
    /// falls no faster than both parts would together.
    #[inline(never)]
    fn begin(&mut self, step: Vec3, limit: Real) {
        let [old, new] = [self.offset, step].map(|part| sqrt(part.length_squared()));
        let sizes = old + new;
        if sizes == 0.0 {
            return;
        }
        self.offset += step;
        let mean = (old * (BLEND_S - self.age_s) + new * BLEND_S) / sizes;
        let shortest = BLEND_S / limit * sqrt(self.offset.length_squared());
        let left = mean.max(shortest);
        self.speed = self.offset / -left;
        self.age_s = BLEND_S - left;
    }

    /// Returns the change of the added torque until the next tick, in `dt` seconds, N m.
    #[inline]
    pub(crate) fn change(&self, dt: Real) -> Vec3 {
        self.speed * dt.min(BLEND_S - self.age_s)
    }

    /// Lowers the added torque for the next tick, in `dt` seconds, by the fraction `part` of what
    /// [`change`](Self::change) returns.
    #[inline]
    pub(crate) fn fade(&mut self, dt: Real, part: Real) {
        if self.age_s < BLEND_S {
            self.offset += self.change(dt) * part;
            self.age_s += if part == 1.0 { dt } else { dt.min(BLEND_S - self.age_s) * part };
            if self.age_s >= BLEND_S {
                *self = Self { last: self.last, ..Self::DONE };
            }
        }
    }
}

/// A torque that a client streams, with the time until which it is valid.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Stream {
    torque: Vec3,
    /// Factor on the torque. It is 1 while the torque is valid, and then ramps down to 0.
    level: Real,
    /// Number of the last tick in which the torque is valid.
    until: u64,
}

impl Stream {
    pub(crate) const NONE: Self = Self { torque: Vec3::ZERO, level: 0.0, until: 0 };

    pub(crate) fn set(&mut self, torque: Vec3, until: u64) {
        *self = Self { torque, level: 1.0, until };
    }

    /// Ends the validity of the streamed torque at `tick`. After this tick it ramps down to zero.
    pub(crate) fn end(&mut self, tick: u64) {
        self.until = self.until.min(tick);
    }

    /// Returns true if no torque is streamed.
    pub(crate) fn is_over(&self) -> bool {
        self.level == 0.0
    }

    /// Returns the streamed torque with its factor, N m.
    pub(crate) fn torque(&self) -> Vec3 {
        self.torque * self.level
    }

    /// Advances the ramp-down by `dt` seconds if the streamed torque is no longer valid in tick
    /// `tick`.
    #[inline]
    pub(crate) fn advance(&mut self, tick: u64, dt: Real) {
        if tick > self.until && self.level > 0.0 {
            self.level = (self.level - dt * (1.0 / STREAM_RAMP_S)).max(0.0);
        }
    }

    /// Returns the sum of the torque `scene` and the streamed torque, limited to the size `limit`
    /// (N m). Also returns the fraction of the sum that remains after the limit, 0 to 1.
    ///
    /// After the streamed torque has expired, the result ramps from the limited sum to the limited
    /// torque of the scene. If the ramp were applied before the limit, a streamed torque of a
    /// thousand times the limit would keep the full torque until the end of its ramp.
    #[inline(always)]
    pub(crate) fn added_to(&self, scene: Vec3, limit: Real) -> (Vec3, Real) {
        if self.level == 0.0 {
            return shortened(scene, limit);
        }
        let (sum, share) = shortened(scene + self.torque, limit);
        if self.level == 1.0 {
            return (sum, share);
        }
        let without = limited(scene, limit);
        (without + (sum - without) * self.level, share)
    }
}

/// Returns the point that is reached from `from` by a step of at most `step` straight towards `to`.
/// It is `to` itself if it is near enough.
#[inline]
pub(crate) fn slewed(from: Vec3, to: Vec3, step: Real) -> Vec3 {
    from + limited(to - from, step)
}
