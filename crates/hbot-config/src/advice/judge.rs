//! Judges a scene: whether the loop keeps it stable at each place where its laws are steepest or
//! change, which effect shakes the sphere if not, and what would be stable there.

use std::f64::consts::PI;

use hbot_core::around::{Linear, Place, Spot, Swing};
use hbot_core::{CompiledScene, Mat3, Quat, Vec3, rotation};

use super::held::Held;
use super::inertia::principal;
use super::sampled::{HOLDS, Hold, Sampled, Scene};

/// Speeds of the swings by which laws are linearised, rad/s. A slower swing is not felt as shaking.
/// A law that gets weaker in larger swings can still be unstable in the smaller one, and one whose
/// damping gets weaker, such as dry friction, in the larger one. Where a sphere leans against a
/// wall, the last speed is judged as well: it can circle along a round wall, whose damping then
/// takes no part.
const SPEEDS: [f64; 3] = [0.3, 1.0, 0.03];
/// A swing of a free sphere that decays more slowly than this rings for long, 1/s: it falls to less
/// than half in 3 s.
const DECAY: f64 = 0.25;
/// Stiffness below which a swing is too slow to be felt as ringing, N m/rad: below about 1 Hz with
/// the inertia of a sphere.
const SOFT: f64 = 0.1;
/// Slowest and fastest swing by which laws are linearised, rad/s and rad per tick.
const SLOWEST: f64 = 6.0;
const FASTEST: f64 = 1.5;
/// Number of places that are judged. A scene with more has many effects of one kind.
const MOST_PLACES: usize = 64;
/// A scene has to be stable with its stiffness times this: for what the linear loop leaves out,
/// such as the posture's other inertias and the encoders' counts.
const MARGIN: f64 = 1.1;
/// Part of a scene that is left where the torque limit cuts it off.
const CUT_OFF: f64 = 0.3;
/// Cosine of half of the angle between two orientations that count as one.
const SAME: f64 = 1.0 - 1.0e-9;
/// Speed of a sphere that keeps turning, below which it is not felt as gaining speed, rad/s.
const TURNING: f64 = 0.5;
/// Energy that a turning sphere gains in 10 s, below which nobody notices it, J.
const GAIN: f64 = 1.0e-3;
/// Number of places at which the scene is evaluated around a turn.
const AROUND: u32 = 720;

/// A place at which the loop does not keep a scene stable.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// Index of the effect that has the largest part in it.
    pub effect: usize,
    /// The place. It may be a place of another effect.
    pub place: Place,
    /// Axis about which the sphere shakes, unit vector in frame N. `None` if it may be any.
    pub axis: Option<Vec3>,
    /// Who holds the sphere when it shakes.
    pub hold: Hold,
    /// Why it shakes.
    pub why: Why,
}

/// Why the loop does not keep a scene stable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Why {
    /// The stiffness is too large for the damping at the place.
    Stiff {
        /// Stiffness of the scene about the axis, N m/rad.
        stiffness: f64,
        /// Part of this stiffness that is stable with the damping of the scene, 0 to 1.
        stable: f64,
        /// Damping of the scene about the axis, N m s/rad.
        damping: f64,
        /// What would make it stable.
        cure: Cure,
    },
    /// The damping acts too late and shakes the sphere instead of slowing it down.
    Damped {
        /// Damping of the scene about the axis, N m s/rad.
        damping: f64,
        /// Part of this damping that is stable, 0 to 1.
        stable: f64,
        /// Part of the effect's own damping with which the scene is stable, 0 to 1.
        own: f64,
    },
    /// A free sphere swings for long after a tap.
    Rings {
        /// Damping that the effect has to add for the sphere to come to rest, N m s/rad.
        added: f64,
    },
    /// A sphere that keeps turning gains speed over the bumps of the scene.
    Turning {
        /// Speed that it reaches, rad/s. Infinite if nothing slows it down.
        speed: f64,
        /// Damping that would keep it from gaining speed, N m s/rad.
        damping: f64,
    },
}

