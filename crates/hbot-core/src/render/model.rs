//! A local model: what a client sends instead of a torque. It says how the torque changes as the
//! sphere turns, so a client that is slower than the loop can feel stiff.
//!
//! Let q0 be the pose of the model, p = log(q q0⁻¹) the turn of the sphere from it (rotation vector
//! in frame N) and w the rate of the sphere. Each half-space i has a unit normal n_i and begins at
//! the turn o_i about it. The torque is
//!
//! ```text
//! T = T0 - Mᵀ f - D w - sum_i n_i max(0, k_i x_i + d_i n_i.w)      x_i = n_i.p - o_i > 0
//! f = K p + sum_i k_i x_i n_i
//! ```
//!
//! (the last sum stands for its damping only: its elastic part is in f). M is the Jacobian of the
//! logarithm. It makes the elastic torque the gradient of an energy, so that no closed path gives
//! out energy, and differs from the identity only by terms that are perpendicular to p or of second
//! order. For a K that is equal about all axes Mᵀ K p is K p. A half-space never pulls.
//!
//! A new model takes the place of the old one at once. The difference of their torques is added
//! with the opposite sign and falls to zero over the time of the blend, so that nothing jumps.

use crate::linear::limited;
use crate::real::{Mat3, Quat, Real, Vec3, fabs};
use crate::render::effects::Motion;
use crate::render::impedance::{geodesic_pull, is_impedance};
use crate::rotation::{angle_over_sine, shortest, vector_part};
use crate::safety::shaping::STREAM_RAMP_S;

/// Largest number of half-spaces of a model.
pub const MAX_PLANES: usize = 8;

/// Longest blend from one model to the next if the client does not choose it, s.
const LONGEST_BLEND_S: Real = 0.05;

/// A half-space of turns that pushes the sphere back: a contact, as the sphere feels it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct HalfSpace {
    /// Unit vector in frame N about which a turn leads into the half-space.
    pub normal: Vec3,
    /// Turn from the model's pose about the normal at which the half-space begins, rad. If it is
    /// negative, the pose is inside.
    pub offset: Real,
    /// Stiffness, N m/rad.
    pub stiffness: Real,
    /// Damping inside of the half-space, N m s/rad. It acts in both directions, as far as the
    /// half-space does not pull.
    pub damping: Real,
}

impl HalfSpace {
    const NONE: Self = Self { normal: Vec3::ZERO, offset: 0.0, stiffness: 0.0, damping: 0.0 };

    fn is_legal(&self) -> bool {
        let numbers = [self.offset, self.stiffness, self.damping];
        fabs(self.normal.length_squared() - 1.0) < 1.0e-3
            && numbers.iter().all(|x| x.is_finite())
            && self.stiffness >= 0.0
            && self.damping >= 0.0
    }
}

/// How the torque depends on the motion of the sphere near a pose (see the [module](self)).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct LocalModel {
    /// Torque at the pose, if the sphere rests there outside of all half-spaces, N m.
    pub torque: Vec3,
    /// Stiffness about the pose in frame N, N m/rad: symmetric, no eigenvalue below 0.
    pub stiffness: Mat3,
    /// Damping in frame N, N m s/rad: symmetric, no eigenvalue below 0.
    pub damping: Mat3,
    /// Orientation about which the stiffness acts: it maps sphere axes to frame N. `None` is the
    /// orientation in the tick from whose state the client computed the model, or the present one
    /// if the client does not name a tick.
    pub pose: Option<Quat>,
    planes: [HalfSpace; MAX_PLANES],
    #[cfg_attr(feature = "exact", serde(deserialize_with = "crate::exact::count::<_, 0, MAX_PLANES>"))]
    len: usize,
}

impl LocalModel {
    /// No torque, no stiffness, no damping and no half-spaces.
    pub const NONE: Self = Self {
        torque: Vec3::ZERO,
        stiffness: Mat3::ZERO,
        damping: Mat3::ZERO,
        pose: None,
        planes: [HalfSpace::NONE; MAX_PLANES],
        len: 0,
    };

    /// Creates a model without half-spaces. Whether its numbers are legal is checked when it is
    /// taken (see [`is_legal`](Self::is_legal)).
    #[must_use]
    pub const fn new(torque: Vec3, stiffness: Mat3, damping: Mat3, pose: Option<Quat>) -> Self {
        Self { torque, stiffness, damping, pose, ..Self::NONE }
    }

    /// Returns the model with the pose `pose`, if it has none.
    pub(crate) fn at_pose(&self, pose: Option<Quat>) -> Self {
        Self { pose: self.pose.or(pose), ..*self }
    }

