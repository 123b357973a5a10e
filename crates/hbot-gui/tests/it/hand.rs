//! Tests of the hand of the simulated rig, which the mouse and the arrow keys move.

use eframe::egui::{
    Event, Key, Modifiers, MouseWheelSource, MouseWheelUnit, PointerButton, Pos2, TouchPhase, Vec2, vec2,
};
use egui_kittest::kittest::Queryable as _;
use glam::{DQuat, DVec3};
use hbot_api::{Mode, StateEvent};

use crate::bench::{AloneServer, Seat, Witness, painted};
use crate::controls::seated;

/// A spring, and a hand that holds still until somebody moves it.
const SPRING: &str = r#"
name = "Spring"
[[effect]]
id = "spring"
kind = "spring"
stiffness = 1
damping = 0.02
[simulate]
hand = { amplitude = 0 }
"#;

fn button(seat: &mut Seat, pos: Pos2, pressed: bool, modifiers: Modifiers) {
    seat.harness.event(Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers });
    seat.frame();
}

/// Moves the pointer in steps, as a person does, and leaves the button down.
fn drag(seat: &mut Seat, from: Pos2, by: Vec2, modifiers: Modifiers) {
    seat.harness.event(Event::PointerMoved(from));
    seat.frame();
    button(seat, from, true, modifiers);
    for k in 1..=10 {
        seat.harness.event(Event::PointerMoved(from + by * (k as f32 / 10.0)));
        seat.frame();
    }
}

fn sphere(seat: &Seat) -> (Pos2, f32) {
    let rect = seat.harness.get_by_label_contains("Sphere: orientation").rect();
    let room = rect.with_max_y(rect.bottom() - 50.0);
    (room.center(), room.width().min(room.height()) / 3.0)
}

fn turned(state: &StateEvent) -> DVec3 {
    let [w, x, y, z] = state.q;
    DQuat::from_xyzw(x, y, z, w).to_scaled_axis()
}

fn rested(witness: &mut Witness) -> StateEvent {
    witness.later(2.0)
}

#[test]
fn a_dragged_sphere_feels_the_spring() {
    let bench = AloneServer::with_scene(SPRING);
    let (mut seat, mut witness) = seated(&bench);
    let (middle, radius) = sphere(&seat);
    let before = turned(&rested(&mut witness));
    drag(&mut seat, middle, vec2(0.4 * radius, 0.0), Modifiers::NONE);
    seat.until("the sphere turns", |_| turned(&witness.later(0.2)).length() > 0.2);
    let state = rested(&mut witness);
    // A drag to the right turns the sphere about the vertical axis of the view, here nearly n3. The
    // hand of 3 N m/rad yields to the spring of 1 N m/rad: 3/4 of 0.4 rad.
    let angle = turned(&state) - before;
    assert!((angle.length() - 0.3).abs() < 0.01, "{angle} rad");
    assert!(angle.z > 0.28, "{angle} rad");
    let torque = DVec3::from(state.torque);
    let felt = DVec3::from(state.hand.expect("a hand holds the sphere"));
    assert!((torque.length() / turned(&state).length() - 1.0).abs() < 0.02, "{torque} N m at {angle} rad");
    assert!((torque + felt).length() < 0.02 * felt.length(), "at rest: {torque} and {felt} N m");
    seat.until_text("ACTIVE");
    // 0.3 N m at the radius of 0.102 m. The point that the hand holds is in the plane of the turn.
    // On a busy machine the window shows it later than the witness reads it.
    seat.until("a force of 2.0 to 3.2 N", |harness| {
        let said = painted(harness);
        let force = said.iter().find_map(|text| text.strip_prefix("the scene pushes your hand: "));
        let force: f64 = force.and_then(|rest| rest.split(' ').next()?.parse().ok()).expect("a force in N");
        (2.0..3.2).contains(&force)
    });

    button(&mut seat, middle + vec2(0.4 * radius, 0.0), false, Modifiers::NONE);
    witness.state("the hand has let go", |state| state.hand.is_none());
    let free = witness.state("the spring pulls it back", |state| turned(state).length() < 0.05);
    assert_eq!(free.mode, Mode::Active);
}

#[test]
fn with_shift_or_beside_the_sphere_a_drag_turns_the_view_alone() {
    let bench = AloneServer::with_scene(SPRING);
    let (mut seat, mut witness) = seated(&bench);
    let (middle, radius) = sphere(&seat);
    for (from, modifiers) in [(middle, Modifiers::SHIFT), (middle + vec2(1.3 * radius, 0.0), Modifiers::NONE)]
    {
        seat.harness.event(Event::ModifiersChanged(modifiers));
        drag(&mut seat, from, vec2(0.3 * radius, 0.0), modifiers);
        button(&mut seat, from + vec2(0.3 * radius, 0.0), false, modifiers);
        seat.harness.event(Event::ModifiersChanged(Modifiers::NONE));
        let state = rested(&mut witness);
        assert!(turned(&state).length() < 0.01, "{modifiers:?}: {:?}", state.q);
    }
}

#[test]
fn the_wheel_twists_the_held_sphere_and_arrow_keys_turn_it() {
    let bench = AloneServer::with_scene(SPRING);
    let (mut seat, mut witness) = seated(&bench);
    let (middle, _) = sphere(&seat);
    drag(&mut seat, middle, Vec2::ZERO, Modifiers::NONE);
    let delta = vec2(0.0, 100.0);
    seat.harness.event(Event::MouseWheel {
        unit: MouseWheelUnit::Point,
        delta,
        modifiers: Modifiers::NONE,
        phase: TouchPhase::Move,
        source: MouseWheelSource::Unknown,
    });
    seat.until("the sphere twists", |_| turned(&witness.later(0.2)).length() > 0.1);
    // The view is nearly along n2 from the side of -n2, so the twist is about -n2.
    let twist = turned(&rested(&mut witness));
    assert!(twist.y < -0.9 * twist.length(), "{twist}");
    button(&mut seat, middle, false, Modifiers::NONE);
    witness.state("back", |state| turned(state).length() < 0.02);

    seat.harness.get_by_label_contains("Sphere: orientation").focus();
    // In the second frame the picture keeps the arrow keys for itself.
    seat.frame();
    seat.frame();
    seat.frame();
    seat.harness.key_down(Key::ArrowRight);
    seat.until("the keys turn it", |_| turned(&witness.later(0.05)).z > 0.1);
    seat.harness.key_up(Key::ArrowRight);
    seat.frame();
    seat.frame();
    witness.state("the hand has let go", |state| state.hand.is_none());
}

#[test]
fn who_does_not_command_turns_the_view_alone() {
    let bench = AloneServer::with_scene(SPRING);
    let (mut seat, mut witness) = seated(&bench);
    let (middle, radius) = sphere(&seat);
    drag(&mut seat, middle, vec2(0.3 * radius, 0.0), Modifiers::NONE);
    witness.state("held", |state| turned(state).length() > 0.1);
    // Another client takes over while the sphere is held. The hand is that of the scene again.
    let mut other = bench.client("anna@lab2");
    other.acquire(true).expect("stolen");
    seat.until_text("you observe, anna@lab2 commands");
    let (at, more) = (middle + vec2(0.3 * radius, 0.0), vec2(0.4 * radius, 0.0));
    drag(&mut seat, at, more, Modifiers::NONE);
    let before = rested(&mut witness);
    let after = rested(&mut witness);
    assert!((turned(&after) - turned(&before)).length() < 0.01, "{before:?} {after:?}");
    assert!(seat.painted().iter().all(|text| !text.contains("pushes your hand")));
}
