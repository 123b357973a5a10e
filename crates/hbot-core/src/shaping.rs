//! Shapes the torque between the scene and the motors: blending, a client's stream, limits of size
//! and slew.

use crate::real::{Real, Vec3, exp, sqrt};

/// Duration over which the torque blends from one scene to the next, s.
pub(crate) const BLEND_S: Real = 0.05;
/// Duration of the ramp in which a client's torque falls to zero after it has expired, s.
pub(crate) const STREAM_RAMP_S: Real = 0.02;

/// Prevents a step in torque when the scene changes. It adds a torque that is opposite to the step,
/// and lets this torque fade to zero.
///
/// The step is the difference of the two scenes' torques at the motion of the last tick. So the
/// motion since the last tick acts at once, without blending. The steps of several changes add up,
/// and their sum always fades. So a spring still acts if a client sets one of its parameters in
/// every tick.
///
/// The torques must already be within the rig's torque limit. Without this rule, the blend to a
/// scene that asks for a hundred times the limit would reach the limit at once.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Blend {
    /// Torque that is added to the torque of the scene, N m. `speed` is its rate of change, N m/s.
    offset: Vec3,
    speed: Vec3,
    /// Time since the last change of scene, s. It stops at the end of the blend.
    age_s: Real,
    /// Torque that the scene asked for in the last tick, N m, without the torque that the blend
    /// adds.
    last: Vec3,
}

/// Rate at which the added torque of a blend fades, 1/s. The fade is critically damped: it has no
/// corner, and its steepest slope is 74 % of the step in 10 ms. After [`BLEND_S`] only 0.05 % of
/// the step is left, which is then removed.
const BLEND_RATE: Real = 10.0 / BLEND_S;

impl Blend {
    pub(crate) const DONE: Self =
        Self { offset: Vec3::ZERO, speed: Vec3::ZERO, age_s: BLEND_S, last: Vec3::ZERO };

    /// Advances the fade by `dt` seconds. Returns the torque that must be added to the scene's
    /// `torque` in this tick, N m.
    ///
    /// `before` is given only if the scene has changed since the last tick. It is the torque of the
    /// new scene at the motion of the last tick, N m.
    #[inline]
    pub(crate) fn advance(&mut self, torque: Vec3, before: Option<Vec3>, dt: Real) -> Vec3 {
        if self.age_s < BLEND_S {
            self.age_s += dt;
            let step = (self.speed + self.offset * BLEND_RATE) * dt;
            let decay = exp(-BLEND_RATE * dt);
            self.offset = (self.offset + step) * decay;
            self.speed = (self.speed - step * BLEND_RATE) * decay;
            if self.age_s >= BLEND_S {
                *self = Self { last: self.last, ..Self::DONE };
            }
        }
        if let Some(before) = before {
            self.offset += self.last - before;
            self.age_s = 0.0;
        }
        self.last = torque;
        self.offset
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

/// Returns the vector `v`, shortened to the length `limit` if it is longer.
#[inline]
pub(crate) fn limited(v: Vec3, limit: Real) -> Vec3 {
    shortened(v, limit).0
}

/// Returns the vector `v`, shortened to the length `limit` if it is longer. Also returns the ratio
/// of the new length to the old one, 0 to 1.
#[inline]
pub(crate) fn shortened(v: Vec3, limit: Real) -> (Vec3, Real) {
    let length2 = v.length_squared();
    if !(length2 > limit * limit) {
        (v, 1.0)
    } else if length2 < Real::INFINITY {
        let share = limit / sqrt(length2);
        (v * share, share)
    } else {
        // Too long to square. A vector that is not finite stays not finite.
        let size = v.abs().max_element();
        let unit = v / size;
        let share = limit / sqrt(unit.length_squared());
        (unit * share, share / size)
    }
}

/// Returns the point that is reached from `from` by a step of at most `step` straight towards `to`.
/// It is `to` itself if it is near enough.
#[inline]
pub(crate) fn slewed(from: Vec3, to: Vec3, step: Real) -> Vec3 {
    from + limited(to - from, step)
}