    /// Returns the half-spaces.
    #[must_use]
    pub fn planes(&self) -> &[HalfSpace] {
        &self.planes[..self.len]
    }

    /// Adds a half-space.
    ///
    /// # Errors
    /// Returns the half-space if the model has [`MAX_PLANES`] already.
    pub fn add_plane(&mut self, plane: HalfSpace) -> Result<(), HalfSpace> {
        let Some(place) = self.planes.get_mut(self.len) else { return Err(plane) };
        *place = plane;
        self.len += 1;
        Ok(())
    }

    /// Multiplies all stiffnesses, those of the half-spaces too, by `factor`.
    pub fn soften(&mut self, factor: Real) {
        self.stiffness *= factor;
        self.planes[..self.len].iter_mut().for_each(|plane| plane.stiffness *= factor);
    }

    /// Returns true if the model can be rendered: all numbers are finite, stiffness and damping are
    /// symmetric without an eigenvalue below 0, and pose and normals have unit length.
    #[must_use]
    pub fn is_legal(&self) -> bool {
        self.torque.is_finite()
            && is_impedance(&self.stiffness)
            && is_impedance(&self.damping)
            && self.pose.is_none_or(|q| fabs(q.length_squared() - 1.0) < 1.0e-3)
            && self.planes().iter().all(HalfSpace::is_legal)
    }

    /// Returns the torque on the sphere in frame N, N m: the whole of it, and its part that depends
    /// on the motion.
    fn at(&self, motion: Motion) -> (Vec3, Vec3) {
        let x = shortest(motion.q * self.pose.unwrap_or(motion.q).conjugate());
        let e = vector_part(x);
        let factor = angle_over_sine(x.w, e);
        let p = e * factor;
        let mut pull = self.stiffness * p;
        let mut damping = self.damping * motion.omega;
        for plane in self.planes() {
            let depth = plane.normal.dot(p) - plane.offset;
            if depth > 0.0 {
                let push = plane.stiffness * depth;
                // Out of the wall the damping takes at most what the wall pushes.
                let damped = (plane.damping * plane.normal.dot(motion.omega)).max(-push);
                pull += plane.normal * push;
                damping += plane.normal * damped;
            }
        }
        let own = geodesic_pull(x.w, factor, p, pull) - damping;
        (self.torque + own, own)
    }
}

/// The model of a client that is in force, if any.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Modelled {
    model: LocalModel,
    /// Factor on the torque. It is 1 while the model is valid, and then ramps down to 0.
    level: Real,
    /// Number of the last tick in which the model is valid.
    until: u64,
    /// Number of the tick in which the model came.
    since: u64,
    /// Torque that the blend adds, N m, and the time after which it is 0, s.
    offset: Vec3,
    left_s: Real,
    /// Torque in the last tick, N m.
    last: Vec3,
}

impl Modelled {
    pub(crate) const NONE: Self = Self {
        model: LocalModel::NONE,
        level: 0.0,
        until: 0,
        since: 0,
        offset: Vec3::ZERO,
        left_s: 0.0,
        last: Vec3::ZERO,
    };

    /// Returns true if no model is in force.
    #[inline]
    pub(crate) fn is_over(&self) -> bool {
        self.level == 0.0
    }

    /// Replaces the model from tick `tick` on. It is valid until tick `until`. The torque of the
    /// last tick, at the motion `motion`, blends into that of the new model in `blend_s` seconds.
    /// If that is `None`, it takes the time since the last model came, at most 50 ms, and 20 ms if
    /// no model is in force. `limit` is the rig's torque limit, N m.
    pub(crate) fn set(
        &mut self,
        model: LocalModel,
        (tick, until): (u64, u64),
        blend_s: Option<Real>,
        period: Real,
        motion: Motion,
        limit: Real,
    ) {
        let spacing = (tick.saturating_sub(self.since).max(1) as Real * period).min(LONGEST_BLEND_S);
        let usual = if self.is_over() { STREAM_RAMP_S } else { spacing };
        let left_s = blend_s.unwrap_or(usual);
        // What the limit cuts off is not felt, so it must not blend.
        let step = limited(self.last, limit) - limited(model.at(motion).0, limit);
        let offset = if left_s > 0.0 { step } else { Vec3::ZERO };
        *self = Self { model, level: 1.0, until, since: tick, offset, left_s, last: self.last };
    }

    /// Ends the validity of the model at `tick`. After this tick it ramps down to zero.
    pub(crate) fn end(&mut self, tick: u64) {
        self.until = self.until.min(tick);
    }

