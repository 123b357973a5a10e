//! Shapes the torque between the scene and the motors: blending, a client's stream, limits of size
//! and slew.

use crate::real::{Real, Vec3, exp, sqrt};

/// Duration of the blend from one scene to another, s.
pub(crate) const BLEND_S: Real = 0.05;
/// Duration of the ramp that ends an expired stream, s.
pub(crate) const STREAM_RAMP_S: Real = 0.02;

/// Makes a change of scene continuous. The step in torque that the change causes is added with the
/// opposite sign and fades to zero.
///
/// The step includes only the change of scene. Both scenes are evaluated at the motion of the last
/// tick, so the motion since then is rendered at once. Consecutive steps add up, and their sum
/// always fades. So a client that sets a parameter in every tick still gets a spring that acts.
///
/// The input torques are already within the rig's limit. If the step of an unlimited torque faded
/// instead, a scene that asks for a hundred times the limit would reach the limit at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Blend {
    /// Torque that is added to the scene's, N m, and its rate, N m/s.
    offset: Vec3,
    speed: Vec3,
    /// Time since the last change of scene, s.
    age_s: Real,
    /// Torque of the last tick without the offset, N m.
    last: Vec3,
}

/// Rate of the critically damped fade of a blend, 1/s. The fade has no corner, and its steepest
/// slope is 74 % of the step in 10 ms. After [`BLEND_S`], 0.05 % of the step is left, which is then
/// removed.
const BLEND_RATE: Real = 10.0 / BLEND_S;

impl Blend {
    pub(crate) const DONE: Self =
        Self { offset: Vec3::ZERO, speed: Vec3::ZERO, age_s: BLEND_S, last: Vec3::ZERO };

    /// Advances the fade by `dt` seconds and returns the torque to add to `torque` in this tick, N
    /// m.
    ///
    /// If the scene differs from that of the last tick, `before` is the torque of the new scene at
    /// the motion of the last tick, N m.
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

/// A torque that a client streams.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stream {
    torque: Vec3,
    /// Factor on the torque: 1 while valid, then falling to 0.
    level: Real,
    /// Last tick for which the stream is valid.
    until: u64,
}

impl Stream {
    pub(crate) const NONE: Self = Self { torque: Vec3::ZERO, level: 0.0, until: 0 };

    pub(crate) fn set(&mut self, torque: Vec3, until: u64) {
        *self = Self { torque, level: 1.0, until };
    }

    /// Ends the stream: its ramp to zero begins after `tick`.
    pub(crate) fn end(&mut self, tick: u64) {
        self.until = self.until.min(tick);
    }

    /// Advances the ramp by `dt` seconds if the stream has expired.
    #[inline]
    pub(crate) fn advance(&mut self, tick: u64, dt: Real) {
        if tick > self.until && self.level > 0.0 {
            self.level = (self.level - dt * (1.0 / STREAM_RAMP_S)).max(0.0);
        }
    }

    /// Returns the torque `scene` plus the stream, limited to `limit` (N m), and the fraction of
    /// the sum that the limit left, 0 to 1.
    ///
    /// The ramp of an expired stream leads from the limited sum to the limited scene. If the ramp
    /// were applied before the limit, a stream of a thousand times the limit would stay at full
    /// torque until the last tick of its ramp.
    #[inline]
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

/// Returns `v`, shortened to the length `limit` if it is longer.
#[inline]
pub(crate) fn limited(v: Vec3, limit: Real) -> Vec3 {
    shortened(v, limit).0
}

/// Returns `v`, shortened to the length `limit` if it is longer, and the fraction that is left of
/// it, 0 to 1.
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

/// Returns the point on the line from `from` to `to` that is at most `step` away from `from`. This
/// is `to` itself if it is within reach.
#[inline]
pub(crate) fn slewed(from: Vec3, to: Vec3, step: Real) -> Vec3 {
    from + limited(to - from, step)
}
