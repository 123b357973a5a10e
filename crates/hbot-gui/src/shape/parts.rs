//! The shape of each part of an effect's outline. The law of the effect tells its outline and its
//! torque ([`hbot_core::render::outline`]).

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DQuat, DVec3};
use hbot_config::scene::SceneEffect;
use hbot_core::render::outline::{Angles, Outline};

use super::dial::{Ring, off};
use super::round::{About, LIFT, between};
use super::{Pen, Role};

/// Angular radii of the rings of notches, of the stops of a twist, of a twist that is held and of
/// clicks, rad. They differ, so that effects about one axis do not cover each other.
const RINGS: [f64; 4] = [0.34, 0.46, 0.24, 0.16];
/// Length of the lines on the outer side of a wall, rad.
const HATCH: f64 = 0.05;
/// Number of these lines about a cone.
const HATCHES: u32 = 36;
/// Length of the arm that shows how a place that attracts is turned, rad.
const ARM: f64 = 0.13;
/// More notches than this would be one band.
const MOST_NOTCHES: u16 = 240;

pub(super) fn draw(pen: &mut Pen<'_>, effect: &SceneEffect) {
    let id = effect.id();
    let mut snaps = Vec::new();
    // The dashed frame shows the reference of a spring. Other effects without an outline act
    // everywhere alike.
    effect.kind().outline(effect.numbers(), &mut |part| match part {
        Outline::Cone { axis, angle } => cone(pen, axis, angle, id),
        Outline::Twist { axis, range } => twist(pen, axis, range, id),
        Outline::Notches { axis, angles, width, walls } => notches(pen, axis, angles, (width, walls), id),
        Outline::Clicks { axis, angles } => clicks(pen, axis, angles, id),
        Outline::Snap(turn) => snaps.push(pen.reference * turn),
        Outline::Well { width } => well(pen, width, id),
        Outline::Hinge { axis } => hinge(pen, axis, id),
        Outline::Untwisted { axis } => untwisted(pen, axis, id),
        Outline::Plane { normal, pointer } => plane(pen, normal, pointer, id),
        Outline::Weight(centre) => weight(pen, centre, id),
        Outline::Finger(at) => {
            pen.dot(Role::Place, at * LIFT, 0.0);
            pen.label(Role::Place, at * 1.14, id);
        }
    });
    orientations(pen, &snaps, id);
}

/// Returns the angles of notches, rad. Returns none if they are too close to be told apart.
fn shown(angles: Angles<'_>) -> Vec<f64> {
    match angles {
        Angles::Even(count) if count > MOST_NOTCHES => Vec::new(),
        Angles::Even(count) => (0..count).map(|k| TAU * f64::from(k) / f64::from(count)).collect(),
        Angles::At(angles) => angles.to_vec(),
    }
}

fn cone(pen: &mut Pen<'_>, axis: DVec3, cone: f64, id: &str) {
    let about = About::new(axis, pen.reference);
    let pointer = pen.q * axis;
    let depth = about.axis().angle_between(pointer) - cone;
    let glow = if depth > 0.0 { pen.glow() } else { 0.0 };
    pen.line(Role::Wall, about.circle(cone), 0.0);
    for k in 0..HATCHES {
        let angle = TAU * f64::from(k) / f64::from(HATCHES);
        let ends = vec![about.at(cone, angle), about.at(cone + HATCH, angle + HATCH / cone.sin().max(0.3))];
        pen.line(Role::Wall, ends, 0.0);
    }
    if glow > 0.0 {
        // The part of the wall about the place where the sphere meets it.
        let angle = about.angle_of(pointer);
        let half = 0.35 / cone.sin().max(0.35);
        pen.line(Role::Wall, about.arc(cone, [angle - half, angle + half]), glow);
        pen.line(Role::Wall, vec![about.at(cone, angle), about.at(cone + depth, angle)], glow);
    }
    pen.dot(Role::Pointer, pointer * LIFT, glow);
    pen.label(Role::Wall, about.at(cone + 0.16, -0.5 * PI), id);
}

fn twist(pen: &mut Pen<'_>, axis: DVec3, [low, high]: [f64; 2], id: &str) {
    let ring = Ring::new(pen, axis, RINGS[1]);
    ring.draw(pen, Role::Wall, id);
    // Without its whole turns, a twist says nothing about walls that are a turn or more apart.
    let known = high - low < TAU && low >= -PI && high <= PI;
    for (end, side) in [(low, -1.0), (high, 1.0)] {
        let is_met = known && side * (ring.psi - end) > 0.0;
        let glow = if is_met { pen.glow() } else { 0.0 };
        ring.wall(pen, end, side, glow);
        if glow > 0.0 {
            ring.part(pen, Role::Wall, [end, ring.psi], glow);
        }
    }
}

