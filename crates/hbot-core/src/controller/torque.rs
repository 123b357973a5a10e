//! Computes joint torques from the scene. The torque wanted is first limited and then ramped. The
//! motors and contacts make as much of it as they can, within the slew limit.

use super::Controller;
use crate::allocation::{self, Bounds};
use crate::count::Count;
use crate::design::device::MAX_JOINTS;
use crate::design::kinematics::torque_of;
use crate::design::rig::AllocationMethod;
use crate::linear::{limited, shortened};
use crate::real::{Real, Vec3, sqrt};
use crate::render;
use crate::render::effects::Motion;
use crate::render::fades::Fades;
use crate::render::scene::CompiledScene;
use crate::safety::falling::Falling;
use crate::safety::mode::Mode;
use crate::safety::passivity::Moment;
use crate::safety::shaping::{BLEND_S, Blend, slewed};

/// Step in torque above which a change of scene restarts the soft start, as a fraction of the rig's
/// largest torque. It applies if an effect rests so far away that `enable` would refuse the scene.
/// A smaller step fades in, so that a slider can change the stiffness of a spring that the hand
/// holds far from its reference.
const SOFT_STEP: Real = 0.1;

/// The torque wanted on the sphere, and how much the limits have changed it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wanted {
    /// Torque on the sphere in frame N, in N m. It is limited and ramped, and differs from the
    /// torque of the last tick by at most the slew limit.
    pub(super) torque: Vec3,
    /// Fraction of the scene's and the stream's torque that remains after the torque limit, 0 to 1.
    pub(super) share: Real,
    /// Largest permitted change of the torque since the last tick, N m.
    pub(super) reach: Real,
}

/// What the scene and the stream ask for in one tick.
#[derive(Debug, Clone, Copy)]
struct Asked {
    /// Torque after the limit of torque, N m.
    torque: Vec3,
    /// Fraction of it that the limit has left, 0 to 1.
    share: Real,
    /// Torque that the blend adds, N m.
    offset: Vec3,
    /// Torque of the elastic effects before the limit, N m. Zero unless the passivity controller
    /// needs it.
    elastic: Vec3,
}

/// The torque on the sphere that the motors and contacts can make, and the joint torques for it.
///
/// The fields lie in memory in this order, in which `scale` and `traction` are no neighbours. The
/// compiler would copy two neighbours as one vector. As they are written one by one, that would
/// stop the processor for some nanoseconds.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
#[repr(C)]
pub(super) struct Made {
    /// Fraction of the wanted torque that remains after all limits, 0 to 1.
    pub(super) scale: Real,
    /// Torque of each joint, N m, in the order steer, drive of each wheel.
    pub(super) joints: [Real; MAX_JOINTS],
    /// Torque on the sphere in frame N, in N m.
    pub(super) torque: Vec3,
    /// Load of the most loaded contact, as a fraction of the force that it can hold, 0 to 1.
    pub(super) traction: Real,
    /// True if a component of the wanted torque was left out or reduced, because the motors cannot
    /// make it.
    pub(super) deficient: bool,
}

impl Made {
    pub(super) const NOTHING: Self =
        Self { torque: Vec3::ZERO, joints: [0.0; MAX_JOINTS], scale: 1.0, deficient: false, traction: 0.0 };

    /// Returns true if the torque on the sphere and the torques of the joints of `count` wheels are
    /// finite.
    #[inline]
    pub(super) fn is_finite<C: Count>(&self, count: C) -> bool {
        // Zero times a number that is not finite is NaN, and so is every sum with it. One
        // comparison then serves for all joints.
        let mut zero = 0.0;
        for torque in &self.joints[..count.joints()] {
            zero += 0.0 * torque;
        }
        self.torque.is_finite() && zero == 0.0
    }
}

impl Controller {
    /// Returns true if the motors make torque. They do if the rig is enabled, and while the torque
    /// falls to zero after a disable.
    #[inline]
    pub(super) fn powered(&self) -> bool {
        self.machine.powered() || self.made.torque != Vec3::ZERO
    }

