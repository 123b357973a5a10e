//! Tests of the whole window, drawn into memory from a model.

mod alarm;
mod reading;
mod status;

use std::path::Path;
use std::sync::Arc;
use std::time::SystemTime;

use eframe::egui::{Color32, Event, Key, Modifiers, PointerButton, Pos2, Rect, Rgba, Theme, Ui, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use hbot_api::{
    ControllerFlag, ControllerInfo, Fault, JointInfo, JointState, Mode, Requester, StateEvent, time_of_day,
};

use super::painted::{lines, rims, texts};
use super::theme::Palette;
use super::{Act, Desk, Tab, round_up, show, theme};
use crate::Folders;
use crate::model::tests::{
    ME, commanding, disconnect, grow_quiet, grow_silent, hear, held_by, see, see_state, stop_in_vain,
    stopped_by,
};
use crate::model::{Film, Judged, Model};
use crate::net::{Intent, Lease, News};
use crate::recorded::Recorded;

/// The sizes of the window in these tests, points.
const SIZES: [[f32; 2]; 2] = [[1280.0, 760.0], [1024.0, 600.0]];
/// The smallest window that the panel opens, points.
const SMALLEST: [f32; 2] = [900.0, 600.0];

/// What the user drags or clicks in the window, by name.
const CONTROLS: &str = "Stop, Enable, Disable, Reset, Recover, Law, Each axis, Stiffness, Stiffness value, \
    Damping, Damping value, Scene, Joints, Health, Record, Messages, Scene file, Load, \
    spring on, spring law, Pause, Export CSV, Light or dark, Release";

struct Window {
    model: Model,
    desk: Desk,
    acts: Vec<Act>,
}

type Seen = Harness<'static, Window>;

/// Draws a panel with this model in a window of this size.
fn window(size: [f32; 2], model: Model) -> Seen {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let folders = Folders { scenes, out: ".".into() };
    let desk = Desk::new(folders, "rig:4268", Judged::default());
    let window = Window { model, desk, acts: Vec::new() };
    let mut styled = false;
    let draw = move |ui: &mut Ui, window: &mut Window| {
        if !std::mem::replace(&mut styled, true) {
            theme::install(ui.ctx());
        }
        show(ui, &window.model, &mut window.desk, &mut window.acts);
    };
    let mut seen = Harness::builder().with_size(size).build_ui_state(draw, window);
    settle(&mut seen);
    seen
}

/// Draws so many frames that every part has found its size.
fn settle(seen: &mut Seen) {
    seen.run_steps(4);
}

fn shows(seen: &Seen, text: &str) -> bool {
    seen.query_all_by_label_contains(text).next().is_some()
}

/// Returns where everything is that the user drags or clicks.
fn places(seen: &Seen) -> Vec<(&'static str, Rect)> {
    let mut places: Vec<_> =
        CONTROLS.split(", ").map(|name| (name, seen.get_by_label(name).rect())).collect();
    let lease = ["Take command", "Take over"];
    let button = lease.into_iter().find_map(|name| seen.query_by_label(name)).expect("the lease's button");
    places.push(("the button for the lease", button.rect()));
    places
}

/// Changes a model in which this panel commands an active rig into one of another state.
type Change = Box<dyn Fn(&mut Model)>;

/// Returns the states of the panel: a name, and how it comes about.
fn states() -> Vec<(String, Change)> {
    let mut states: Vec<(String, Change)> = Vec::new();
    let mut add = |name: &str, change: Change| states.push((name.to_owned(), change));
    for mode in [Mode::Unreferenced, Mode::Idle, Mode::Enabling] {
        add(mode.as_str(), Box::new(move |model| see(model, 200, mode)));
    }
    for fault in Fault::ALL {
        add(fault.as_str(), Box::new(move |model| fault_of(model, fault)));
    }
    for (name, session) in [(ME, 4), ("panel ben@a-machine-with-a-long-name", 9)] {
        add(
            name,
            Box::new(move |model| {
                hear(model, News::Fault(stopped_by(name, Some(session))));
                see(model, 200, Mode::Estop);
            }),
        );
    }
    let observer = |model: &mut Model| {
        let lease = held_by("panel ben@a-machine-with-a-very-long-name-indeed", 9);
        hear(model, News::Lease { lease, cause: None });
    };
    add("observer", Box::new(observer));
    add("limited", Box::new(|model| limited(model, 0.36)));
    add("free", Box::new(|model| hear(model, News::Lease { lease: Lease::Free, cause: None })));
    add("limited much", Box::new(|model| limited(model, 0.001)));
    add("quiet", Box::new(grow_quiet));
    add("stop sent", Box::new(|model| model.asked(&Intent::Stop)));
    add("no contact", Box::new(grow_silent));
    add("not stopped", Box::new(stop_in_vain));
    add("silent and not stopped", Box::new(|model| (grow_silent(model), stop_in_vain(model)).0));
    add("disconnected", Box::new(disconnect));
    add("disconnected and not stopped", Box::new(|model| (disconnect(model), stop_in_vain(model)).0));
    states
}

/// Gives a model an active state in which the limits leave the part `scale` of the torque.
fn limited(model: &mut Model, scale: f64) {
    see_state(model, StateEvent { tick: 200, t: 0.2, mode: Mode::Active, scale, ..StateEvent::default() });
}

fn fault_of(model: &mut Model, fault: Fault) {
    let message = "some quantity is 12.3 of some unit, and the limit of the rig file is 4.5. ".repeat(4);
    let by = (fault == Fault::ClientLost).then(|| Requester { name: "test".to_owned(), session: Some(9) });
    let event =
        hbot_api::FaultEvent { mode: Mode::Fault, fault: Some(fault), message, by, ..stopped_by("", None) };
    hear(model, News::Fault(event));
    let state =
        StateEvent { tick: 200, t: 0.2, mode: Mode::Fault, fault: Some(fault), ..StateEvent::default() };
    see_state(model, state);
}

#[test]
fn nothing_that_is_dragged_or_clicked_moves_when_the_state_changes() {
    for size in SIZES {
        let mut seen = window(size, commanding(true));
        let before = places(&seen);
        let whole = Rect::from_min_size(Default::default(), size.into());
        for (name, place) in &before {
            assert!(whole.contains_rect(*place), "{name} is outside a window of {size:?}: {place:?}");
        }
        for simulated in [true, false] {
            for (name, change) in states() {
                seen.state_mut().model = commanding(simulated);
                change(&mut seen.state_mut().model);
                settle(&mut seen);
                for ((control, place), (_, was)) in places(&seen).into_iter().zip(&before) {
                    assert_eq!(place, *was, "{control}: {name}, simulated: {simulated}, {size:?}");
                }
            }
        }
    }
}

/// Gives a model four joints, whose motor controllers report long values.
fn report_joints(model: &mut Model) {
    let motor = JointInfo { peak: 0.93, continuous: 0.073 };
    model.info.rig.wheels.truncate(2);
    for wheel in &mut model.info.rig.wheels {
        (wheel.steer, wheel.drive) = (motor, motor);
    }
    let joints = vec![JointState { angle: -123.4, rate: -123.4, torque: -0.93 }; 4];
    see_state(model, StateEvent { tick: 200, t: 0.2, mode: Mode::Active, joints, ..StateEvent::default() });
    let controller = |joint| ControllerInfo {
        joint,
        firmware: Some("moteus 0x010f, register map 5".to_owned()),
        current_a: Some(-12.3456),
        temperature_c: Some(123.4),
        flags: ControllerFlag::ALL.map(|flag| flag.to_string()).to_vec(),
        ..ControllerInfo::default()
    };
    hear(model, News::Controllers((0..4).map(controller).collect()));
    hear(model, News::Stats(Box::default()));
}

#[test]
fn all_text_can_be_read_in_every_state_and_tab() {
    for size in [SIZES[0], SIZES[1], SMALLEST] {
        let mut seen = window(size, commanding(true));
        let is_whole = |seen: &Seen, name: &str| {
            for text in texts(seen) {
                // The name of another machine can have any length.
                let long = text.text.starts_with("ben@a-machine-with-a-very-long-name");
                assert!(text.is_whole() || long, "{name}, {size:?}: {text:?}");
            }
        };
        for (name, change) in states() {
            seen.state_mut().model = commanding(true);
            change(&mut seen.state_mut().model);
            settle(&mut seen);
            is_whole(&seen, &name);
        }
        seen.state_mut().model = commanding(true);
        report_joints(&mut seen.state_mut().model);
        for (tab, name) in Tab::ALL {
            seen.state_mut().desk.tab = tab;
            settle(&mut seen);
            is_whole(&seen, name);
        }
    }
}

/// Returns the contrast of two colours by WCAG 2.2, from 1 to 21.
fn contrast(a: Color32, b: Color32) -> f32 {
    let luminance = |color| {
        let color = Rgba::from(color);
        0.2126 * color.r() + 0.7152 * color.g() + 0.0722 * color.b() + 0.05
    };
    let [a, b] = [a, b].map(luminance);
    a.max(b) / a.min(b)
}

/// 3 is what WCAG 2.2 asks of the rim of a control (criterion 1.4.11).
#[test]
fn the_rims_of_controls_stand_out_from_the_ground() {
    // By the definition of WCAG.
    assert!((contrast(Color32::BLACK, Color32::WHITE) - 21.0).abs() < 1e-4);
    let mut seen = window(SIZES[0], commanding(true));
    for theme in [Theme::Dark, Theme::Light] {
        seen.ctx.set_theme(theme);
        settle(&mut seen);
        let ground = seen.ctx.style_of(theme).visuals.panel_fill;
        let rims = rims(&seen);
        for name in ["Disable", "Law", "Each axis", "Stiffness value", "Scene file", "Save scene as", "Pause"]
        {
            let place = seen.get_by_label(name).rect();
            // Half a point for rounding.
            let of = rims.iter().find(|(rect, _)| place.expand(0.5).contains_rect(*rect));
            let (_, rim) = of.unwrap_or_else(|| panic!("{name} has no rim"));
            let contrast = contrast(rim.color, ground);
            assert!(contrast >= 3.0, "{theme:?}, {name}: {contrast}");
        }
    }
}

/// Nothing moves while a value is typed.
#[test]
fn a_number_that_is_typed_moves_nothing_and_keeps_its_unit() {
    for size in SIZES {
        let mut seen = window(size, commanding(true));
        let before = (places(&seen), lines(&seen));
        for name in ["Stiffness value", "Damping value", "spring damping", "spring reference 1"] {
            seen.get_by_label(name).focus();
            settle(&mut seen);
            assert_eq!((places(&seen), lines(&seen)), before, "{name}, {size:?}");
        }
    }
}

/// Returns the event that the first button of the mouse goes down or up here.
fn primary(pos: Pos2, pressed: bool) -> Event {
    Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers: Modifiers::NONE }
}