impl Why {
    /// Returns the part of the stiffness or damping that is stable, 0 to 1.
    fn left(&self) -> f64 {
        match self {
            Self::Stiff { stable, .. } | Self::Damped { stable, .. } => *stable,
            Self::Rings { .. } | Self::Turning { .. } => 1.0,
        }
    }
}

/// A change of one effect that makes a scene stable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cure {
    /// Part of the effect's own stiffness with which the scene is stable, 0 to 1. 0 if the others
    /// are unstable without it.
    pub own: f64,
    /// Damping that the effect has to add, N m s/rad. `None` if no damping helps.
    pub added: Option<f64>,
}

/// A swing at a place with the speed `speed` (rad/s), and the holds in which the sphere may be.
struct Swinging<'a> {
    holds: &'a [Held<'a>; 3],
    place: &'a Place,
    speed: f64,
}

/// Judges scenes by the sampled loop of a rig.
#[derive(Debug, Clone)]
pub struct Judge {
    /// The loop.
    pub sampled: Sampled,
    /// Largest torque on the sphere, N m. Where the scene asks for more, its torque is cut off.
    pub torque: f64,
    /// Largest change of this torque, N m/s.
    pub torque_rate: f64,
    /// Largest speed at which the rig runs, rad/s.
    pub speed: f64,
    /// Whether the rig limits the energy that it gives out. Then a turning sphere does not gain
    /// speed.
    pub passive: bool,
}

impl Judge {
    /// Returns an entry for each effect that the loop does not keep stable, at the place where the
    /// least of it would be stable. References that are relative to the sphere's orientation are
    /// taken as placed at the identity.
    #[must_use]
    pub fn findings(&self, scene: &CompiledScene) -> Vec<Finding> {
        let mut found: Vec<Finding> = Vec::new();
        let mut judged = Vec::new();
        let holds = HOLDS.map(|hold| Held::new(&self.sampled, &hold));
        let places = self.places(scene);
        for (place, leans) in &places {
            let speeds = if *leans { &SPEEDS[..] } else { &SPEEDS[..2] };
            for speed in speeds {
                let swinging = Swinging { holds: &holds, place, speed: *speed };
                if let Some(finding) = self.at(scene, &swinging, &mut judged, &found) {
                    keep(&mut found, finding);
                }
            }
        }
        // Effects that rest at one orientation share its place. Each finding has its own effect's.
        scene.places(Quat::IDENTITY, |place| {
            let shared = |finding: &&mut Finding| {
                finding.effect == place.effect && finding.place.q.dot(place.q).abs() > SAME
            };
            found.iter_mut().filter(shared).for_each(|finding| finding.place = place);
        });
        if !self.passive && found.is_empty() {
            found.extend(self.turning(scene, &places));
        }
        found
    }

    /// Returns what the scene is like at `place` in a swing of the speed `speed` (rad/s): the
    /// linearised effects, and their sum.
    #[must_use]
    pub fn around(&self, scene: &CompiledScene, place: &Place, speed: f64) -> (Vec<Linear>, Scene) {
        let axes = self.sampled.axes;
        let mut pace = Vec3::splat(200.0);
        let mut parts = Vec::new();
        let mut sum = Linear::NONE;
        // The size of a swing follows from its pace, which follows from the stiffness that a swing
        // of this size feels.
        for _ in 0..3 {
            let turn = [pace.x, pace.y, pace.z].map(|pace| speed / pace);
            let swing = Swing { axes, turn, speed };
            parts = (0..scene.effects().len())
                .map(|index| scene.around(index, place, Quat::IDENTITY, &swing))
                .collect();
            // A torque that a hand holds adds a part that is not symmetric. In balance the hand's
            // own torque takes it away.
            parts.iter_mut().for_each(|part: &mut Linear| {
                part.stiffness = (part.stiffness + part.stiffness.transpose()) * 0.5;
                part.damping = (part.damping + part.damping.transpose()) * 0.5;
            });
            sum = parts.iter().fold(Linear::NONE, |sum, part| Linear {
                stiffness: sum.stiffness + part.stiffness,
                damping: sum.damping + part.damping,
            });
            let stiffness = axes.transpose() * sum.stiffness * axes;
            let before = pace;
            for k in 0..3 {
                let own = (stiffness.col(k)[k].max(0.0) / self.sampled.inertia[k]).sqrt();
                pace[k] = own.clamp(SLOWEST, FASTEST / self.sampled.period);
            }
            if (pace - before).abs().max_element() < 0.02 * pace.min_element() {
                break;
            }
        }
        let mut masses = Vec::new();
        scene.masses(self.sampled.inertia.min_element(), self.sampled.period, |mass, smoothing| {
            masses.push((mass, smoothing));
        });
        (parts, Scene { stiffness: sum.stiffness, damping: sum.damping, masses })
    }