    /// Advances the ramp-down by `dt` seconds if the model is no longer valid in tick `tick`.
    #[inline(never)]
    pub(crate) fn advance(&mut self, tick: u64, dt: Real) {
        if tick > self.until {
            self.level = (self.level - dt * (1.0 / STREAM_RAMP_S)).max(0.0);
        }
        if self.is_over() {
            *self = Self::NONE;
        }
    }

    /// Ends the blend, because the motors make no torque.
    pub(crate) fn rest(&mut self) {
        (self.offset, self.left_s, self.last) = (Vec3::ZERO, 0.0, Vec3::ZERO);
    }

    /// Returns the torque of the model in this tick, N m, and its part that depends on the motion.
    /// Advances the blend by `dt` seconds. `limit` is the rig's torque limit, N m.
    #[inline(never)]
    pub(crate) fn render(&mut self, motion: Motion, dt: Real, limit: Real) -> (Vec3, Vec3) {
        let (mut torque, mut own) = self.model.at(motion);
        if self.level < 1.0 {
            // As that of a stream: a torque beyond the limit ramps from the limit.
            torque = limited(torque, limit);
            own *= self.level;
        }
        // The tick in which the model came is the first of the blend. Otherwise models that come in
        // every tick would hand the difference on for ever.
        if self.left_s > dt {
            self.offset *= 1.0 - dt / self.left_s;
            self.left_s -= dt;
        } else {
            (self.offset, self.left_s) = (Vec3::ZERO, 0.0);
        }
        self.last = (torque + self.offset) * self.level;
        (self.last, own)
    }

    /// Returns the torque in the last tick, N m.
    pub(crate) fn last(&self) -> Vec3 {
        self.last
    }

    /// Returns the part of the torque that the model would make without delay if the sphere were at
    /// rest in the orientation `q`, N m, as far as it depends on the motion.
    pub(crate) fn elastic_at(&self, q: Quat) -> Vec3 {
        self.model.at(Motion { q, omega: Vec3::ZERO }).1 * self.level
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotation;

    fn skewed() -> LocalModel {
        let stiffness =
            Mat3::from_cols(Vec3::new(5.0, 1.0, 0.5), Vec3::new(1.0, 2.0, -0.25), Vec3::new(0.5, -0.25, 1.0));
        let pose = rotation::exp(Vec3::new(0.2, -0.4, 0.1));
        let mut model = LocalModel::new(Vec3::ZERO, stiffness, Mat3::ZERO, Some(pose));
        let plane = HalfSpace { normal: Vec3::Y, offset: -0.1, stiffness: 7.0, damping: 0.0 };
        assert_eq!(model.add_plane(plane), Ok(()));
        model
    }

    /// The energy 1/2 p.K p + 1/2 k x² of [`skewed`], J.
    fn energy(model: &LocalModel, q: Quat) -> Real {
        let p = rotation::difference(q, model.pose.unwrap_or(q));
        let wall = model.planes().iter().map(|plane| {
            let depth = (plane.normal.dot(p) - plane.offset).max(0.0);
            0.5 * plane.stiffness * depth * depth
        });
        0.5 * p.dot(model.stiffness * p) + wall.sum::<Real>()
    }

    #[test]
    fn the_elastic_torque_is_the_gradient_of_an_energy() {
        let model = skewed();
        for turn in [Vec3::new(0.3, 0.2, -0.5), Vec3::new(-0.8, 0.9, 0.1), Vec3::new(0.01, 0.0, 1.2)] {
            let q = rotation::exp(turn);
            let (torque, _) = model.at(Motion { q, omega: Vec3::ZERO });
            for axis in Vec3::AXES {
                let step = if size_of::<Real>() == 4 { 1.0e-2 } else { 1.0e-4 };
                let at = |way: Real| energy(&model, rotation::exp(axis * (way * step)) * q);
                let slope = (at(1.0) - at(-1.0)) / (2.0 * step);
                // Central differences are off by the square of the step times a third derivative,
                // and by the rounding of the energy over the step.
                let bound = if size_of::<Real>() == 4 { 5.0e-3 } else { 1.0e-6 };
                assert!(fabs(torque.dot(axis) + slope) < bound, "{turn}: {torque} {slope}");
            }
        }
    }

    #[test]
    fn all_bits_zero_is_no_model() {
        assert!(Modelled::NONE.is_over());
        let none = Modelled::NONE;
        assert_eq!((none.until, none.since, none.level, none.left_s), (0, 0, 0.0, 0.0));
        assert_eq!(none.model.pose, None);
    }
}