    /// Computes the torque wanted on the sphere from the scene and the client's stream. Advances
    /// the stream, the blend and the passivity controller by `dt` seconds.
    ///
    /// The sum of the two torques is limited. It is then multiplied by the ramp of a soft start or
    /// a disable, and blended if the scene has changed. Last, its change since the last tick is
    /// limited to the slew limit.
    #[inline(always)]
    pub(super) fn render(&mut self, scene: &CompiledScene, tick: u64, dt: Real, changed: bool) -> Wanted {
        let changed = core::mem::take(&mut self.anchored) || changed;
        if changed {
            self.fades = Fades::Running;
        }
        let ramped = self.machine.gain != 0.0;
        // Needs the motion and the stream of the last tick, which are replaced next.
        let before = (changed && ramped).then(|| self.rendered_anew(scene, tick));
        let mut motion = Motion { q: self.orientation.q, omega: self.joints.omega };
        if let (Some(lead), Some(answered)) = (&mut self.lead, self.joints.answered()) {
            motion = lead.of(motion, (tick as u32).wrapping_sub(answered));
        }
        self.rendered_motion = motion;
        self.rendered_stream = self.stream;
        self.stream.advance(tick, dt);
        if !self.model.is_over() {
            self.model.advance(tick, dt);
        }
        let limits = self.rig.limits;
        let reach = limits.torque_rate * dt;
        if !ramped {
            self.blend = Blend::DONE;
            self.model.rest();
            if let Some(lead) = &mut self.lead {
                lead.rest();
            }
            self.falling = self.falling.map(|_| Falling::NONE);
            self.last_asked = Vec3::ZERO;
            self.carried = 0.0;
            if let Some(guard) = &mut self.guard {
                guard.rest();
            }
            if let Some(ledger) = &mut self.ledger {
                ledger.rest();
            }
            // A disable ends within the slew limit. A fault or a stop ends at once.
            let idle = self.machine.mode == Mode::Idle;
            let torque = if idle { slewed(self.made.torque, Vec3::ZERO, reach) } else { Vec3::ZERO };
            return Wanted { torque, share: 1.0, reach };
        }
        if let Some(before) = before
            && self.comes_from_afar(scene, before)
        {
            self.machine.soften();
            self.carried = sqrt(self.made.torque.length_squared());
            self.carried_s = 0.0;
        }
        let gain = self.machine.gain * self.shaking.gain();
        let before = before.map(|before| before * gain);
        let asked = if self.fades == Fades::Running {
            // The torque of another scene tells nothing of the fall of this one's.
            self.falling = self.falling.map(|_| Falling::NONE);
            self.rendered_fading(scene, tick, dt, before)
        } else {
            let moment = self.moment(tick, dt);
            let (rendered, elastic) = if self.shaking.suspects() || self.ledger.is_some() {
                self.rendered_each(scene, moment)
            } else {
                (self.renderer.render_in_tick(scene, motion, moment, |_, _| {}), Vec3::ZERO)
            };
            let (rendered, elastic) =
                if self.model.is_over() { (rendered, elastic) } else { self.modelled(rendered, elastic, dt) };
            let most = match &mut self.falling {
                Some(falling) => {
                    let stream = &self.stream;
                    let sum = if stream.is_over() { rendered } else { rendered + stream.torque() };
                    falling.most(sum, reach, limits.torque)
                }
                None => limits.torque,
            };
            let (torque, share) = self.stream.added_to(rendered, most);
            let offset = self.blend.added(torque * gain, before, limits.torque);
            self.blend.fade(dt, 1.0);
            Asked { torque, share, offset, elastic }
        };
        self.last_asked = asked.torque;
        // The bound follows the soft start and the disable ramp. If a soft start began with motors
        // on, the torque before it fades out within the time of a blend.
        let bound = if self.machine.gain == 1.0 {
            limits.torque
        } else {
            let left = self.carried * (1.0 - self.carried_s / BLEND_S).max(0.0);
            self.carried_s += dt;
            (limits.torque * self.machine.gain + left).min(limits.torque)
        };
        let (mut wanted, kept) = shortened(asked.torque * gain + asked.offset, bound);
        if self.guard.is_some() {
            if self.ledger.is_some() {
                let driving = wanted - asked.elastic * (asked.share * gain * kept);
                self.count(scene, &asked, gain, bound, driving);
            }
            // Limited before the damping, because a torque that is not sent gives out no energy.
            let damped = limited(self.damp(tick, wanted), bound);
            if let Some(ledger) = &mut self.ledger {
                ledger.want(damped, damped - wanted);
            }
            wanted = damped;
        }
        Wanted { torque: slewed(self.made.torque, wanted, reach), share: asked.share, reach }
    }

