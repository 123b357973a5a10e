//! From the scene to joint torques: the torque wanted, limited first and ramped then, and what the
//! motors and contacts make of it without exceeding the slew limit.

use super::Controller;
use crate::allocation::{self, Allocation, Bounds};
use crate::device::MAX_JOINTS;
use crate::effects::Motion;
use crate::mode::Mode;
use crate::passivity::Moment;
use crate::real::{Real, Vec3, sqrt};
use crate::rig::AllocationMethod;
use crate::scene::CompiledScene;
use crate::shaping::{BLEND_S, Blend, limited, slewed};

/// The step in torque above which a change of a scene whose effects are out of reach of `enable`
/// begins the soft start again, as a share of the rig's largest torque. Smaller ones blend, so that
/// a slider moves the stiffness of a spring that the hand holds far from its reference.
const SOFT_STEP: Real = 0.1;

/// The torque wanted on the sphere.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wanted {
    /// In N, N m: limited, ramped and within the slew limit of the last tick's.
    pub(super) torque: Vec3,
    /// The share of what scene and stream ask for that the limit of torque left, 0 to 1.
    pub(super) share: Real,
    /// The largest change of torque since the last tick, N m.
    pub(super) reach: Real,
}

/// The torque that motors and contacts make.
#[derive(Debug, Clone, Copy)]
pub(super) struct Made {
    /// On the sphere in N, N m.
    pub(super) torque: Vec3,
    /// At the joints, N m.
    pub(super) joints: [Real; MAX_JOINTS],
    /// What all limits left of the torque wanted, 0 to 1.
    pub(super) scale: Real,
    /// The motors cannot make a part of it in any size.
    pub(super) deficient: bool,
    /// The load of the most loaded contact as a share of its grip, 0 to 1.
    pub(super) traction: Real,
}

impl Made {
    pub(super) const NOTHING: Self =
        Self { torque: Vec3::ZERO, joints: [0.0; MAX_JOINTS], scale: 1.0, deficient: false, traction: 0.0 };

    pub(super) fn is_finite(&self) -> bool {
        self.torque.is_finite() && self.joints.iter().all(|t| t.is_finite())
    }
}

impl Controller {
    /// Whether motors push: enabled, or on the way to zero after a disable.
    #[inline]
    pub(super) fn powered(&self) -> bool {
        self.machine.powered() || self.made.torque != Vec3::ZERO
    }

    /// Renders the scene and moves stream, blend and passivity controller on by `dt` seconds. Returns the torque wanted on
    /// the sphere: the scene and the stream, limited, then ramped by soft start, disable and blend, then within the slew limit
    /// of the last tick's torque.
    #[inline]
    pub(super) fn render(&mut self, scene: &CompiledScene, tick: u64, dt: Real, changed: bool) -> Wanted {
        let changed = core::mem::take(&mut self.anchored) || changed;
        let motion = Motion { q: self.orientation.q, omega: self.joints.omega };
        let last_motion = core::mem::replace(&mut self.last_motion, motion);
        let last_stream = core::mem::replace(&mut self.last_stream, self.stream);
        self.stream.advance(tick, dt);
        let limits = self.rig.limits;
        let reach = limits.torque_rate * dt;
        if self.machine.gain == 0.0 {
            self.blend = Blend::DONE;
            self.last_asked = Vec3::ZERO;
            self.carried = 0.0;
            if let Some(guard) = &mut self.guard {
                guard.rest();
            }
            // A disable ends within the slew limit; a fault or a stop ends at once.
            let idle = self.machine.mode == Mode::Idle;
            let torque = if idle { slewed(self.made.torque, Vec3::ZERO, reach) } else { Vec3::ZERO };
            return Wanted { torque, share: 1.0, reach };
        }
        let before = changed.then(|| {
            let rendered = self.renderer.clone().render(scene, &last_motion, tick, 0.0, 0.0);
            last_stream.added_to(rendered, limits.torque).0
        });
        if let Some(before) = before
            && self.comes_from_afar(scene, motion, before)
        {
            self.machine.soften();
            self.carried = sqrt(self.made.torque.length_squared());
            self.carried_s = 0.0;
        }
        let gain = self.machine.gain;
        let rendered = self.renderer.render(scene, &motion, tick, dt, limits.reference_rate * dt);
        let (asked, share) = self.stream.added_to(rendered, limits.torque);
        self.last_asked = asked;
        let offset = self.blend.advance(asked * gain, before.map(|before| before * gain), dt);
        // The bound rises and falls with the soft start and the disable ramp. What was felt before a
        // soft start that began under power goes within the time of a blend.
        let bound = if gain == 1.0 {
            limits.torque
        } else {
            let left = self.carried * (1.0 - self.carried_s / BLEND_S).max(0.0);
            self.carried_s += dt;
            (limits.torque * gain + left).min(limits.torque)
        };
        let mut wanted = limited(asked * gain + offset, bound);
        if self.guard.is_some() {
            // Limited before: a torque that is not sent gives out nothing.
            wanted = limited(self.damp(tick, wanted), bound);
        }
        Wanted { torque: slewed(self.made.torque, wanted, reach), share, reach }
    }

    /// Whether the change of scene that gives the torque `before` (N m) at the motion of the last tick
    /// is one that `enable` would refuse: an effect is further than `enable_max_angle` from where it
    /// rests, and has just been placed there, or the torque steps.
    #[inline(never)]
    fn comes_from_afar(&self, scene: &CompiledScene, motion: Motion, before: Vec3) -> bool {
        let limits = &self.rig.limits;
        if self.machine.mode == Mode::Idle {
            return false;
        }
        let step = (before - self.last_asked).length_squared();
        let steps = step > (SOFT_STEP * limits.torque) * (SOFT_STEP * limits.torque);
        self.renderer.is_far(scene, motion.q, limits.enable_max_angle, steps)
    }

