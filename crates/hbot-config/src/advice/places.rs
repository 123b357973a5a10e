//! Where a scene is judged: at the places of its laws, where the sphere rests and leans, and where
//! a tap takes it.

use hbot_core::render::around::{Place, Spot, Swing};
use hbot_core::{CompiledScene, Mat3, Quat, Vec3, rotation};

use super::inertia::principal;
use super::judge::{Judge, QUICK_PACES, SAME, SLOWEST, SOFT, SPEEDS};

/// Part of the largest torque below which a sphere rests.
pub(super) const ENOUGH: f64 = 1.0e-2;
/// A turn within which stiffness is looked for, rad.
const LITTLE: f64 = 1.0e-3;
/// Cosine of half of the angle to a rest that is near: 0.2 rad.
const NEAR: f64 = 0.995;
/// Stiffness (N m/rad) and damping (N m s/rad) that count as none.
const NOTHING: f64 = 1.0e-9;
/// Angle by which a tapped sphere turns about an axis that nothing holds, before it counts as at
/// rest, rad.
const AWAY: f64 = 1.8;
/// Number of places that are judged. A scene with more has many effects of one kind.
const MOST_PLACES: usize = 64;

impl Judge {
    /// Returns the places of the scene, each orientation once: walls also a little inside, and
    /// where the sphere rests if the effects pull it away from a place; and where it rests if it
    /// starts at the first place.
    pub(super) fn places(&self, scene: &CompiledScene) -> (Vec<(Place, bool)>, Option<Place>) {
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
        let mut here = None;
        let mut sought: Vec<(Quat, Option<Place>)> = Vec::new();
        let mut rest_from = |place: &Place| {
            let same = |(q, _): &&(Quat, Option<Place>)| q.dot(place.q).abs() > SAME;
            if let Some((_, rest)) = sought.iter().find(same) {
                return *rest;
            }
            let rest = self.rest(scene, place);
            sought.push((place.q, rest));
            rest
        };
        scene.places(Quat::IDENTITY, |place| {
            here = here.or(Some(place.rest_at(Quat::IDENTITY)));
            // What an effect without stiffness and damping does to the others is nothing.
            let acts = |(speed, pace): (f64, f64)| {
                let swing = Swing { axes: self.sampled.axes, turn: [speed / pace; 3], speed };
                let part = scene.around(place.effect, &place, Quat::IDENTITY, &swing);
                size(&part.stiffness).max(size(&part.damping)) > NOTHING
            };
            let swings = [SPEEDS[3], SPEEDS[0]].map(|speed| [(speed, QUICK_PACES.x), (speed, SLOWEST)]);
            if !swings.into_iter().flatten().any(acts) {
                return;
            }
            // Where more torque is wanted than the rig makes, the sphere does not stay.
            let rest = rest_from(&place);
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
        let here = here.map(|here| rest_from(&here).unwrap_or(here));
        let held = rests.into_iter().chain(here).filter(|rest| self.is_held(scene, rest));
        held.for_each(|rest| add(rest, false));
        (all, here)
    }

    /// Returns the places to which a sphere that rests at `here` turns after a tap about the axes
    /// that nothing holds. A law can be steeper there.
    pub(super) fn away(&self, scene: &CompiledScene, here: Option<Place>) -> Vec<Place> {
        let mut all = Vec::new();
        if let Some(here) = here.filter(|here| pull(scene, here).length() <= ENOUGH * self.torque) {
            let (sizes, axes) = principal(&self.around(scene, &here, SPEEDS[1]).1.stiffness);
            let free = (0..3).filter(|k| sizes[*k].abs() < SOFT).map(|k| axes.col(k));
            let turns = free.flat_map(|axis| [axis * AWAY, axis * -AWAY]);
            for turn in turns {
                let away = here.rest_at(rotation::exp(turn) * here.q);
                // Where the effects pull, it goes on to the rest that is near, if there is one.
                let rest = self.rest(scene, &away).unwrap_or(away);
                let is_near = rest.q.dot(away.q).abs() > NEAR;
                let rests = is_near && pull(scene, &rest).length() <= ENOUGH * self.torque;
                if rests && self.is_held(scene, &rest) {
                    all.push(rest);
                }
            }
        }
        all
    }

    /// Returns whether the stiffness at `place`, if there is one, acts in both directions. At the
    /// edge of a wall it acts in one: a free sphere leaves it. Walls are judged at their own
    /// places.
    fn is_held(&self, scene: &CompiledScene, place: &Place) -> bool {
        let (sizes, axes) = principal(&self.around(scene, place, SPEEDS[0]).1.stiffness);
        let axis = axes.col(sizes.max_position());
        let back = |turn: f64| {
            let there = place.rest_at(rotation::exp(axis * turn) * place.q);
            -pull(scene, &there).dot(axis) * turn.signum()
        };
        let [one, other] = [LITTLE, -LITTLE].map(back);
        one.abs().max(other.abs()) < NOTHING || one.min(other) > 0.2 * one.max(other)
    }

    /// Returns where the sphere comes to rest if it starts at `place`, or `None` if it rests there
    /// or finds no rest.
    #[must_use]
    pub fn rest(&self, scene: &CompiledScene, place: &Place) -> Option<Place> {
        let enough = ENOUGH * self.torque;
        let (mut at, mut torque) = (*place, pull(scene, place));
        if torque.length() <= enough {
            return None;
        }
        // Newton's steps by the stiffness there, as Levenberg and Marquardt shorten them: as long
        // as they lead downhill, so that the effects do work on the way. The torque may grow.
        let mut caution = 1.0e-3;
        // Dry friction is stiff in a swing and holds nothing back here: where a step takes less
        // than half of the torque away, the next one is longer.
        let (mut stiffness, mut stride) = (None, 1.0);
        for _ in 0..60 {
            let matrix = *stiffness.get_or_insert_with(|| self.around(scene, &at, SPEEDS[0]).1.stiffness);
            let (sizes, axes) = principal(&matrix);
            let size = sizes.abs() + caution * sizes.abs().max_element() + 1.0e-9;
            let step = axes * ((axes.transpose() * torque) / size);
            let step = (step * stride).clamp_length_max(0.5);
            let next = at.rest_at(rotation::exp(step) * at.q);
            let left = pull(scene, &next);
            if (torque + left).dot(step) > 0.0 {
                stride = if left.dot(step) > 0.5 * torque.dot(step) { 2.0 * stride } else { 1.0 };
                (at, torque, stiffness) = (next, left, None);
                caution = (0.2 * caution).max(1.0e-6);
            } else {
                (caution, stride) = (5.0 * caution.max(1.0e-2), 1.0);
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
}

/// Returns the largest length of a column.
fn size(m: &Mat3) -> f64 {
    (0..3).map(|k| m.col(k).length()).fold(0.0, f64::max)
}

/// Returns the torque of the whole scene on a sphere that rests at `place`, N m.
pub(super) fn pull(scene: &CompiledScene, place: &Place) -> Vec3 {
    (0..scene.effects().len()).map(|i| scene.pull(i, place, Quat::IDENTITY, place.q)).sum()
}