    /// Renders the scene as in any other tick. Returns its torque and the part of the elastic
    /// effects, N m. Records the torque of each effect if the sphere may be shaking.
    #[inline(never)]
    fn rendered_each(&mut self, scene: &CompiledScene, moment: render::Moment) -> (Vec3, Vec3) {
        // The limits of this tick are not known yet. Those of the last are nearly the same.
        let remains = if self.shaking_stored.counts() { self.made.scale } else { 1.0 };
        let (motion, shaking) = (self.rendered_motion, &mut self.shaking);
        let suspects = shaking.suspects();
        let mut elastic = Vec3::ZERO;
        let torque = self.renderer.render_in_tick(scene, motion, moment, |effect, torque| {
            if suspects {
                shaking.record(moment.tick, effect.slot, torque * remains);
            }
            if effect.kind.is_elastic() {
                elastic += torque;
            }
        });
        (torque, elastic)
    }

    /// Gives the guard against shaking the present tick.
    #[inline(never)]
    pub(super) fn look_for_shaking(&mut self, scene: &CompiledScene, tick: u64, dt: Real) {
        let now = crate::safety::shaking::Moment {
            tick,
            omega: self.joints.omega,
            energy: self.observer.energy() - self.compensation.as_ref().map_or(0.0, |stage| stage.given()),
            period: self.rig.timing.period_s(),
            inertia: self.rig.device.sphere_inertia(),
        };
        let reason = !self.stream.is_over()
            || !self.model.is_over()
            || self.renderer.is_led(scene)
            || self.machine.mode == Mode::Idle;
        let gives = scene.effects().iter().filter(|effect| effect.kind.gives());
        let on_purpose = gives.fold(0, |bits, effect| bits | 1 << effect.slot);
        let (renderer, q) = (&self.renderer, self.orientation.q);
        // A spring k whose torque T is limited to r T has stored r (2 - r) T²/2k on the way there.
        let remains = self.made.scale;
        let energy = || renderer.energy(scene, q).unwrap_or(0.0) * remains * (2.0 - remains);
        self.shaking.look(&now, &mut self.shaking_stored, (reason, on_purpose), dt, energy);
    }

    /// Renders the scene while an effect may be fading.
    ///
    /// The progress of fades and blend changes the torque by at most the limit in [`BLEND_S`]. If
    /// it would change faster, for example from one direction to the opposite, they all take
    /// longer.
    #[inline(never)]
    fn rendered_fading(&mut self, scene: &CompiledScene, tick: u64, dt: Real, before: Option<Vec3>) -> Asked {
        let (limits, stream) = (self.rig.limits, self.stream);
        let gain = self.machine.gain * self.shaking.gain();
        let modelled = (!self.model.is_over()).then(|| self.modelled(Vec3::ZERO, Vec3::ZERO, dt));
        let limit = |sum| stream.added_to(modelled.map_or(sum, |(model, _)| sum + model), limits.torque);
        let moment = self.moment(tick, dt);
        let parts = self.renderer.parts(scene, &self.rendered_motion, moment, dt);
        let (torque, share) = parts.torque(0.0, limit);
        let offset = self.blend.added(torque * gain, before, limits.torque);
        let most = limits.torque * (dt / BLEND_S);
        let part = parts.advance_within(most, self.blend.change(dt), gain, limit);
        self.renderer.fade(scene, dt, part);
        self.blend.fade(dt, part);
        if parts.is_over() {
            self.fades = Fades::Over;
        }
        let elastic = modelled.map_or(parts.elastic, |(_, own)| parts.elastic + own);
        Asked { torque, share, offset, elastic }
    }

