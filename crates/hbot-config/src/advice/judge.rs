//! Judges a scene: whether the loop keeps it stable at each place where its laws are steepest or
//! change, which effect shakes the sphere if not, and what would be stable there.

use std::cell::RefCell;
use std::f64::consts::PI;

use hbot_core::render::around::{Linear, Place, Spot, Swing};
use hbot_core::{CompiledScene, Mat3, Quat, Vec3};

use super::finding::{Cure, Finding, Why, is_worst, keep};
use super::held::Held;
use super::inertia::principal;
use super::limit::Limit;
use super::sampled::{HOLDS, Hold, Sampled, Scene};

/// Speeds of the swings by which laws are linearised, rad/s. A slower swing is not felt as shaking.
/// A law that gets weaker in larger swings can still be unstable in the smaller one, and one whose
/// damping gets weaker, such as dry friction, in the larger one. Where a sphere leans against a
/// wall, the last speed is judged as well: it can circle along a round wall, whose damping then
/// takes no part.
pub(super) const SPEEDS: [f64; 5] = [0.2, 0.33, 0.55, 1.0, 0.03];
/// Stiffness below which a swing is too slow to be felt as ringing, N m/rad: below about 1 Hz with
/// the inertia of a sphere.
pub(super) const SOFT: f64 = 0.1;
/// Slowest and fastest swing by which laws are linearised, rad/s and rad per tick.
pub(super) const SLOWEST: f64 = 6.0;
const FASTEST: f64 = 1.5;
/// Paces about the axes with which the search for a swing begins, rad/s.
pub(super) const QUICK_PACES: Vec3 = Vec3::splat(200.0);
/// Product of the pace of a damping alone and the time by which it is late, from which it may shake
/// the sphere.
const QUICK: f64 = 0.4;
/// A scene has to be stable with its stiffness times this: for what the linear loop leaves out,
/// such as the posture's other inertias and the encoders' counts.
const MARGIN: f64 = 1.1;
/// The same for swings at the limits of the torque, whose harmonics the describing function leaves
/// out.
const LIMITED_MARGIN: f64 = 1.2;
/// Multiple of what is just stable, at which the loop is no longer stable.
const BEYOND: f64 = 1.05;
/// Least part of a wall's stiffness that a round wall has about a second axis.
const ROUND: f64 = 0.7;
/// Cosine of half of the angle between two orientations that count as one.
pub(super) const SAME: f64 = 1.0 - 1.0e-9;

/// A swing at a place with the speed `speed` (rad/s), and the holds in which the sphere may be.
struct Swinging<'a> {
    holds: &'a Holds<'a>,
    place: &'a Place,
    speed: f64,
    /// Bit by bit the effects that are far away from the place.
    far: u64,
}