/// The rig stops once, as the pointer goes down on STOP, also if it slides off before it goes up.
/// On a slow machine, a short press ends before the next frame.
#[test]
fn a_press_on_stop_stops_once_and_at_once() {
    for (slides, short) in [(false, false), (false, true), (true, false), (true, true)] {
        let mut seen = window(SIZES[0], commanding(true));
        let middle = seen.get_by_label("Stop").rect().center();
        let end = middle + if slides { vec2(0.0, 200.0) } else { vec2(0.0, 0.0) };
        seen.event(Event::PointerMoved(middle));
        seen.run_steps(2);
        let has_stopped = |seen: &Seen| matches!(seen.state().acts[..], [Act::Ask(Intent::Stop)]);
        // Events of `Harness::event` would come in a frame each.
        seen.input_mut().events.push(primary(middle, true));
        if short {
            seen.input_mut().events.push(primary(end, false));
        } else {
            seen.run_steps(2);
            assert!(has_stopped(&seen), "at once; slides: {slides}");
            seen.event(Event::PointerMoved(end));
            seen.event(primary(end, false));
        }
        seen.run_steps(3);
        assert!(has_stopped(&seen), "once; slides: {slides}, short: {short}");
    }
}

/// Otherwise the hand would hold the sphere until somebody took it again.
#[test]
fn a_hand_that_the_pointer_has_lost_lets_go() {
    let open = |window: &mut Window| {
        let recorded = Recorded { states: vec![Arc::default()], every: 1, ..Recorded::default() };
        window.desk.open(Film::new(Arc::new(recorded)));
    };
    let steal = |window: &mut Window| window.model.lease = held_by("panel ben@lab3", 9);
    // Who loses the connection or the lease has lost the hand, and there is nothing to ask for.
    type Loss = fn(&mut Window);
    let losses: [(&str, Loss, bool); 4] = [
        ("silence", |window| grow_silent(&mut window.model), true),
        ("a recording", open, true),
        ("the connection", |window| disconnect(&mut window.model), false),
        ("the lease", steal, false),
    ];
    for (what, lose, asks) in losses {
        let mut seen = window(SIZES[0], commanding(true));
        let middle = seen.get_by_label_contains("Sphere: orientation").rect().center();
        seen.event(Event::PointerMoved(middle));
        seen.event(primary(middle, true));
        seen.run_steps(3);
        let moves = std::mem::take(&mut seen.state_mut().acts);
        assert!(matches!(moves[..], [Act::Ask(Intent::Hand(Some(_))), ..]), "{moves:?}");
        lose(seen.state_mut());
        seen.run_steps(3);
        let acts = &seen.state().acts;
        let right = if asks { matches!(acts[..], [Act::Ask(Intent::Hand(None))]) } else { acts.is_empty() };
        assert!(right, "{what}: {acts:?}");
    }
}