    /// Returns `torque` and `elastic` plus those of the client's model in this tick, N m.
    #[inline(never)]
    fn modelled(&mut self, torque: Vec3, elastic: Vec3, dt: Real) -> (Vec3, Vec3) {
        let (model, own) = self.model.render(self.rendered_motion, dt, self.rig.limits.torque);
        (torque + model, elastic + own)
    }

    /// Returns the torque that `scene` would have made in the last tick, N m: at the motion of the
    /// sphere and together with the stream of that tick. It is a separate function, so that only a
    /// change of scene needs stack for a copy of the effects' memories.
    #[inline(never)]
    fn rendered_anew(&self, scene: &CompiledScene, tick: u64) -> Vec3 {
        let (mut renderer, motion) = (self.renderer.clone(), &self.rendered_motion);
        let model = (!self.model.is_over()).then(|| self.model.last());
        let limit = |sum| {
            let sum = model.map_or(sum, |model| sum + model);
            self.rendered_stream.added_to(sum, self.rig.limits.torque)
        };
        let moment = self.moment(tick, 0.0);
        renderer.parts(scene, motion, moment, 0.0).torque(0.0, limit).0
    }

    /// Returns true if the new scene is so far from rest that `enable` would refuse it. This has
    /// two conditions. An effect must rest further than `enable_max_angle` from the present
    /// orientation. In addition, either the effect's reference has just been placed, or the torque
    /// makes a large step.
    ///
    /// `before` is the torque of the new scene at the motion of the last tick, N m.
    #[inline(never)]
    fn comes_from_afar(&self, scene: &CompiledScene, before: Vec3) -> bool {
        let limits = &self.rig.limits;
        if self.machine.mode == Mode::Idle {
            return false;
        }
        let step = (before - self.last_asked).length_squared();
        let steps = step > (SOFT_STEP * limits.torque) * (SOFT_STEP * limits.torque);
        self.renderer.is_far(scene, self.orientation.q, limits.enable_max_angle, steps)
    }

    /// Returns what the effects need to know of the time, if they advance by `dt` seconds.
    #[inline(always)]
    fn moment(&self, tick: u64, dt: Real) -> render::Moment {
        let rate = self.rig.limits.reference_rate;
        let still = render::Moment::without_lead(tick, dt, rate * dt);
        let Some(lead) = &self.lead else { return still };
        render::Moment { lead: lead.time(), ahead: lead.ahead(), reach_ahead: rate * lead.ahead(), ..still }
    }

    /// Finds the energy that delay has created since the last tick, and gives it to the passivity
    /// controller. `driving` is the part of the wanted torque that moves the sphere on purpose, N
    /// m.
    ///
    /// The elastic torque that would act without delay is limited by itself, as the sent torque is.
    /// It is then a function of the orientation, and does no work on a closed path.
    #[inline(never)]
    fn count(&mut self, scene: &CompiledScene, asked: &Asked, gain: Real, bound: Real, driving: Vec3) {
        let (Some(ledger), Some(guard)) = (&mut self.ledger, &mut self.guard) else { return };
        let mut law = self.renderer.elastic_at(scene, self.orientation.q);
        if !self.model.is_over() {
            law += self.model.elastic_at(self.orientation.q);
        }
        let others = asked.torque / asked.share - asked.elastic;
        let (sum, share) = shortened(others + law, self.rig.limits.torque);
        let (_, kept) = shortened(sum * gain + asked.offset, bound);
        guard.add(ledger.render(law * (share * gain * kept), driving));
    }