/// The holds in which a sphere may be.
struct Holds<'a> {
    /// With the inertia of the rig's lightest posture.
    usual: [Held<'a>; 3],
    /// With the smallest inertia about all axes. The axis of the smallest inertia turns with the
    /// posture, and a damping that is just small enough for another axis may meet it.
    light: [Held<'a>; 3],
    /// Scenes whose small swings were judged, with what [`Judge::small`] returned.
    small: RefCell<Vec<(Scene, usize)>>,
    /// Scenes that were judged, with the limits of their swings.
    judged: RefCell<Vec<(Scene, Option<Limit>)>>,
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
        let Sampled { inertia, .. } = self.sampled;
        let light = Sampled { inertia: Vec3::splat(inertia.min_element()), ..self.sampled.clone() };
        let [usual, light] =
            [&self.sampled, &light].map(|sampled| HOLDS.map(|hold| Held::new(sampled, &hold)));
        let holds = Holds { usual, light, small: RefCell::default(), judged: RefCell::default() };
        let (places, here) = self.places(scene);
        for (place, leans) in &places {
            let speeds = if *leans { &SPEEDS[..] } else { &SPEEDS[..4] };
            let far = self.far(scene, place);
            let mut pace = QUICK_PACES;
            for speed in speeds {
                // The slowest swing comes last. It can be stiffer than all others.
                if *speed < SPEEDS[0] {
                    pace = QUICK_PACES;
                }
                let swinging = Swinging { holds: &holds, place, speed: *speed, far };
                if let Some(finding) = self.at(scene, &swinging, SLOWEST, &mut pace, &found) {
                    keep(&mut found, finding);
                }
            }
        }
        for (place, _) in &places {
            let bouncing = self.bouncing(scene, place);
            bouncing.into_iter().for_each(|finding| keep(&mut found, finding));
        }
        // What shakes at its own places is not looked for elsewhere.
        for place in self.away(scene, here) {
            let far = self.far(scene, &place);
            let mut pace = QUICK_PACES;
            for speed in &SPEEDS[..4] {
                let swinging = Swinging { holds: &holds, place: &place, speed: *speed, far };
                if let Some(finding) = self.at(scene, &swinging, SLOWEST, &mut pace, &found)
                    && found.iter().all(|other| other.effect != finding.effect || other.away)
                {
                    keep(&mut found, Finding { away: true, ..finding });
                }
            }
        }
        // Effects that rest at one orientation share its place. Each finding has its own effect's.
        scene.places(Quat::IDENTITY, |place| {
            let shared = |finding: &&mut Finding| {
                !finding.away && finding.effect == place.effect && finding.place.q.dot(place.q).abs() > SAME
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
        self.around_at(scene, place, speed, SLOWEST, 0, &mut { QUICK_PACES })
    }

    /// Returns bit by bit the effects that make no torque in the largest swing about any axis at
    /// `place`, such as a wall that is far away.
    fn far(&self, scene: &CompiledScene, place: &Place) -> u64 {
        let speed = SPEEDS[3];
        let swing = Swing { axes: self.sampled.axes, turn: [speed / SLOWEST; 3], speed };
        let (mut far, mut bit) = (0, 1);
        scene.all_around(
            place,
            Quat::IDENTITY,
            &swing,
            |_| false,
            |part| {
                far |= if part == Linear::NONE { bit } else { 0 };
                bit <<= 1;
            },
        );
        far
    }

    /// Returns what [`around`](Self::around) returns, for swings of the pace `least` (rad/s) at
    /// least. The effects `far` (bit by bit) take no part. The search for the paces about the axes
    /// begins with `pace` (rad/s) and leaves what it found there.
    pub(super) fn around_at(
        &self,
        scene: &CompiledScene,
        place: &Place,
        speed: f64,
        least: f64,
        far: u64,
        pace: &mut Vec3,
    ) -> (Vec<Linear>, Scene) {
        let axes = self.sampled.axes;
        let mut parts = vec![Linear::NONE; scene.effects().len()];
        let mut about = Vec::new();
        for k in 0..3 {
            // The size of a swing follows from its pace, which follows from the stiffness that a
            // swing of this size feels.
            for _ in 0..3 {
                let mut swing = Swing { axes, turn: [0.0; 3], speed };
                swing.turn[k] = speed / pace[k];
                about.clear();
                scene.all_around(
                    place,
                    Quat::IDENTITY,
                    &swing,
                    |i| far & 1 << i != 0,
                    |part| about.push(part),
                );
                let axis = axes.col(k);
                let stiffness: f64 = about.iter().map(|part| axis.dot(part.stiffness * axis)).sum();
                let own = (stiffness.max(0.0) / self.sampled.inertia[k]).sqrt();
                let before = pace[k];
                pace[k] = own.max(least).min(FASTEST / self.sampled.period);
                if (pace[k] - before).abs() < 0.02 * before {
                    break;
                }
            }
            for (part, about) in parts.iter_mut().zip(&about) {
                part.stiffness += about.stiffness;
                part.damping += about.damping;
            }
        }
        // A torque that a hand holds adds a part that is not symmetric. In balance the hand's own
        // torque takes it away.
        for part in &mut parts {
            part.stiffness = (part.stiffness + part.stiffness.transpose()) * 0.5;
            part.damping = (part.damping + part.damping.transpose()) * 0.5;
        }
        let sum = |of: fn(&Linear) -> Mat3| parts.iter().map(of).fold(Mat3::ZERO, |sum, part| sum + part);
        let (stiffness, damping) = (sum(|part| part.stiffness), sum(|part| part.damping));
        let mut masses = Vec::new();
        scene.masses(self.sampled.inertia.min_element(), self.sampled.period, |mass, smoothing| {
            masses.push((mass, smoothing));
        });
        (parts, Scene { stiffness, damping, masses })
    }

    /// Returns the first hold in which the loop does not keep `scene` stable in a swing of the
    /// speed `speed`, rad/s.
    fn shakes(&self, holds: &Holds<'_>, scene: &Scene, speed: f64) -> Option<Hold> {
        let small = self.small(holds, scene);
        let limited = self.limit(scene, speed).and_then(|limit| {
            let most = times(scene, LIMITED_MARGIN);
            let shakes = |held: &Held<'_>| most.iter().any(|scene| !held.is_stable(scene, Some(limit)));
            holds.usual[..small].iter().position(shakes)
        });
        HOLDS.get(limited.unwrap_or(small)).copied()
    }

    /// Returns the index of the first hold in which the loop does not keep `scene` stable in swings
    /// that no limit cuts off, or the number of holds.
    fn small(&self, holds: &Holds<'_>, scene: &Scene) -> usize {
        if let Some((_, first)) = holds.small.borrow().iter().find(|(other, _)| near(other, scene)) {
            return *first;
        }
        // A damping far below what shakes the sphere by itself may be a little larger.
        let Sampled { lead, rate_lag, taps, inertia, .. } = &self.sampled;
        let damping = principal(&(scene.damping + scene.stiffness * *lead)).0.max_element();
        let fast = damping / inertia.min_element() * (self.sampled.lateness() + rate_lag);
        let is_slow = fast < QUICK && taps.is_empty() && scene.masses.is_empty();
        let more = times(scene, MARGIN);
        let shakes = |(held, light): (&Held<'_>, &Held<'_>)| {
            more[usize::from(is_slow)..].iter().any(|scene| !held.is_stable(scene, None))
                || !is_slow && !light.is_stable(scene, None)
        };
        let first = holds.usual.iter().zip(&holds.light).position(shakes).unwrap_or(HOLDS.len());
        holds.small.borrow_mut().push((scene.clone(), first));
        first
    }

    /// Returns the limits of the torque if they change what swings of the speed `speed` (rad/s)
    /// there can be.
    ///
    /// A torque that is cut off at T makes at least the speed T/(J W) in a swing of the pace W. So
    /// where W is below T/(J speed), a swing that is cut off is faster than `speed`. And a torque
    /// that the slew limit R cuts off makes at most 4 R/(pi J W²).
    fn limit(&self, scene: &Scene, speed: f64) -> Option<Limit> {
        let Self { sampled, torque, torque_rate, .. } = self;
        let most = |m: &Mat3| principal(m).0.abs().max_element();
        let heaviest = HOLDS.iter().map(|hold| hold.inertia).fold(0.0, f64::max);
        let slowest = torque / ((sampled.inertia.max_element() + heaviest) * speed);
        let fastest = (4.0 * torque_rate / (PI * sampled.inertia.min_element() * speed)).sqrt();
        let mass: f64 = scene.masses.iter().map(|(mass, _)| most(mass)).sum();
        let (stiffness, damping) = (most(&scene.stiffness), most(&scene.damping));
        let asked = |pace: f64| MARGIN * speed * (stiffness / pace + damping + mass * pace);
        let binds = asked(slowest.min(fastest)) > *torque || asked(fastest) * fastest > *torque_rate;
        binds.then_some(Limit { speed, torque: *torque, rate: *torque_rate })
    }

    fn at(
        &self,
        scene: &CompiledScene,
        swinging: &Swinging<'_>,
        least: f64,
        pace: &mut Vec3,
        found: &[Finding],
    ) -> Option<Finding> {
        let Swinging { holds, place, speed, far } = *swinging;
        let (parts, sum) = self.around_at(scene, place, speed, least, far, pace);
        // A damping that is too large makes swings that are faster than those of the stiffness, and
        // smaller: a quarter of one takes as long as the torque is late.
        let fast = principal(&sum.damping).0.max_element() / self.sampled.inertia.min_element();
        let is_quick = least == SLOWEST && fast * self.sampled.lateness() > QUICK;
        if is_quick {
            let fast = fast.min(0.5 * PI / self.sampled.lateness());
            let fast = self.at(scene, swinging, fast, &mut { QUICK_PACES }, found);
            if fast.is_some() {
                return fast;
            }
        }
        let limit = self.limit(&sum, speed);
        let mut judged = holds.judged.borrow_mut();
        if judged.iter().any(|(other, its)| near(other, &sum) && *its == limit) {
            return None;
        }
        judged.push((sum.clone(), limit));
        drop(judged);
        // A wall damps in one direction. While it does, it damps twice what a swing feels. Along a
        // wall that is round a sphere also swings without it: half of the time.
        let wall = if place.spot == Spot::Wall { parts[place.effect].damping } else { Mat3::ZERO };
        let inwards = Scene { damping: sum.damping + wall, ..sum.clone() };
        let along = Scene { damping: sum.damping - wall * 0.5, ..sum.clone() };
        let ways = [(&sum, &sum), (&inwards, &sum), (&along, &along)];
        let ways = match place.spot {
            Spot::Wall if is_round(&parts[place.effect]) => &ways[..],
            Spot::Wall => &ways[..2],
            _ => &ways[..1],
        };
        let shaking = ways.iter().find_map(|(way, sum)| Some((self.shakes(holds, way, speed)?, *sum)));
        let Some((hold, sum)) = shaking.map(|(hold, sum)| (hold, sum.clone())) else {
            return self.ringing(&holds.usual[0], place, &parts, &sum);
        };
        let stable = |scene: Scene| self.shakes(holds, &scene, speed).is_none();
        let small_swings_are_stable = |scene: &Scene| self.small(holds, scene) == HOLDS.len();
        let without = Scene { stiffness: Mat3::ZERO, ..inwards };
        if !stable(without.clone()) {
            if is_quick {
                // Seen in the faster swings, if at all.
                return None;
            }
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
            let border = Scene { damping: without.damping * (left * BEYOND), ..without };
            let limited = small_swings_are_stable(&border);
            return Some(Finding { effect, place: *place, axis, hold, limited, away: false, why });
        }
        // The axis about which the delay takes more damping away than the scene has, or the
        // stiffest one, if this is one about which the sphere is free: too much damping shakes too.
        let late = largest_axis(&(sum.stiffness * self.sampled.lateness() - sum.damping));
        let stiff = largest_axis(&sum.stiffness);
        let is_free = late.1.dot(sum.stiffness * late.1) < 1.0e-3 * stiff.1.dot(sum.stiffness * stiff.1);
        let (axis, about) = if is_free { stiff } else { late };
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
        let border = Scene { stiffness: sum.stiffness * (left * BEYOND), ..sum };
        let limited = small_swings_are_stable(&border);
        Some(Finding { effect, place: *place, axis, hold, limited, away: false, why })
    }
}

/// Returns whether an effect holds the sphere about two axes alike, as a narrow cone does.
fn is_round(part: &Linear) -> bool {
    let mut sizes = principal(&part.stiffness).0.to_array();
    sizes.sort_by(f64::total_cmp);
    sizes[1] > ROUND * sizes[2]
}

/// Returns whether two scenes with the same masses differ only by rounding.
fn near(one: &Scene, other: &Scene) -> bool {
    let off = |a: &Mat3, b: &Mat3| (0..3).map(|k| (a.col(k) - b.col(k)).length()).fold(0.0, f64::max);
    off(&one.stiffness, &other.stiffness) < 1.0e-9 && off(&one.damping, &other.damping) < 1.0e-9
}

/// Returns `scene` with its stiffness times `margin`, and with its damping times it as well.
fn times(scene: &Scene, margin: f64) -> [Scene; 2] {
    let stiffer = Scene { stiffness: scene.stiffness * margin, ..scene.clone() };
    [Scene { damping: scene.damping * margin, ..stiffer.clone() }, stiffer]
}

/// Returns the axis about which a symmetric matrix is largest, or `None` if it may be any axis; and
/// an axis that serves for both.
pub(super) fn largest_axis(matrix: &Mat3) -> (Option<Vec3>, Vec3) {
    let (sizes, axes) = principal(matrix);
    let axis = axes.col(sizes.max_position());
    // The sign of an axis means nothing.
    let axis = axis * axis.to_array().into_iter().find(|x| x.abs() > 1.0e-6).map_or(1.0, f64::signum);
    ((sizes.min_element() < 0.95 * sizes.max_element()).then_some(axis), axis)
}

/// Returns the stiffness of an effect, scaled so that it is 1 about the axis `about`. A damping
/// that is added to the effect has this shape.
pub(super) fn shape(part: &Linear, about: Vec3) -> Option<Mat3> {
    let size = about.dot(part.stiffness * about);
    (size > 0.0).then(|| part.stiffness * (1.0 / size))
}

/// Returns the part for which `about` is largest, with its index.
pub(super) fn largest(parts: &[Linear], about: impl Fn(&Linear) -> f64) -> Option<(usize, &Linear)> {
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
pub(super) fn least_damping(stable: impl Fn(f64) -> bool) -> Option<f64> {
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