    /// Adds to the torque `wanted` the damping of the passivity controller, which it sets anew. Apart, so that it costs
    /// nothing if the rig has none.
    #[inline(never)]
    fn damp(&mut self, tick: u64, wanted: Vec3) -> Vec3 {
        let (Some(guard), Some(answered)) = (&mut self.guard, self.joints.answered()) else { return wanted };
        let (period, gain) = (self.rig.timing.period_s(), self.machine.gain);
        let now = Moment { tick: tick as u32, answered, period, gain };
        guard.damp(&self.observer, now, wanted, self.joints.omega)
    }

    /// The joint torques that make `wanted` within the limits of motors and contacts.
    #[inline]
    pub(super) fn feasible(&self, wanted: &Wanted) -> Made {
        let made = self.allocated(wanted);
        // Room for the rounding of an allocation at the slew limit.
        let reach = wanted.reach + 64.0 * Real::EPSILON * self.rig.limits.torque;
        if (made.torque - self.made.torque).length_squared() > reach * reach {
            return self.eased(made, wanted);
        }
        made
    }

    #[inline]
    fn allocated(&self, wanted: &Wanted) -> Made {
        let n = self.rig.device.joints();
        let rows = self.joints.posture.rows();
        let mut allocation = match self.rig.methods.allocation {
            AllocationMethod::Exact => allocation::allocate(rows, &self.limits, wanted.torque),
            AllocationMethod::Clipped => allocation::allocate_clipped(rows, &self.limits, wanted.torque),
        };
        let traction = self.rig.limits.traction.map_or(0.0, |grip| {
            // What is sent loads no contact beyond its grip.
            allocation.limit_traction(&self.arms[..n / 2], grip.mu * grip.normal_force).min(1.0)
        });
        let Allocation { torque: joints, scale, deficient } = allocation;
        let torque = self.joints.posture.torque_on_sphere(&joints[..n]);
        Made { torque, joints, scale: scale * wanted.share, deficient, traction }
    }

    /// What the limits of motors or contacts make of a torque may be further from the last tick's than
    /// the slew limit allows, although the torque wanted was not. Then the joint torques go only a part
    /// of the way to `next`, from those that make the last tick's torque at the posture of now.
    ///
    /// Both ends are within the limits of the motors and, as contact forces are linear in the joint
    /// torques by constant arms, of the contacts. Both limits are convex, so every point between is
    /// within them too.
    #[inline(never)]
    fn eased(&self, next: Made, wanted: &Wanted) -> Made {
        let n = self.rig.device.joints();
        let posture = &self.joints.posture;
        let last = self.made.torque;
        // The wheels have steered since: the last joint torques make another torque, and perhaps the
        // limits leave less of the last one. The nearer of the two is the one to start from.
        let again = self.allocated(&Wanted { torque: last, ..*wanted });
        let held = posture.torque_on_sphere(&self.made.joints[..n]);
        let (mut start, mut from) =
            if (again.torque - last).length_squared() <= (held - last).length_squared() {
                (again.joints, again.torque)
            } else {
                (self.made.joints, held)
            };
        if !next.deficient && (from - last).length_squared() > wanted.reach * wanted.reach {
            let grip = self.rig.limits.traction.map(|grip| grip.mu * grip.normal_force);
            let (rows, arms) = (posture.rows(), &self.arms[..n / 2]);
            start = allocation::nearest(&Bounds { rows, limits: &self.limits, arms, grip }, start, last);
            from = posture.torque_on_sphere(&start[..n]);
        }
        let part = part_within(from - last, next.torque - from, wanted.reach);
        let mut joints = [0.0; MAX_JOINTS];
        for j in 0..n {
            joints[j] = start[j] + (next.joints[j] - start[j]) * part;
        }
        let torque = posture.torque_on_sphere(&joints[..n]);
        let traction = self.rig.limits.traction.map_or(0.0, |grip| {
            allocation::traction(&self.arms[..n / 2], &joints[..n], grip.mu * grip.normal_force).min(1.0)
        });
        Made { torque, joints, traction, ..next }
    }
}

/// The largest t from 0 to 1 with |`from` + t `way`| at most `reach`; where there is none, the t that
/// brings it nearest.
fn part_within(from: Vec3, way: Vec3, reach: Real) -> Real {
    let (a, b) = (way.length_squared(), from.dot(way));
    if !(a > 0.0) {
        return 1.0;
    }
    let root = b * b - a * (from.length_squared() - reach * reach);
    let nearest = -b / a;
    let largest = if root > 0.0 { nearest + sqrt(root) / a } else { nearest };
    largest.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_of_the_way_ends_at_the_reach_or_nearest_to_it() {
        let part = |from: [Real; 3], way: [Real; 3]| part_within(from.into(), way.into(), 1.0);
        assert_eq!(part([0.0; 3], [4.0, 0.0, 0.0]), 0.25);
        assert_eq!(part([0.0; 3], [0.5, 0.0, 0.0]), 1.0, "the whole way is within reach");
        assert_eq!(part([-1.0, 0.0, 0.0], [4.0, 0.0, 0.0]), 0.5, "through the ball and out of it");
        assert_eq!(part([-3.0, 0.0, 0.0], [4.0, 0.0, 0.0]), 1.0, "into the ball");
        assert_eq!(part([-4.0, 2.0, 0.0], [8.0, 0.0, 0.0]), 0.5, "past the ball");
        assert_eq!(part([3.0, 0.0, 0.0], [4.0, 0.0, 0.0]), 0.0, "away from the ball");
        assert_eq!(part([3.0, 0.0, 0.0], [0.0; 3]), 1.0, "nowhere");
    }
}