    /// Returns the torque `wanted` plus a damping torque that the passivity controller computes for
    /// this tick. It is a separate function, so that it costs nothing if the rig has no passivity
    /// controller.
    #[inline(never)]
    fn damp(&mut self, tick: u64, wanted: Vec3) -> Vec3 {
        let (Some(guard), Some(answered)) = (&mut self.guard, self.joints.answered()) else { return wanted };
        let (period, gain) = (self.rig.timing.period_s(), self.machine.gain);
        let now = Moment { tick: tick as u32, answered, period, gain };
        guard.damp(&self.observer, self.ledger.as_ref(), now, wanted, self.joints.omega)
    }

    /// Sets `made` to the joint torques that make the torque `wanted` on the sphere, as far as the
    /// limits of motors, contacts and slew allow.
    #[inline(always)]
    pub(super) fn make<C: Count>(&mut self, count: C, wanted: &Wanted) {
        let next = self.allocated(count, wanted);
        // Allows for the rounding of an allocation at the slew limit.
        let reach = wanted.reach + 64.0 * Real::EPSILON * self.rig.limits.torque;
        if (next.torque - self.made.torque).length_squared() > reach * reach {
            self.made = self.eased(&next, wanted);
            return;
        }
        // Field by field, because to copy all joints that a rig can have takes longer. The others
        // have zero torque.
        let made = &mut self.made;
        made.torque = next.torque;
        made.joints[..count.joints()].copy_from_slice(&next.joints[..count.joints()]);
        (made.scale, made.deficient, made.traction) = (next.scale, next.deficient, next.traction);
    }

    #[inline(always)]
    fn allocated<C: Count>(&self, count: C, wanted: &Wanted) -> Made {
        let rows = self.joints.posture.first_rows(count);
        let mut allocation = match self.rig.methods.allocation {
            AllocationMethod::Exact => {
                allocation::allocate_in_tick(count, rows, &self.limits, &self.gives, wanted.torque)
            }
            AllocationMethod::Clipped => allocation::allocate_clipped(rows, &self.limits, wanted.torque),
        };
        let traction = self.rig.limits.traction.map_or(0.0, |grip| {
            // The sent torques load no contact beyond its grip, whatever load the allocation had
            // before.
            allocation.limit_traction(&self.arms[..count.wheels()], grip.mu * grip.normal_force).min(1.0)
        });
        Made {
            torque: torque_of(rows, &allocation.torque[..count.joints()]),
            joints: allocation.torque,
            scale: allocation.scale * wanted.share,
            deficient: allocation.deficient,
            traction,
        }
    }

    /// Moves the joint torques only a part of the way to `next`, so that the torque on the sphere
    /// stays within the slew limit.
    ///
    /// This is needed because the limits of motors or contacts can change the torque by more than
    /// the slew limit, even if the wanted torque does not. The way starts at joint torques that
    /// make the last tick's torque at the present posture.
    ///
    /// Both ends are within the limits of the motors. They are also within those of the contacts,
    /// as contact forces are linear in the joint torques with constant arms. Both limits are
    /// convex, so every point in between is within them too.
    #[inline(never)]
    fn eased(&self, next: &Made, wanted: &Wanted) -> Made {
        let n = self.rig.device.joints();
        let posture = &self.joints.posture;
        let last = self.made.torque;
        // The wheels have steered since the last tick, so the last joint torques now make another
        // torque. The limits may also leave less of the last torque. The nearer of the two is the
        // start.
        let again = self.allocated(self.rig.device.count(), &Wanted { torque: last, ..*wanted });
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
        Made { torque, joints, traction, ..*next }
    }
}

/// Returns the largest t from 0 to 1 for which the length of `from + t * way` is at most `reach`.
/// If there is none, returns the t for which the length is smallest.
pub(super) fn part_within(from: Vec3, way: Vec3, reach: Real) -> Real {
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