    /// Returns the first hold in which the loop does not keep `scene` stable in a swing of the
    /// speed `speed`, rad/s.
    fn shakes(&self, holds: &[Held<'_>; 3], scene: &Scene, speed: f64) -> Option<Hold> {
        let slew = self.slew(scene, speed);
        let stiffer = Scene { stiffness: scene.stiffness * MARGIN, ..scene.clone() };
        let more = Scene { damping: scene.damping * MARGIN, ..stiffer.clone() };
        // A virtual mass can keep a spring stable that is unstable once the torque limit cuts both
        // off.
        let cut = Scene {
            stiffness: stiffer.stiffness * CUT_OFF,
            damping: scene.damping * CUT_OFF,
            masses: scene.masses.iter().map(|(mass, time)| (*mass * CUT_OFF, *time)).collect(),
        };
        let unstable = |(held, _): &(&Held<'_>, Hold)| {
            !held.is_stable(&stiffer, slew)
                || !held.is_stable(&more, slew)
                || !scene.masses.is_empty() && !held.is_stable(&cut, slew)
        };
        holds.iter().zip(HOLDS).find(unstable).map(|(_, hold)| hold)
    }

    /// Returns the delay that the slew limit adds in a swing of the speed `speed` (rad/s), s.
    ///
    /// A torque of the amplitude T that swings by W rad/s needs T W of the slew limit R. With r = T
    /// W/R above pi/2 it becomes a triangle, which is late by acos(pi/(2 r))/W (the describing
    /// function of a rate limiter).
    fn slew(&self, scene: &Scene, speed: f64) -> f64 {
        let sampled = &self.sampled;
        let inertia = sampled.inertia.min_element();
        let stiffness = principal(&scene.stiffness).0.max_element().max(0.0);
        let damping = principal(&scene.damping).0.max_element().max(0.0);
        // The pace of a swing on the stiffness, and that at which the damping alone swings.
        let pace = (stiffness / inertia).sqrt().max(damping / inertia).min(2.0 / sampled.lateness());
        let torque = (speed * (damping + stiffness / pace.max(SLOWEST))).min(self.torque);
        let part = 0.5 * PI * self.torque_rate / (torque * pace);
        if part < 1.0 { part.acos() / pace } else { 0.0 }
    }

    /// Returns whether a free sphere swings for long in `scene` after a tap.
    fn rings(&self, free: &Held<'_>, scene: &Scene) -> bool {
        let (stiffness, axes) = principal(&scene.stiffness);
        let stiffness = stiffness.max(Vec3::ZERO);
        // The part of each direction that is stiff. What is too soft to swing needs no damping.
        let needed = axes * Mat3::from_diagonal(stiffness / (stiffness + SOFT)) * axes.transpose();
        let damping = scene.damping - needed * (2.0 * self.sampled.inertia.min_element() * DECAY);
        !free.is_stable(&Scene { damping, ..scene.clone() }, 0.0)
    }

    fn at(
        &self,
        scene: &CompiledScene,
        swinging: &Swinging<'_>,
        judged: &mut Vec<(Scene, f64)>,
        found: &[Finding],
    ) -> Option<Finding> {
        let Swinging { holds, place, speed } = *swinging;
        let (parts, sum) = self.around(scene, place, speed);
        let slew = self.slew(&sum, speed);
        let near = |(other, its_slew): &(Scene, f64)| {
            let off = |a: &Mat3, b: &Mat3| (0..3).map(|k| (a.col(k) - b.col(k)).length()).fold(0.0, f64::max);
            off(&other.stiffness, &sum.stiffness) < 1.0e-9
                && off(&other.damping, &sum.damping) < 1.0e-9
                && *its_slew == slew
        };
        if judged.iter().any(near) {
            return None;
        }
        judged.push((sum.clone(), slew));
        // A wall damps in one direction. While it does, it damps twice what a swing feels.
        let wall = if place.spot == Spot::Wall { parts[place.effect].damping } else { Mat3::ZERO };
        let inwards = Scene { damping: sum.damping + wall, ..sum.clone() };
        let sided = (place.spot == Spot::Wall).then(|| self.shakes(holds, &inwards, speed)).flatten();
        let Some(hold) = self.shakes(holds, &sum, speed).or(sided) else {
            let (axis, about) = largest_axis(&sum.stiffness);
            let (effect, part) = largest(&parts, |part| about.dot(part.stiffness * about))?;
            let shape = shape(part, about)?;
            let more = |b: f64| Scene { damping: sum.damping + shape * b, ..sum.clone() };
            // At the edge of a wall a free sphere does not swing: it leaves.
            let [free, ..] = holds;
            let rings = place.deeper == Vec3::ZERO && self.rings(free, &sum);
            let added = rings.then(|| least_damping(|b| !self.rings(free, &more(b)))).flatten()?;
            let [hold, ..] = HOLDS;
            return Some(Finding { effect, place: *place, axis, hold, why: Why::Rings { added } });
        };
        let stable = |scene: Scene| self.shakes(holds, &scene, speed).is_none();
        let without = Scene { stiffness: Mat3::ZERO, ..inwards };
        if !stable(without.clone()) {
            let (axis, about) = largest_axis(&sum.damping);
            let (effect, part) = largest(&parts, |part| about.dot(part.damping * about))?;
            let own = part.damping + if effect == place.effect { wall } else { Mat3::ZERO };
            let rest = without.damping - own;
            let left = bisected(|s| stable(Scene { damping: without.damping * s, ..without.clone() }));
            if !is_worst(found, effect, place, left) {
                return None;
            }
            let why = Why::Damped {
                damping: about.dot(sum.damping * about),
                stable: left,
                own: bisected(|s| stable(Scene { damping: rest + own * s, ..without.clone() })),
            };
            return Some(Finding { effect, place: *place, axis, hold, why });
        }
        // The axis about which the delay takes more damping away than the scene has.
        let (axis, about) = largest_axis(&(sum.stiffness * self.sampled.lateness() - sum.damping));
        let (effect, part) = largest(&parts, |part| about.dot(part.stiffness * about))?;
        let rest = sum.stiffness - part.stiffness;
        let shape = shape(part, about)?;
        let left = bisected(|s| stable(Scene { stiffness: sum.stiffness * s, ..sum.clone() }));
        if !is_worst(found, effect, place, left) {
            return None;
        }
        let why = Why::Stiff {
            stiffness: about.dot(sum.stiffness * about),
            stable: left,
            damping: about.dot(sum.damping * about),
            cure: Cure {
                own: bisected(|s| stable(Scene { stiffness: rest + part.stiffness * s, ..sum.clone() })),
                added: least_damping(|b| stable(Scene { damping: sum.damping + shape * b, ..sum.clone() })),
            },
        };
        Some(Finding { effect, place: *place, axis, hold, why })
    }

    /// Returns the places of the scene, each orientation once: walls also a little inside, and
    /// where the sphere rests if the effects pull it away from a place.
    fn places(&self, scene: &CompiledScene) -> Vec<(Place, bool)> {
        /// Depth at which a hand leans against a wall or a spring, rad, and the part of the largest
        /// torque with which it does so at most.
        const LEANING: (f64, f64) = (0.01, 0.9);
        let mut all: Vec<(Place, bool)> = Vec::new();
        let mut add = |place: Place, leans: bool| {
            // At the rest of one effect the others are judged as well.
            let known = all.iter().any(|(other, _)| {
                (other.spot == place.spot || place.spot == Spot::Rest)
                    && other.q.dot(place.q).abs() > SAME
                    && (place.spot == Spot::Rest || other.effect == place.effect)
            });
            if !known && all.len() < MOST_PLACES {
                all.push((place, leans));
            }
        };
        let mut rests = Vec::new();
        scene.places(Quat::IDENTITY, |place| {
            // Where more torque is wanted than the rig makes, the sphere does not stay.
            let rest = self.rest(scene, &place);
            if rest.is_none() || pull(scene, &place).length() <= self.torque {
                add(place, false);
            }
            if place.deeper != Vec3::ZERO {
                let torque = pull(scene, &place.at_depth(LEANING.0)).length();
                add(
                    place.at_depth(LEANING.0 * (LEANING.1 * self.torque / torque).min(1.0)),
                    place.spot == Spot::Wall,
                );
            }
            rests.extend(rest);
        });
        // After the effects' own places, so that those keep their names.
        rests.into_iter().for_each(|rest| add(rest, false));
        all
    }

    /// Returns where the sphere comes to rest if it starts at `place`, or `None` if it rests there
    /// or finds no rest.
    #[must_use]
    pub fn rest(&self, scene: &CompiledScene, place: &Place) -> Option<Place> {
        let enough = 1.0e-2 * self.torque;
        let (mut at, mut torque) = (*place, pull(scene, place));
        if torque.length() <= enough {
            return None;
        }
        // The steps of Levenberg and Marquardt: by the stiffness there, as long as that helps.
        let mut caution = 1.0e-3;
        let mut stiffness = None;
        for _ in 0..25 {
            let matrix = *stiffness.get_or_insert_with(|| self.around(scene, &at, SPEEDS[0]).1.stiffness);
            let (sizes, axes) = principal(&matrix);
            // Downhill also where the sphere rolls away, and at most a tenth of a turn.
            let size = sizes.abs() + caution * sizes.abs().max_element() + 1.0e-9;
            let step = axes * ((axes.transpose() * torque) / size);
            let step = step.clamp_length_max(0.5);
            let next = at.rest_at(rotation::exp(step) * at.q);
            let left = pull(scene, &next);
            if left.length() < torque.length() {
                (at, torque, stiffness) = (next, left, None);
                caution = (0.2 * caution).max(1.0e-6);
            } else {
                caution = 5.0 * caution.max(1.0e-2);
            }
            if torque.length() <= enough {
                return Some(at);
            }
            if caution > 1.0e6 {
                return None;
            }
        }
        None
    }

    /// Returns an entry if a sphere that keeps turning gains speed.
    ///
    /// A torque that depends on the angle is rendered late by t. At the speed w it then gives out
    /// the mean power 2 t <T²>/J, with the mean square <T²> of the torque less its mean and the
    /// inertia J: the sphere is faster where the torque has pushed it, and there the torque is
    /// late. Damping takes B w² (docs/stability.md).
    fn turning(&self, scene: &CompiledScene, places: &[(Place, bool)]) -> Option<Finding> {
        let inertia = self.sampled.inertia.element_sum() / 3.0;
        let late = (self.sampled.lateness() - self.sampled.lead).max(0.0);
        let mut worst: Option<(f64, Finding)> = None;
        for (place, _) in places.iter().take(6) {
            for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                let turned = scene.turned(axis, place.q, Quat::IDENTITY, 1.0, AROUND);
                let power = 2.0 * late * turned.ripple / inertia;
                let speed =
                    if turned.damping > 1.0e-9 { (power / turned.damping).sqrt() } else { f64::INFINITY };
                // A sphere that never passes the highest place does not keep turning.
                let passes = (2.0 * turned.barrier / inertia).sqrt();
                let gains = power * 10.0 > GAIN && speed > TURNING.max(passes) && passes < self.speed;
                if gains && worst.as_ref().is_none_or(|(most, _)| power > *most) {
                    let slow = TURNING.max(passes);
                    let why = Why::Turning { speed, damping: power / (slow * slow) };
                    let [hold, ..] = HOLDS;
                    let (effect, place, axis) = (place.effect, *place, Some(axis));
                    worst = Some((power, Finding { effect, place, axis, hold, why }));
                }
            }
        }
        worst.map(|(_, finding)| finding)
    }
}