/// A window that is zoomed beyond its least size is drawn before the zoom is limited.
#[test]
fn a_window_below_the_smallest_is_drawn() {
    let mut seen = window([640.0, 380.0], commanding(true));
    settle(&mut seen);
    seen.get_by_label("Stop");
}

#[test]
fn the_question_before_a_take_over_gives_enter_the_safe_answer() {
    let ask = || {
        let mut seen = window(SIZES[0], commanding(true));
        seen.state_mut().model.lease = held_by("panel ben@lab3", 9);
        settle(&mut seen);
        seen.get_by_label("Take over").click();
        settle(&mut seen);
        assert!(shows(&seen, "Take over from ben@lab3?") && shows(&seen, "Esc stops the rig"));
        seen
    };
    let is_open = |seen: &mut Seen| {
        settle(seen);
        shows(seen, "Take over from")
    };
    let mut seen = ask();
    seen.key_press(Key::Enter);
    assert!(!is_open(&mut seen) && seen.state().acts.is_empty(), "Enter cancels");
    // What Esc does to the rig is tested with the whole panel.
    let mut seen = ask();
    seen.key_press(Key::Escape);
    assert!(!is_open(&mut seen) && seen.state().acts.is_empty(), "Esc closes it");
    let mut seen = ask();
    see(&mut seen.state_mut().model, 200, Mode::Estop);
    assert!(!is_open(&mut seen), "nothing pushes any more");
    // The other answer can be given by keys too.
    let mut seen = ask();
    seen.key_press_modifiers(Modifiers::SHIFT, Key::Tab);
    settle(&mut seen);
    seen.key_press(Key::Enter);
    assert!(!is_open(&mut seen));
    assert!(matches!(seen.state().acts[..], [Act::Ask(Intent::Acquire { steal: true })]));
}

