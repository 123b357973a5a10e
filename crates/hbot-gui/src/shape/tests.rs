//! Tests of the shapes, against the laws of the core.

use std::f64::consts::FRAC_PI_2;

use glam::{DQuat, DVec3};
use hbot_config::scene::{RunningScene, SHELF};
use hbot_config::{RigConfig, SceneFile};
use hbot_core::render::Renderer;
use serde_json::{Value, json};

use super::*;

/// The tolerance of positions: a product of a few rotations, each rounded.
const ROUNDED: f64 = 1e-12;

fn scene(effects: Value) -> SceneFile {
    SceneFile::from_json(json!({"name": "S", "effect": effects})).expect("legal")
}

fn drawn(scene: &SceneFile, q: DQuat) -> Vec<Piece> {
    let placing = Placing { q, rendering: true, began: Some(DQuat::IDENTITY), ..Placing::default() };
    let first = scene.effects().iter().find_map(|effect| effect.kind().reference());
    let placing = Placing { reference: first.map(|(reference, _)| reference), ..placing };
    let shapes = shapes(scene.effects(), &placing, 0.9);
    assert_eq!(shapes.unplaced, 0);
    shapes.pieces
}

fn lines(pieces: &[Piece], role: Role) -> Vec<&Vec<DVec3>> {
    let line = |piece: &'_ Piece| piece.role == role;
    pieces
        .iter()
        .filter(|piece| line(piece))
        .filter_map(|piece| match &piece.form {
            Form::Line(points) => Some(points),
            _ => None,
        })
        .collect()
}

#[test]
fn the_wall_of_a_cone_is_where_the_law_begins_to_push() {
    let axis = DVec3::new(1.0, 2.0, -0.5).normalize();
    let reference = DQuat::from_scaled_axis(DVec3::new(0.3, -0.2, 0.5));
    let stop = scene(json!([{"id": "w", "kind": "end_stop", "axis": axis.to_array(), "cone": 0.6,
        "reference": [reference.w, reference.x, reference.y, reference.z]}]));
    let pieces = drawn(&stop, reference);
    for point in lines(&pieces, Role::Wall)[0] {
        let angle = (reference * axis).angle_between(*point);
        // The arc cosine has the square root of the rounding of its argument.
        assert!((angle - 0.6).abs() < 1e-7 && (point.length() - 1.015).abs() < ROUNDED, "{point}");
    }
    let turned =
        |angle: f64| DQuat::from_axis_angle((reference * axis).any_orthonormal_vector(), angle) * reference;
    let glow = |angle| drawn(&stop, turned(angle)).iter().map(|piece| piece.glow).fold(0.0, f64::max);
    assert_eq!(glow(0.59), 0.0, "free inside");
    let light = glow(0.61);
    assert!(light > 0.0 && light < glow(0.7), "deeper glows more");
    // 3 N m/rad at 0.3 rad is the rig's 0.9 N m.
    assert!((glow(0.9) - 1.0).abs() < 1e-6, "{}", glow(0.9));
}

/// Walls, guides and notches glow exactly where the core's law has energy or a notch holds.
#[test]
fn what_glows_is_what_the_core_renders() {
    let effects = [
        json!({"id": "e", "kind": "end_stop", "walls": "both", "cone": 0.5, "twist": [-0.4, 0.7], "axis": [1, 1, 0]}),
        json!({"id": "e", "kind": "guide", "free": "axis", "axis": [0, 1, 1], "deadband": 0.1}),
        json!({"id": "e", "kind": "guide", "free": "swing", "axis": [0, 1, 1], "deadband": 0.2}),
        json!({"id": "e", "kind": "guide", "free": "plane", "axis": [0, 1, 1], "pointer": [1, 0, 0.2], "deadband": 0.2}),
    ];
    let rig = RigConfig::prototype();
    for effect in effects {
        let file = scene(json!([effect]));
        let compiled = RunningScene::new().load(file.clone());
        let mut renderer = Renderer::new(&rig.rig);
        let (mut met, mut free) = (0, 0);
        for k in 0..400 {
            // Turns of up to 1.2 rad about axes all around.
            let a = f64::from(k);
            let axis = DVec3::new((2.4 * a).sin(), (1.7 * a).cos(), (0.9 * a).sin()).normalize();
            let q = DQuat::from_axis_angle(axis, 0.003 * a);
            renderer.adopt(&compiled, DQuat::IDENTITY);
            // Rounding is far below the 1e-9 J of a turn of some microradians into a wall.
            let acts = renderer.energy(&compiled, q).expect("a gradient") > 1e-9;
            let glows = drawn(&file, q).iter().any(|piece| piece.glow > 0.0);
            assert_eq!(glows, acts, "{effect} at {q}");
            if acts { met += 1 } else { free += 1 }
        }
        assert!(met > 20 && free > 20, "{effect}: {met} and {free}");
    }
}