fn notches(pen: &mut Pen<'_>, axis: DVec3, angles: Angles<'_>, (width, walls): (f64, bool), id: &str) {
    let ring = Ring::new(pen, axis, RINGS[0]);
    ring.draw(pen, Role::Place, id);
    let notches = shown(angles);
    // Neighbours that are nearer than two widths meet half way.
    let nearest = notches.iter().map(|angle| off(ring.psi, *angle).abs()).fold(f64::INFINITY, f64::min);
    for angle in &notches {
        let far = off(ring.psi, *angle).abs();
        ring.notch(pen, *angle, far < width && far <= nearest);
    }
    if let ([first, .., last], true) = (notches.as_slice(), walls) {
        let known = *first >= -PI && *last <= PI;
        for (end, side) in [(*first, -1.0), (*last, 1.0)] {
            let is_met = known && side * (ring.psi - end) > 0.0;
            let glow = if is_met { pen.glow() } else { 0.0 };
            ring.wall(pen, end, side, glow);
        }
    }
}

fn clicks(pen: &mut Pen<'_>, axis: DVec3, angles: Angles<'_>, id: &str) {
    let ring = Ring::new(pen, axis, RINGS[3]);
    ring.draw(pen, Role::Place, id);
    let angles = shown(angles);
    let nearest = angles.iter().map(|angle| off(ring.psi, *angle).abs()).fold(f64::INFINITY, f64::min);
    for angle in &angles {
        ring.notch(pen, *angle, off(ring.psi, *angle).abs() <= nearest);
    }
}

/// Draws an orientation: the place of the sphere's third axis, with an arm towards its first.
fn place(pen: &mut Pen<'_>, orientation: DQuat, glow: f64) {
    let at = orientation * DVec3::Z;
    let arm = orientation * DQuat::from_rotation_y(ARM) * DVec3::Z;
    pen.dot(Role::Place, at * LIFT, glow);
    pen.line(Role::Place, between(at, arm), glow);
}

/// Draws orientations in frame N, of which the nearest attracts the sphere.
fn orientations(pen: &mut Pen<'_>, all: &[DQuat], id: &str) {
    let far = |orientation: &DQuat| orientation.angle_between(pen.q);
    let Some(nearest) = all.iter().copied().min_by(|a, b| far(a).total_cmp(&far(b))) else { return };
    for orientation in all {
        place(pen, *orientation, 0.0);
    }
    place(pen, nearest, pen.glow().max(0.3));
    pen.label(Role::Place, nearest * DVec3::Z * 1.16, id);
    pen.line(Role::Pointer, between(pen.q * DVec3::Z, pen.q * DQuat::from_rotation_y(ARM) * DVec3::Z), 0.0);
}

fn hinge(pen: &mut Pen<'_>, axis: DVec3, id: &str) {
    let about = About::new(axis, pen.reference);
    let own = pen.q * axis;
    let glow = pen.glow();
    for side in [1.0, -1.0] {
        let axis = side * about.axis();
        pen.line(Role::Guide, (0..=8).map(|k| axis * (1.0 + 0.04 * f64::from(k))).collect(), 0.0);
        pen.dot(Role::Pointer, side * own * LIFT, glow);
        if glow > 0.0 {
            pen.line(Role::Guide, between(axis, side * own), glow);
        }
    }
    pen.label(Role::Guide, about.axis() * 1.44, id);
}

fn untwisted(pen: &mut Pen<'_>, axis: DVec3, id: &str) {
    let ring = Ring::new(pen, axis, RINGS[2]);
    ring.draw(pen, Role::Guide, id);
    ring.notch(pen, 0.0, false);
    ring.part(pen, Role::Guide, [0.0, ring.psi], pen.glow());
}

fn plane(pen: &mut Pen<'_>, normal: DVec3, pointer: DVec3, id: &str) {
    let about = About::new(normal, pen.reference);
    let own = pen.q * pointer;
    let glow = pen.glow();
    pen.line(Role::Guide, about.circle(FRAC_PI_2), 0.0);
    pen.dot(Role::Pointer, own * LIFT, glow);
    if glow > 0.0 {
        let foot = about.at(FRAC_PI_2, about.angle_of(own)).normalize();
        pen.line(Role::Guide, between(foot, own), glow);
    }
    pen.label(Role::Guide, about.at(FRAC_PI_2, 0.0) * 1.14, id);
}

fn well(pen: &mut Pen<'_>, width: f64, id: &str) {
    let glow = pen.glow();
    let about = About::new(DVec3::Z, pen.reference);
    place(pen, pen.reference, glow);
    // The torque is largest on the inner circle, and little is left on the outer one.
    pen.line(Role::Place, about.circle(width), glow);
    pen.line(Role::Place, about.circle((3.0 * width).min(0.9 * PI)), 0.0);
    pen.label(Role::Place, about.at(width + 0.12, -0.5 * PI), id);
}

fn weight(pen: &mut Pen<'_>, centre: DVec3, id: &str) {
    let Some(direction) = (pen.q * centre).try_normalize() else { return };
    let glow = pen.glow();
    pen.line(Role::Pointer, (0..=8).map(|k| direction * 0.135 * f64::from(k)).collect(), glow);
    pen.dot(Role::Pointer, direction * 1.08, glow);
    pen.label(Role::Pointer, direction * 1.2, id);
}