#[test]
fn messages_have_their_time() {
    let mut seen = window(SIZES[0], commanding(false));
    seen.state_mut().desk.tab = Tab::Messages;
    let now = || time_of_day(SystemTime::now());
    let before = now();
    for _ in 0..2 {
        hear(&mut seen.state_mut().model, News::Note(Ok("written".to_owned())));
    }
    let after = now();
    settle(&mut seen);
    let lines = lines(&seen);
    let line = lines.iter().find(|line| line.ends_with(" s ago, 2 times")).expect("its time");
    assert!(line.contains(&before) || line.contains(&after), "{line}, {before} to {after}");
    assert!(lines.iter().any(|line| line.contains("written")), "{lines:?}");
}

#[test]
fn good_news_do_not_hide_a_failure() {
    let mut seen = window(SIZES[0], commanding(true));
    for note in [Err("the disk is full"), Ok("written to new.toml")] {
        let note = note.map(str::to_owned).map_err(str::to_owned);
        hear(&mut seen.state_mut().model, News::Note(note));
    }
    settle(&mut seen);
    assert!(shows(&seen, "the disk is full") && !shows(&seen, "new.toml"), "{:?}", lines(&seen));
    // The third one is that of the connection.
    assert!(shows(&seen, "and 2 more"), "{:?}", lines(&seen));
}