/// Returns the torque of the whole scene on a sphere that rests at `place`, N m.
fn pull(scene: &CompiledScene, place: &Place) -> Vec3 {
    (0..scene.effects().len()).map(|i| scene.pull(i, place, Quat::IDENTITY, place.q)).sum()
}

/// Returns whether a finding about `effect` at `place`, with `left` of it stable, takes the place of
/// the one that there is: which is at a place of another effect, or has more that is stable. So a
/// place that another effect adds does not change what is said of this one.
fn is_worst(found: &[Finding], effect: usize, place: &Place, left: f64) -> bool {
    let worse = |place: &Place, left: f64| (place.effect != effect, left);
    let other = found.iter().find(|other| other.effect == effect);
    other.is_none_or(|other| worse(place, left) < worse(&other.place, other.why.left()))
}

/// Adds a finding, unless there is a worse one of the same effect.
fn keep(found: &mut Vec<Finding>, finding: Finding) {
    if is_worst(found, finding.effect, &finding.place, finding.why.left()) {
        match found.iter_mut().find(|other| other.effect == finding.effect) {
            Some(other) => *other = finding,
            None => found.push(finding),
        }
    }
}

/// Returns the axis about which a symmetric matrix is largest, or `None` if it may be any axis; and
/// an axis that serves for both.
fn largest_axis(matrix: &Mat3) -> (Option<Vec3>, Vec3) {
    let (sizes, axes) = principal(matrix);
    let axis = axes.col(sizes.max_position());
    // The sign of an axis means nothing.
    let axis = axis * axis.to_array().into_iter().find(|x| x.abs() > 1.0e-6).map_or(1.0, f64::signum);
    ((sizes.min_element() < 0.95 * sizes.max_element()).then_some(axis), axis)
}

