//! Motions that last although the loop is stable: swings that decay slowly, a sphere that walls
//! throw back and forth, and one that gains speed as it turns.

use std::f64::consts::PI;

use hbot_core::render::around::{Linear, Place, Spot};
use hbot_core::{CompiledScene, Mat3, Quat, Vec3, rotation};

use super::finding::{Finding, Why};
use super::held::Held;
use super::inertia::principal;
use super::judge::{Judge, QUICK_PACES, SLOWEST, SOFT, largest, largest_axis, least_damping, shape};
use super::places::{ENOUGH, pull};
use super::sampled::{HOLDS, Sampled, Scene};

/// A swing of a free sphere that decays more slowly than this rings for long, 1/s. What the count
/// of the loop's zeros lets pass, 0.05/s, leaves 0.28/s: a swing falls to less than half in 3 s,
/// with a margin of a tenth.
const DECAY: f64 = 0.33;
/// Speed that a tap gives to the sphere, rad/s.
const TAP: f64 = 0.6;
/// Part of its energy that a sphere has to lose in a bounce off a wall. With less, two bounces
/// leave it more than half.
const BOUNCE: f64 = 0.3;
/// Turn away from a wall at which nothing holds a sphere that flies off, rad.
const BESIDE: f64 = 0.03;
/// Damping of a sphere that flies between walls, over its inertia, 1/s. It takes a quarter of the
/// speed in 3 s.
const FLIES: f64 = 0.1;
/// Damping that counts as none, N m s/rad.
const LITTLE: f64 = 1.0e-6;
/// Speed of a sphere that keeps turning, below which it is not felt as gaining speed, rad/s.
const TURNING: f64 = 0.5;
/// Energy that a turning sphere gains in 10 s, below which nobody notices it, J.
const GAIN: f64 = 1.0e-3;
/// Number of places at which the scene is evaluated around a turn.
const AROUND: u32 = 720;

impl Judge {
    /// Returns what a free sphere misses of the damping with which it comes to rest soon in
    /// `scene`, as far as it is stiff, N m s/rad.
    pub(super) fn missing(&self, scene: &Scene) -> Mat3 {
        let Sampled { axes, inertia, .. } = &self.sampled;
        let (stiffness, about) = principal(&scene.stiffness);
        let stiffness = stiffness.max(Vec3::ZERO);
        // The part of each direction that is stiff. What is too soft to swing needs no damping.
        let part = (stiffness / (stiffness + SOFT)).to_array().map(f64::sqrt);
        let part = about * Mat3::from_diagonal(Vec3::from_array(part)) * about.transpose();
        let inertia = *axes * Mat3::from_diagonal(*inertia) * axes.transpose();
        part * inertia * part * (2.0 * DECAY)
    }

    /// Returns whether a free sphere swings for long in `scene` after a tap.
    pub(super) fn rings(&self, free: &Held<'_>, scene: &Scene) -> bool {
        let damping = scene.damping - self.missing(scene);
        // The inertia depends on the posture, so a swing may have any direction. In none may the
        // delay take away all of its damping: K t to first order.
        let left = scene.damping - scene.stiffness * self.late() + Mat3::IDENTITY * LITTLE;
        let (least, axes) = principal(&left);
        let swings = |k: usize| axes.col(k).dot(scene.stiffness * axes.col(k)) > SOFT;
        scene.masses.is_empty() && (0..3).any(|k| least[k] < 0.0 && swings(k))
            || !free.is_stable(&Scene { damping, ..scene.clone() }, None)
    }

    /// Returns the time by which the scene's torque is late, less the lead, s.
    pub(super) fn late(&self) -> f64 {
        (self.sampled.lateness() - self.sampled.lead).max(0.0)
    }