#[test]
fn a_new_message_covers_neither_a_number_nor_the_sphere() {
    for size in [SIZES[0], SIZES[1], SMALLEST] {
        let mut seen = window(size, commanding(true));
        let message = "saved as /home/anna/scenes/a-scene-with-a-long-name.toml, which was there before";
        hear(&mut seen.state_mut().model, News::Note(Ok(message.to_owned())));
        settle(&mut seen);
        let is_number = |word: &str| word.parse::<f64>().is_ok();
        let texts = texts(&seen);
        let (toast, others): (Vec<_>, Vec<_>) = texts.into_iter().partition(|it| it.text == message);
        assert_eq!(toast.len(), 1);
        for other in others.iter().filter(|it| it.text.split(' ').any(is_number)) {
            assert!(!toast[0].overlaps(other), "{size:?}: {toast:?} and {other:?}");
        }
        let said = seen.get_by_label(message);
        assert!(!said.rect().intersects(seen.get_by_label_contains("Sphere: ").rect()), "{size:?}");
        said.click();
        settle(&mut seen);
        assert!(seen.state().desk.tab == Tab::Messages && shows(&seen, " s ago"));
    }
}

#[test]
fn simulated_or_live_is_said_in_every_state() {
    for (simulated, word) in [(true, "SIMULATED"), (false, "LIVE")] {
        let mut seen = window(SIZES[1], commanding(simulated));
        assert!(shows(&seen, word));
        for (name, change) in states() {
            seen.state_mut().model = commanding(simulated);
            change(&mut seen.state_mut().model);
            settle(&mut seen);
            let was = format!("was {word}");
            let lost = name.starts_with("disconnected");
            let said = [word, was.as_str()].map(|it| seen.query_by_label(it).is_some());
            assert_eq!(said, [!lost, lost], "{name}");
        }
    }
}

#[test]
fn a_silent_server_is_no_contact_and_nothing_can_be_set() {
    let mut seen = window(SIZES[0], commanding(false));
    for name in ["Stiffness", "Damping", "spring gain", "Load", "Release"] {
        let enabled = |seen: &Seen| !seen.get_by_label(name).accesskit_node().is_disabled();
        seen.state_mut().model = commanding(false);
        settle(&mut seen);
        assert!(enabled(&seen) || name == "Load", "{name}");
        grow_silent(&mut seen.state_mut().model);
        settle(&mut seen);
        assert!(!enabled(&seen), "{name}");
        assert!(shows(&seen, "NO CONTACT") && shows(&seen, " s ago: ACTIVE, 0.00 N m"));
        assert_eq!(seen.query_all_by_label_contains("ACTIVE").count(), 1, "only as the last mode");
    }
}

#[test]
fn the_controls_of_an_observer_are_grey_and_say_what_to_press() {
    let values = ["Stiffness", "Stiffness value", "Damping", "Each axis", "Law", "spring on", "spring gain"];
    let words = "Take over to change";
    for size in [SIZES[0], SIZES[1], SMALLEST] {
        let mut seen = window(size, commanding(true));
        let color = |seen: &Seen, text: &str| {
            texts(seen).into_iter().find(|it| it.text == text).expect("a painted text").color
        };
        let (law, warning) = ("geodesic", Palette::of_theme(true, Color32::GRAY).warn);
        let commanded = color(&seen, law);
        assert!(!shows(&seen, words));
        seen.state_mut().model.lease = held_by("panel ben@lab3", 9);
        settle(&mut seen);
        for name in values {
            assert!(seen.get_by_label(name).accesskit_node().is_disabled(), "{name}");
        }
        assert!(color(&seen, law).a() < commanded.a(), "grey");
        let said: Vec<_> = texts(&seen).into_iter().filter(|it| it.text == words).collect();
        assert_eq!(said.len(), 2, "beside the name of the slider and beside that of the scene");
        assert!(said.iter().all(|it| it.is_whole() && it.color == warning), "{said:?}");
        assert!(seen.query_by_label("Take over").is_some(), "the button that the words name");
        // Who changes something on a free rig gets the lease.
        for other in [Lease::Free, Lease::Mine] {
            seen.state_mut().model.lease = other;
            settle(&mut seen);
            assert!(!shows(&seen, words));
        }
        seen.state_mut().model.lease = held_by("panel ben@lab3", 9);
        grow_silent(&mut seen.state_mut().model);
        settle(&mut seen);
        assert!(!shows(&seen, words), "the button is grey while the server is silent");
    }
}

