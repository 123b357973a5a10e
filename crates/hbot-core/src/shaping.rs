//! What shapes a torque between the scene and the motors: blending, a client's stream, size and slew limits.

use crate::real::{Real, Vec3, exp, sqrt};

/// How long one scene takes to become another, s.
pub(crate) const BLEND_S: Real = 0.05;
/// How long a stream that is not renewed takes to end, s.
pub(crate) const STREAM_RAMP_S: Real = 0.02;

/// Makes a change of scene continuous. The step in torque that the change makes is added with the
/// opposite sign and fades to zero.
///
/// The step is the change's alone: both scenes are evaluated at the motion of the last tick, so the
/// motion since then is rendered at once. Steps that follow each other add up, and the sum always
/// fades: a client that sets a parameter in every tick gets a spring that acts.
///
/// The torques that come in are within the rig's limit already. If the step of an unlimited torque
/// were faded, a scene that asks for a hundred times the limit would reach the limit at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Blend {
    /// The torque that is added to the scene's, N m, and its rate, N m/s.
    offset: Vec3,
    speed: Vec3,
    /// Time since the last change, s.
    age_s: Real,
    /// The torque of the last tick without the offset, N m.
    last: Vec3,
}

/// The fade is a critically damped one at this rate, 1/s: no corner in torque, the steepest slope
/// 74 % of the step in 10 ms, and 0.05 % left after [`BLEND_S`], which is then taken away.
const BLEND_RATE: Real = 10.0 / BLEND_S;

impl Blend {
    pub(crate) const DONE: Self =
        Self { offset: Vec3::ZERO, speed: Vec3::ZERO, age_s: BLEND_S, last: Vec3::ZERO };

    /// Moves the fade on by `dt` seconds. Returns the torque to add to `torque` in this tick, N m. `before` is given if the
    /// scene is not the last tick's: what it gives at the motion of the last tick, N m.
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
    /// 1 while valid, then down to 0.
    level: Real,
    /// Last tick at which it is valid.
    until: u64,
}

impl Stream {
    pub(crate) const NONE: Self = Self { torque: Vec3::ZERO, level: 0.0, until: 0 };

    pub(crate) fn set(&mut self, torque: Vec3, until: u64) {
        *self = Self { torque, level: 1.0, until };
    }

    /// Ends it: its ramp begins now.
    pub(crate) fn end(&mut self, tick: u64) {
        self.until = self.until.min(tick);
    }

    /// Moves the ramp on by `dt` seconds once the stream has expired.
    #[inline]
    pub(crate) fn advance(&mut self, tick: u64, dt: Real) {
        if tick > self.until && self.level > 0.0 {
            self.level = (self.level - dt * (1.0 / STREAM_RAMP_S)).max(0.0);
        }
    }

    /// The torque `scene` with the stream added, within `limit` (N m), and the share of the sum
    /// that the limit left, 0 to 1.
    ///
    /// The ramp of an expired stream leads from the limited sum to the limited scene. Ramping the
    /// stream before the limit would keep a stream of a thousand times the limit at full torque
    /// until the last tick of its ramp.
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

/// `v` shortened to `limit` where it is longer.
#[inline]
pub(crate) fn limited(v: Vec3, limit: Real) -> Vec3 {
    shortened(v, limit).0
}

/// `v` shortened to `limit` where it is longer, and what is left of it, 0 to 1.
#[inline]
pub(crate) fn shortened(v: Vec3, limit: Real) -> (Vec3, Real) {
    let length2 = v.length_squared();
    if !(length2 > limit * limit) {
        (v, 1.0)
    } else if length2 < Real::INFINITY {
        let share = limit / sqrt(length2);
        (v * share, share)
    } else {
        // Too long to square. What is not finite stays so.
        let size = v.abs().max_element();
        let unit = v / size;
        let share = limit / sqrt(unit.length_squared());
        (unit * share, share / size)
    }
}

/// `to`, or as far from `from` towards it as `step` reaches.
#[inline]
pub(crate) fn slewed(from: Vec3, to: Vec3, step: Real) -> Vec3 {
    from + limited(to - from, step)
}
