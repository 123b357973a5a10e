//! What shapes a torque between the scene and the motors: blending, a client's stream, size and slew limits.

use crate::real::{Real, Vec3, sqrt};

/// How long one scene takes to become another, s.
pub(crate) const BLEND_S: Real = 0.05;
/// How long a stream that is not renewed takes to end, s.
pub(crate) const STREAM_RAMP_S: Real = 0.02;

/// Makes a change of scene continuous: the step that it would make in torque is held against it and fades to zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Blend {
    offset: Vec3,
    /// 1 at the change, 0 when over.
    left: Real,
    last: Vec3,
}

impl Blend {
    pub(crate) const DONE: Self = Self { offset: Vec3::ZERO, left: 0.0, last: Vec3::ZERO };

    /// The torque of the scene made continuous. `changed`: the scene is not that of the last tick.
    #[inline]
    pub(crate) fn apply(&mut self, torque: Vec3, changed: bool, dt: Real) -> Vec3 {
        if changed {
            self.offset = self.last - torque;
            self.left = 1.0;
        } else if self.left > 0.0 {
            self.left = (self.left - dt * (1.0 / BLEND_S)).max(0.0);
        }
        // Smoothstep: no corner in torque at either end.
        let fade = self.left * self.left * (3.0 - 2.0 * self.left);
        self.last = torque + self.offset * fade;
        self.last
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

    #[inline]
    pub(crate) fn torque(&mut self, tick: u64, dt: Real) -> Vec3 {
        if self.level == 0.0 {
            return Vec3::ZERO;
        }
        if tick > self.until {
            self.level = (self.level - dt * (1.0 / STREAM_RAMP_S)).max(0.0);
        }
        self.torque * self.level
    }
}

/// `v` shortened to `limit` where it is longer.
#[inline]
pub(crate) fn limited(v: Vec3, limit: Real) -> Vec3 {
    let length2 = v.length_squared();
    if !(length2 > limit * limit) {
        v
    } else if length2 < Real::INFINITY {
        v * (limit / sqrt(length2))
    } else {
        // Too long to square. What is not finite stays so.
        let unit = v / v.abs().max_element();
        unit * (limit / sqrt(unit.length_squared()))
    }
}

/// `to`, or as far from `from` towards it as `step` reaches.
#[inline]
pub(crate) fn slewed(from: Vec3, to: Vec3, step: Real) -> Vec3 {
    from + limited(to - from, step)
}