    /// Returns the entry of a scene `sum` of the effects `parts` whose swing lasts for long.
    pub(super) fn ringing(
        &self,
        free: &Held<'_>,
        place: &Place,
        parts: &[Linear],
        sum: &Scene,
    ) -> Option<Finding> {
        // At the edge of a wall a free sphere does not swing: it leaves.
        if place.deeper != Vec3::ZERO || !self.rings(free, sum) {
            return None;
        }
        let late = sum.stiffness * self.late();
        let (axis, about) = largest_axis(&(self.missing(sum) + late - sum.damping));
        let (effect, part) = largest(parts, |part| about.dot(part.stiffness * about))?;
        // Damping as the effect damps. If that does not help, then damping about all axes.
        let added = shape(part, about).into_iter().chain([Mat3::IDENTITY]).find_map(|shape| {
            let more = |b: f64| Scene { damping: sum.damping + shape * b, ..sum.clone() };
            least_damping(|b| !self.rings(free, &more(b)))
        })?;
        let [hold, ..] = HOLDS;
        Some(Finding {
            effect,
            place: *place,
            axis,
            hold,
            limited: false,
            away: false,
            why: Why::Rings { added },
        })
    }

    /// Returns the entry of a wall that throws a free sphere back and forth.
    ///
    /// A swing around the edge feels the stiffness k and the damping b. In its half inside the wall
    /// it loses 2 pi (b - k t)/(J w) of its energy, with the time t by which the torque is late and
    /// the wall's pace w = sqrt(2 k/J).
    pub(super) fn bouncing(&self, scene: &CompiledScene, place: &Place) -> Option<Finding> {
        let Sampled { axes, inertia, .. } = &self.sampled;
        let enough = ENOUGH * self.torque;
        if place.spot != Spot::Wall || pull(scene, place).length() > enough {
            return None;
        }
        let about = place.deeper;
        let size = |m: &Mat3| about.dot(*m * about);
        let inertia = size(&(*axes * Mat3::from_diagonal(*inertia) * axes.transpose()));
        // A swing around the edge feels half of the wall, so inside it is faster.
        let edge = size(&self.around(scene, place, TAP).0[place.effect].stiffness);
        let pace = (2.0 * edge.max(0.0) / inertia).sqrt().max(SLOWEST);
        let (parts, sum) = self.around_at(scene, place, TAP, pace, 0, &mut { QUICK_PACES });
        let wall = &parts[place.effect];
        let (k, b) = (size(&wall.stiffness), size(&wall.damping));
        // Nothing else holds the sphere or slows it down on its way.
        let others = [size(&sum.stiffness) - k, (size(&sum.damping) - b) / inertia];
        if k < SOFT || others[0].abs() > SOFT || others[1] > FLIES || !sum.masses.is_empty() {
            return None;
        }
        let late = k * self.late();
        let energy = inertia * pace / (2.0 * PI);
        let away = |turn: f64| {
            let there = place.rest_at(rotation::exp(about * -turn) * place.q);
            pull(scene, &there).dot(about)
        };
        let comes_back = (1..=18).any(|step| away(0.1 * f64::from(step)) > enough);
        let flies = away(BESIDE).abs() < enough;
        let bounces = b - late < BOUNCE * energy && flies && comes_back;
        let why = Why::Bounces { times: (BOUNCE * energy + late) / b.max(1.0e-9) };
        let [hold, ..] = HOLDS;
        bounces.then_some(Finding {
            effect: place.effect,
            place: *place,
            axis: Some(about),
            hold,
            limited: false,
            away: false,
            why,
        })
    }

    /// Returns an entry if a sphere that keeps turning gains speed.
    ///
    /// A torque that depends on the angle is rendered late by t. At the speed w it then gives out
    /// the mean power 2 t <T²>/J, with the mean square <T²> of the torque less its mean and the
    /// inertia J: the sphere is faster where the torque has pushed it, and there the torque is
    /// late. Damping takes B w² (docs/internals/borders.md).
    pub(super) fn turning(&self, scene: &CompiledScene, places: &[(Place, bool)]) -> Option<Finding> {
        let inertia = self.sampled.inertia.element_sum() / 3.0;
        let late = self.late();
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
                    worst = Some((
                        power,
                        Finding { effect, place, axis, hold, limited: false, away: false, why },
                    ));
                }
            }
        }
        worst.map(|(_, finding)| finding)
    }
}