#[test]
fn who_only_watches_changes_nothing_before_take_command() {
    for size in [SIZES[0], SIZES[1], SMALLEST] {
        let mut seen = window(size, commanding(true));
        let names =
            ["Stiffness", "Stiffness value", "spring on", "spring gain", "Enable", "Reset", "Recover"];
        for (lease, commands) in [(Lease::Unknown, false), (Lease::Free, false), (Lease::Mine, true)] {
            for (tick, mode) in [(200, Mode::Idle), (201, Mode::Estop)] {
                let model = &mut seen.state_mut().model;
                (model.observes, model.lease) = (true, lease.clone());
                see(model, tick, mode);
                settle(&mut seen);
                for name in names {
                    let off = (name == "Enable" && mode == Mode::Estop)
                        || (["Reset", "Recover"].contains(&name) && mode == Mode::Idle);
                    let disabled = seen.get_by_label(name).accesskit_node().is_disabled();
                    assert_eq!(disabled, off || !commands, "{name}, {lease:?}, {mode}");
                }
                assert!(!seen.get_by_label("Stop").accesskit_node().is_disabled());
                assert!(!shows(&seen, "takes command"), "{lease:?}");
                let first = mode == Mode::Estop && !commands;
                assert_eq!(shows(&seen, "To go on, press Take command, then Recover."), first);
                let words = texts(&seen).into_iter().filter(|it| it.text == "Take command first");
                let words: Vec<_> = words.collect();
                assert_eq!(words.len(), if commands { 0 } else { 2 });
                assert!(words.iter().all(|it| it.is_whole()), "{size:?}");
            }
        }
    }
}

#[test]
fn the_focus_of_the_keyboard_has_a_ring() {
    let mut seen = window(SIZES[0], commanding(true));
    for theme in [Theme::Dark, Theme::Light] {
        seen.ctx.set_theme(theme);
        let visuals = seen.ctx.style_of(theme).visuals.clone();
        let accent = visuals.selection.stroke.color;
        assert!(contrast(accent, visuals.panel_fill) >= 3.0, "{theme:?}");
        for name in ["Stop", "Disable", "Stiffness value", "spring on", "Law", "Scene file"] {
            seen.get_by_label(name).focus();
            settle(&mut seen);
            let place = seen.get_by_label(name).rect().expand(1.0);
            let has_ring = rims(&seen)
                .iter()
                .any(|(rect, rim)| place.contains_rect(*rect) && rim.width == 2.0 && rim.color == accent);
            assert!(has_ring, "{theme:?}, {name}");
        }
    }
}

#[test]
fn without_a_connection_there_are_dashes_and_no_numbers() {
    let mut seen = window(SIZES[0], commanding(false));
    assert!(seen.query_by_label("Torque: 0.00 / 0.90 N m").is_some());
    disconnect(&mut seen.state_mut().model);
    settle(&mut seen);
    for name in ["Speed", "Traction", "Slip", "Saturation"] {
        assert!(seen.query_by_label(&format!("{name}: -")).is_some(), "{name}");
    }
    assert!(shows(&seen, "Recover is off: no connection"));
    assert!(!shows(&seen, "No reference"));
}

#[test]
fn scales_end_at_round_numbers() {
    for (x, end) in [(9.0, 10.0), (10.0, 10.0), (0.13, 0.2), (42.0, 50.0), (1.0, 1.0)] {
        assert!((round_up(x) - end).abs() < 1e-12 * end, "{x}: {}", round_up(x));
    }
}

#[test]
fn the_right_edges_of_a_column_are_in_line() {
    for size in [SIZES[0], SIZES[1], SMALLEST] {
        let mut seen = window(size, commanding(true));
        let are_in_line = |seen: &Seen, names: &[&str]| {
            // A heading can have the name of a button below it.
            let end = |name: &&str| seen.query_all_by_label(name).last().expect("a control").rect().right();
            let ends: Vec<_> = names.iter().map(end).collect();
            // A point is the rounding of places.
            assert!(ends.iter().all(|end| (end - ends[0]).abs() <= 1.0), "{size:?}, {names:?}: {ends:?}");
        };
        are_in_line(&seen, &["Stop", "Reset", "Stiffness value", "Damping value"]);
        are_in_line(&seen, &["Load", "Save"]);
        seen.state_mut().desk.tab = Tab::Recordings;
        settle(&mut seen);
        are_in_line(&seen, &["Start recording", "Open"]);
    }
}