/// Returns the stiffness of an effect, scaled so that it is 1 about the axis `about`. A damping
/// that is added to the effect has this shape.
fn shape(part: &Linear, about: Vec3) -> Option<Mat3> {
    let size = about.dot(part.stiffness * about);
    (size > 0.0).then(|| part.stiffness * (1.0 / size))
}

/// Returns the part for which `about` is largest, with its index.
fn largest(parts: &[Linear], about: impl Fn(&Linear) -> f64) -> Option<(usize, &Linear)> {
    parts.iter().enumerate().max_by(|a, b| about(a.1).total_cmp(&about(b.1)))
}

/// Returns the largest part from 0 to 1 up to which a scene is stable, to 2 % of it.
fn bisected(stable: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.5, 1.0);
    while !stable(low) {
        (low, high) = (0.25 * low, low);
        if low < 1.0e-4 {
            return 0.0;
        }
    }
    while high - low > 0.02 * low {
        let middle = (low * high).sqrt();
        if stable(middle) { low = middle } else { high = middle }
    }
    low
}

/// Returns the least added damping that makes a scene stable, N m s/rad, to 2 %, or `None` if there
/// is none.
fn least_damping(stable: impl Fn(f64) -> bool) -> Option<f64> {
    let mut high = 1.0e-3;
    while !stable(high) {
        high *= 2.0;
        if high > 10.0 {
            return None;
        }
    }
    let mut low = 0.5 * high;
    while high > 1.02 * low {
        let middle = (low * high).sqrt();
        if stable(middle) { high = middle } else { low = middle }
    }
    Some(high)
}
