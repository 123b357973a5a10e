//! The shapes of each kind of effect. A kind without a place in space, such as a damper, has none.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DQuat, DVec3};
use hbot_config::scene::SceneEffect;
use hbot_core::effects::{Detents, EndStop, Freedom, Guide, Kind, Knocking, Magnet, Pendulum, Snaps};

use super::dial::{Ring, off};
use super::round::{About, LIFT, between};
use super::{Pen, Role};

/// Angular radii of the rings of a dial, of the stops of a twist, of a guide and of clicks, rad.
/// They differ, so that effects about one axis do not cover each other.
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
    match effect.kind() {
        Kind::EndStop(stop) | Kind::KnockingEndStop(Knocking { law: stop, .. }) => end_stop(pen, stop, id),
        Kind::Detents(dial) | Kind::KnockingDetents(Knocking { law: dial, .. }) => {
            detents(pen, dial, effect.numbers(), id)
        }
        Kind::Pulse(pulse) if pulse.count > 0 => {
            let ring = Ring::new(pen, pulse.axis, RINGS[3]);
            ring.draw(pen, Role::Place, id);
            let width = PI / f64::from(pulse.count);
            evenly(pulse.count).for_each(|angle| ring.notch(pen, angle, off(ring.psi, angle).abs() < width));
        }
        Kind::Snaps(snaps) | Kind::KnockingSnaps(Knocking { law: snaps, .. }) => {
            orientations(pen, snaps, effect.numbers(), id)
        }
        Kind::Guide(guide) => guide_shape(pen, guide, id),
        Kind::Magnet(magnet) => magnet_shape(pen, magnet, id),
        Kind::Pendulum(pendulum) => weight(pen, pendulum, id),
        Kind::Texture(texture) => {
            pen.dot(Role::Place, texture.at * LIFT, 0.0);
            pen.label(Role::Place, texture.at * 1.14, id);
        }
        // The dashed frame shows the reference of a spring. The others act everywhere alike.
        _ => {}
    }
}

/// Returns the angles of `count` evenly spaced notches, rad. Returns none if they are too close to
/// be told apart.
fn evenly(count: u16) -> impl Iterator<Item = f64> {
    let shown = if count <= MOST_NOTCHES { count } else { 0 };
    (0..shown).map(move |k| TAU * f64::from(k) / f64::from(count))
}