#[test]
fn the_mark_of_a_dial_is_on_the_notch_that_holds() {
    let axis = DVec3::new(0.0, 0.6, 0.8);
    let dial =
        scene(json!([{"id": "d", "kind": "detents", "count": 8, "width": 0.2, "axis": axis.to_array()}]));
    for k in -3..=4 {
        let angle = f64::from(k) * std::f64::consts::TAU / 8.0;
        let pieces = drawn(&dial, DQuat::from_axis_angle(axis, angle));
        let held: Vec<_> = pieces.iter().filter(|p| p.glow > 0.0).collect();
        assert_eq!(held.len(), 1, "one notch holds");
        let Form::Line(notch) = &held[0].form else { panic!("a line") };
        let pointer = lines(&pieces, Role::Pointer)[0].last().expect("points");
        let middle = 0.5 * (notch[0] + notch[1]);
        assert!(middle.normalize().dot(pointer.normalize()) > 1.0 - ROUNDED, "at {k}");
    }
    let between = drawn(&dial, DQuat::from_axis_angle(axis, 0.3));
    assert!(between.iter().all(|piece| piece.glow == 0.0), "no notch reaches there");
}

#[test]
fn snaps_are_drawn_at_all_orientations_of_their_set() {
    for (set, count) in [("tetrahedron", 12), ("cube", 24), ("icosahedron", 60)] {
        let snaps = scene(json!([{"id": "s", "kind": "snaps", "set": set}]));
        let pieces = drawn(&snaps, DQuat::from_rotation_x(0.1));
        // Each has an arm, and the nearest one another that glows.
        assert_eq!(lines(&pieces, Role::Place).len(), count + 1, "{set}");
        let glowing: Vec<_> = pieces.iter().filter(|piece| piece.glow > 0.0).collect();
        assert!(glowing.iter().any(|piece| match piece.form {
            Form::Dot(at) => at.dot(DVec3::Z) > 1.0,
            _ => false,
        }));
    }
}

#[test]
fn a_guide_in_a_plane_is_the_great_circle_of_its_pointer() {
    let plane = scene(json!([{"id": "g", "kind": "guide", "free": "plane", "axis": [0, 0, 1]}]));
    let pieces = drawn(&plane, DQuat::from_rotation_y(0.3));
    let circle = lines(&pieces, Role::Guide)[0];
    assert!(
        circle.iter().all(|p| p.z.abs() < ROUNDED && (p.angle_between(DVec3::Z) - FRAC_PI_2).abs() < 1e-7)
    );
}

/// If the reference and the sphere turn together, all shapes turn with them.
#[test]
fn shapes_turn_with_the_frame() {
    let turn = DQuat::from_scaled_axis(DVec3::new(0.7, -0.4, 1.1));
    for entry in SHELF {
        let file = entry.scene();
        let q = DQuat::from_scaled_axis(DVec3::new(0.2, 0.1, -0.15));
        for (k, effect) in file.effects().iter().enumerate() {
            let Some((reference, _)) = effect.kind().reference() else { continue };
            let alone = &file.effects()[k..=k];
            let at = |q, reference| Placing { q, reference: Some(reference), began: None, rendering: true };
            let before = shapes(alone, &at(q, reference), 0.9).pieces;
            let after = shapes(alone, &at(turn * q, turn * reference), 0.9).pieces;
            assert_eq!(before.len(), after.len(), "{}", entry.file);
            for (a, b) in before.iter().zip(&after) {
                let near = |a: DVec3, b: DVec3| (turn * a - b).length() < 1e-6;
                assert!(
                    match (&a.form, &b.form) {
                        (Form::Line(a), Form::Line(b)) => {
                            near(a[0], b[0]) && near(a[a.len() - 1], b[b.len() - 1])
                        }
                        (Form::Dot(a), Form::Dot(b)) | (Form::Label(a, _), Form::Label(b, _)) => near(*a, *b),
                        _ => false,
                    },
                    "{} of {}: {a:?}, {b:?}",
                    effect.id(),
                    entry.file
                );
            }
        }
    }
}

#[test]
fn an_effect_anchored_here_is_placed_by_the_first_reference() {
    let begin = DQuat::from_scaled_axis(DVec3::new(0.2, 0.5, -0.3));
    let own = DQuat::from_rotation_x(0.4);
    let file = scene(json!([
        {"id": "s", "kind": "spring", "anchor": "here", "reference": [own.w, own.x, own.y, own.z]},
        {"id": "w", "kind": "end_stop", "anchor": "here"},
        {"id": "a", "kind": "guide"}]));
    let placing = Placing { q: DQuat::IDENTITY, reference: Some(own * begin), began: None, rendering: true };
    let [spring, wall, guide] = placing.references(file.effects())[..] else { panic!("three") };
    assert!(spring.expect("known").angle_between(own * begin) < ROUNDED);
    assert!(wall.expect("known").angle_between(begin) < 1e-7);
    assert_eq!(guide, Some(DQuat::IDENTITY));
    // Nothing says where the sphere was if the first reference is absolute.
    let mixed =
        scene(json!([{"id": "a", "kind": "guide"}, {"id": "w", "kind": "end_stop", "anchor": "here"}]));
    let placing = Placing { reference: Some(DQuat::IDENTITY), ..placing };
    assert_eq!(placing.references(mixed.effects()), [Some(DQuat::IDENTITY), None]);
    assert_eq!(shapes(mixed.effects(), &placing, 0.9).unplaced, 1);
    let idle = Placing { q: begin, rendering: false, ..placing };
    assert_eq!(idle.references(mixed.effects())[1], Some(begin), "it would begin here");
}