fn end_stop(pen: &mut Pen<'_>, stop: &EndStop, id: &str) {
    if let Some(cone) = stop.cone {
        let about = About::new(stop.axis, pen.reference);
        let pointer = pen.q * stop.axis;
        let depth = about.axis().angle_between(pointer) - cone;
        let glow = pen.glow(stop.stiffness * depth.max(0.0));
        pen.line(Role::Wall, about.circle(cone), 0.0);
        for k in 0..HATCHES {
            let angle = TAU * f64::from(k) / f64::from(HATCHES);
            let ends =
                vec![about.at(cone, angle), about.at(cone + HATCH, angle + HATCH / cone.sin().max(0.3))];
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
    if let Some([low, high]) = stop.twist {
        let ring = Ring::new(pen, stop.axis, RINGS[1]);
        ring.draw(pen, Role::Wall, id);
        // Without its whole turns, a twist says nothing about walls that are a turn or more apart.
        let known = high - low < TAU && low >= -PI && high <= PI;
        let depths = if known { [low - ring.psi, ring.psi - high] } else { [0.0; 2] };
        for (end, side, depth) in [(low, -1.0, depths[0]), (high, 1.0, depths[1])] {
            let glow = pen.glow(stop.stiffness * depth.max(0.0));
            ring.wall(pen, end, side, glow);
            if glow > 0.0 {
                ring.part(pen, Role::Wall, [end, ring.psi], glow);
            }
        }
    }
}

fn detents(pen: &mut Pen<'_>, dial: &Detents, positions: &[f64], id: &str) {
    let ring = Ring::new(pen, dial.axis, RINGS[0]);
    ring.draw(pen, Role::Place, id);
    let notches: Vec<f64> = if dial.count > 0 { evenly(dial.count).collect() } else { positions.to_vec() };
    // Neighbours that are nearer than two widths meet half way.
    let nearest = notches.iter().map(|angle| off(ring.psi, *angle).abs()).fold(f64::INFINITY, f64::min);
    for angle in &notches {
        let far = off(ring.psi, *angle).abs();
        ring.notch(pen, *angle, far < dial.width && far <= nearest);
    }
    if let ([first, .., last], true) = (notches.as_slice(), dial.end_stiffness > 0.0) {
        let known = *first >= -PI && *last <= PI;
        for (end, side) in [(*first, -1.0), (*last, 1.0)] {
            let depth = if known { side * (ring.psi - end) } else { 0.0 };
            let glow = pen.glow(dial.end_stiffness * depth.max(0.0));
            ring.wall(pen, end, side, glow);
        }
    }
}

/// Draws an orientation: the place of the sphere's third axis, with an arm towards its first.
fn place(pen: &mut Pen<'_>, orientation: DQuat, glow: f64) {
    let at = orientation * DVec3::Z;
    let arm = orientation * DQuat::from_rotation_y(ARM) * DVec3::Z;
    pen.dot(Role::Place, at * LIFT, glow);
    pen.line(Role::Place, between(at, arm), glow);
}

fn orientations(pen: &mut Pen<'_>, snaps: &Snaps, numbers: &[f64], id: &str) {
    let all: Vec<DQuat> = snaps
        .orientations(numbers)
        .iter()
        .map(|[w, x, y, z]| pen.reference * DQuat::from_xyzw(*x, *y, *z, *w))
        .collect();
    let far = |orientation: &DQuat| orientation.angle_between(pen.q);
    let nearest = all.iter().copied().min_by(|a, b| far(a).total_cmp(&far(b)));
    for orientation in &all {
        place(pen, *orientation, 0.0);
    }
    if let Some(nearest) = nearest {
        // Half the angle to the nearest orientation, as in the law (docs/effects.md).
        let s = 2.0 * (0.5 * nearest.angle_between(pen.q)).sin() / snaps.width;
        let torque = snaps.strength * s / (1.0 + s * s).sqrt();
        place(pen, nearest, pen.glow(torque).max(0.3));
        pen.label(Role::Place, nearest * DVec3::Z * 1.16, id);
    }
    pen.line(Role::Pointer, between(pen.q * DVec3::Z, pen.q * DQuat::from_rotation_y(ARM) * DVec3::Z), 0.0);
}

fn guide_shape(pen: &mut Pen<'_>, guide: &Guide, id: &str) {
    let about = About::new(guide.axis, pen.reference);
    let stiff = |angle: f64| guide.stiffness * (angle - guide.deadband).max(0.0);
    match guide.free {
        Freedom::Axis => {
            let own = pen.q * guide.axis;
            let glow = pen.glow(stiff(about.axis().angle_between(own)));
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
        Freedom::Swing => {
            let ring = Ring::new(pen, guide.axis, RINGS[2]);
            ring.draw(pen, Role::Guide, id);
            // The law holds this part of the turn, which is the twist if the axis has not swung.
            let x = pen.relative();
            let held = 2.0 * DVec3::new(x.x, x.y, x.z).dot(guide.axis).abs().min(1.0).asin();
            let glow = pen.glow(stiff(held));
            ring.notch(pen, 0.0, false);
            ring.part(pen, Role::Guide, [0.0, ring.psi], glow);
        }
        Freedom::Plane(pointer) => {
            let own = pen.q * pointer;
            let rise = own.dot(about.axis()).clamp(-1.0, 1.0).asin();
            let glow = pen.glow(stiff(rise.abs()));
            pen.line(Role::Guide, about.circle(FRAC_PI_2), 0.0);
            pen.dot(Role::Pointer, own * LIFT, glow);
            if glow > 0.0 {
                let foot = about.at(FRAC_PI_2, about.angle_of(own)).normalize();
                pen.line(Role::Guide, between(foot, own), glow);
            }
            pen.label(Role::Guide, about.at(FRAC_PI_2, 0.0) * 1.14, id);
        }
    }
}

fn magnet_shape(pen: &mut Pen<'_>, magnet: &Magnet, id: &str) {
    let chord = 2.0 * (0.5 * pen.reference.angle_between(pen.q)).sin();
    let nearness = (0.5 - 0.5 * (chord / magnet.width).powi(2)).exp();
    let glow = pen.glow(magnet.strength * nearness * chord / magnet.width);
    let about = About::new(DVec3::Z, pen.reference);
    place(pen, pen.reference, glow);
    // The torque is largest on the inner circle, and little is left on the outer one.
    pen.line(Role::Place, about.circle(magnet.width), glow);
    pen.line(Role::Place, about.circle((3.0 * magnet.width).min(0.9 * PI)), 0.0);
    pen.label(Role::Place, about.at(magnet.width + 0.12, -0.5 * PI), id);
}

fn weight(pen: &mut Pen<'_>, pendulum: &Pendulum, id: &str) {
    let Some(direction) = (pen.q * pendulum.centre).try_normalize() else { return };
    let torque = (pen.q * pendulum.centre).cross(pendulum.weight).length();
    let glow = pen.glow(torque);
    pen.line(Role::Pointer, (0..=8).map(|k| direction * 0.135 * f64::from(k)).collect(), glow);
    pen.dot(Role::Pointer, direction * 1.08, glow);
    pen.label(Role::Pointer, direction * 1.2, id);
}
