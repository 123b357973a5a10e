//! Tests of what the window says about the state of the rig, and of what is grey if it may be
//! wrong.

use eframe::egui::{Color32, vec2};
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use hbot_api::{Fault, FaultEvent, InfoOk, Mode, ShakingEvent, StateEvent};
use serde_json::json;

use super::{Change, SIZES, SMALLEST, Seen, fault_of, limited, places, report_joints, settle, shows, window};
use crate::model::Model;
use crate::model::tests::{
    ME, commanding, disconnect, grow_quiet, grow_silent, hear, held_by, see, see_state, stop_in_vain,
    stopped_by, told,
};
use crate::net::{Intent, Lease, News};
use crate::view::painted::{filled, hint, lines, texts};
use crate::view::theme::{LIVE, Palette};
use crate::view::{Act, Tab};

#[test]
fn a_stop_that_failed_is_shown_above_all_else() {
    let mut seen = window(SIZES[1], commanding(false));
    assert!(shows(&seen, "ACTIVE"));
    for lost in [false, true] {
        seen.state_mut().model = commanding(false);
        if lost {
            disconnect(&mut seen.state_mut().model);
        }
        stop_in_vain(&mut seen.state_mut().model);
        settle(&mut seen);
        assert!(shows(&seen, "NOT STOPPED") && shows(&seen, "Cut the motors' power."));
        let way_out = ["Press STOP (or Esc) again.", "reports a mode without torque", "s since STOP"];
        for words in way_out {
            assert!(shows(&seen, words), "{words}, lost: {lost}");
        }
        assert!(!shows(&seen, "ACTIVE") && !shows(&seen, "NO CONTACT"));
        // The text takes the place of the bars in this low window.
        assert!(!shows(&seen, "0.00 / 0.90 N m"));
    }
}

#[test]
fn keys_that_go_to_another_window_are_not_advised() {
    for size in SIZES {
        let mut seen = window(size, commanding(true));
        stop_in_vain(&mut seen.state_mut().model);
        settle(&mut seen);
        assert!(shows(&seen, "Esc or Space, anywhere") && shows(&seen, "Press STOP (or Esc) again."));
        let before = places(&seen);
        seen.input_mut().focused = false;
        settle(&mut seen);
        assert!(shows(&seen, "Press STOP again.") && !shows(&seen, "or Esc)"));
        let words = "Esc and Space are off: click here";
        let texts = texts(&seen);
        let told = texts.iter().find(|it| it.text == words).expect("the warning");
        assert!(told.is_whole() && told.color != Palette::of_theme(true, Color32::GRAY).warn, "{told:?}");
        assert_eq!(places(&seen), before, "nothing moves");
    }
}

#[test]
fn a_torque_that_the_limits_cut_is_told() {
    let torque = Palette::of_theme(true, Color32::GRAY).torque;
    for (scale, bar, words) in [
        (0.36, "64 % cut", Some("Limits cut 64 % of the torque")),
        (0.001, "> 99 % cut", Some("Limits cut over 99 % of the torque")),
        (0.996, "0 % cut", None),
        (1.0, "none", None),
    ] {
        for size in SIZES {
            let mut seen = window(size, commanding(true));
            limited(&mut seen.state_mut().model, scale);
            settle(&mut seen);
            assert!(shows(&seen, bar), "{scale}");
            let told = texts(&seen).into_iter().find(|it| it.text.starts_with("Limits cut"));
            assert_eq!(told.as_ref().map(|it| it.text.as_str()), words);
            assert!(told.as_ref().is_none_or(|it| it.color == torque));
            // What to do about it takes the place of the usual sentence.
            assert_eq!(shows(&seen, "Lower the stiffness, or push less."), told.is_some(), "{scale}");
            assert_eq!(shows(&seen, Mode::Active.sentence()), told.is_none(), "{scale}");
            let is_cut = filled(&seen)
                .iter()
                .any(|(rect, color)| *color == torque && rect.height() == 10.0 && rect.width() > 0.0);
            assert_eq!(is_cut, scale < 1.0, "{scale}: the bar");
        }
    }
    let mut seen = window(SIZES[0], commanding(true));
    let most = seen.state().model.info.limits.torque;
    let pushes = StateEvent { tick: 200, t: 0.2, mode: Mode::Active, scale: 0.36, ..StateEvent::default() };
    for (torque, traction, words) in [
        (most, 0.4, "The torque limit cuts 64 %"),
        (most, 1.0, "Friction cuts 64 %"),
        (0.5 * most, 0.4, "Limits cut 64 %"),
    ] {
        see_state(
            &mut seen.state_mut().model,
            StateEvent { torque: [torque, 0.0, 0.0], traction, ..pushes.clone() },
        );
        settle(&mut seen);
        assert!(shows(&seen, &format!("{words} of the torque")), "{torque} N m, {traction} of friction");
    }
}

/// One instruction at a time: a scene that may shake the sphere comes first.
#[test]
fn that_nobody_commands_what_pushes_is_told() {
    for (model, told) in [(commanding(true), true), (warned(Mode::Active), false)] {
        let text = "Nobody commands. The sphere pushes on; STOP and Disable work.";
        let mut seen = window(SIZES[0], model);
        assert!(!shows(&seen, text));
        hear(&mut seen.state_mut().model, News::Lease { lease: Lease::Free, cause: None });
        settle(&mut seen);
        assert_eq!(shows(&seen, text), told);
    }
}

/// Checks that `Recover` leads on only after a stop by this user or by somebody whom the server
/// does not name. `other`, who else has stopped the rig, may have a hand in it.
fn goes_on(seen: &mut Seen, other: Option<&str>) {
    let recovers = other.is_none();
    let who = other.unwrap_or("ben@lab3");
    let way = "No torque. To go on, make sure that nobody touches the sphere, press Reset, then Enable.";
    assert_eq!(shows(seen, "To go on, press Recover."), recovers);
    assert_eq!(shows(seen, way), !recovers);
    assert_eq!(seen.get_by_label("Recover").accesskit_node().is_disabled(), !recovers);
    assert!(!seen.get_by_label("Reset").accesskit_node().is_disabled());
    seen.hover_at(Default::default());
    seen.run_steps(8);
    assert_eq!(shows(seen, &format!("Recover is off: stopped by {who}")), !recovers);
    let said = hint(seen, "Recover");
    assert_eq!(said == format!("Stopped by {who}: press Reset, then Enable"), !recovers, "{said}");
}

#[test]
fn who_stopped_the_rig_is_shown() {
    let mut seen = window(SIZES[1], commanding(true));
    // Another client may have any name.
    for (name, session, who) in
        [(ME, Some(4), "you"), ("panel ben@lab3", Some(9), "ben@lab3"), ("you", Some(9), "you")]
    {
        let model = &mut seen.state_mut().model;
        *model = commanding(true);
        hear(model, News::Fault(stopped_by(name, session)));
        see(model, 200, Mode::Estop);
        settle(&mut seen);
        assert!(shows(&seen, &format!("Stopped by {who}.")));
        goes_on(&mut seen, (name != ME).then_some(who));
    }
    // A panel that came after the stop learns it from `info`, if the server knows.
    for (incident, who) in [(None, "somebody"), (Some(stopped_by("panel ben@lab3", Some(9))), "ben@lab3")] {
        let model = &mut seen.state_mut().model;
        *model = commanding(true);
        let info = Box::new(InfoOk { incident, ..model.info.clone() });
        hear(model, News::Info(info));
        see(model, 200, Mode::Estop);
        settle(&mut seen);
        assert!(shows(&seen, &format!("Stopped by {who}.")), "{who}");
        goes_on(&mut seen, (who != "somebody").then_some(who));
    }
}

#[test]
fn a_stop_leaves_the_fault_before_it_in_sight() {
    for size in [SIZES[0], SIZES[1], SMALLEST] {
        let mut seen = window(size, commanding(true));
        let model = &mut seen.state_mut().model;
        fault_of(model, Fault::Overspeed);
        hear(model, News::Fault(stopped_by("panel ben@lab3", Some(9))));
        see(model, 201, Mode::Estop);
        settle(&mut seen);
        let stop = seen.get_by_label("Stopped by ben@lab3.").rect();
        let fault = seen.get_by_label_contains("Before the stop: overspeed.").rect();
        assert!(stop.bottom() <= fault.top() && shows(&seen, Fault::Overspeed.words().1), "{size:?}");
        see(&mut seen.state_mut().model, 202, Mode::Idle);
        settle(&mut seen);
        assert!(!shows(&seen, "Before the stop"), "after the reset");
        let model = &mut seen.state_mut().model;
        hear(model, News::Fault(FaultEvent { tick: 203, ..stopped_by("panel ben@lab3", Some(9)) }));
        see(model, 203, Mode::Estop);
        settle(&mut seen);
        assert!(shows(&seen, "Stopped by ben@lab3.") && !shows(&seen, "Before the stop"), "without a fault");
    }
}

#[test]
fn a_refusal_is_told_in_the_box_until_something_changes() {
    let said = "the cause is still there";
    let cases = [
        (Mode::Idle, Intent::Enable, "Not enabled: "),
        (Mode::Fault, Intent::Reset, "Not reset: "),
        (Mode::Estop, Intent::Recover, "Not recovered: "),
    ];
    for (mode, intent, what) in cases {
        for size in [SIZES[0], SMALLEST] {
            let refuse = |seen: &mut Seen| {
                let model = &mut seen.state_mut().model;
                *model = commanding(true);
                let fault = (mode == Mode::Fault).then_some(Fault::Overspeed);
                see_state(model, StateEvent { tick: 200, t: 0.2, mode, fault, ..StateEvent::default() });
                hear(model, News::Answer { intent: intent.clone(), result: Err(said.to_owned()) });
                settle(seen);
                let box_end = seen.get_by_label("Stiffness").rect();
                let told = seen.get_by_label(&format!("{what}{said}")).rect();
                assert!(told.bottom() < box_end.top() && told.right() < box_end.right() + 90.0, "{told:?}");
                assert_eq!(seen.query_all_by_label_contains(said).count(), 1, "at one place");
            };
            let mut seen = window(size, commanding(true));
            let changes: [fn(&mut Model); 4] = [
                |model| model.asked(&Intent::Reset),
                |model| {
                    model.asked(&Intent::Set {
                        effect: "spring".to_owned(),
                        key: "gain".to_owned(),
                        value: json!(1),
                    })
                },
                |model| see(model, 201, Mode::Enabling),
                disconnect,
            ];
            for (k, change) in changes.into_iter().enumerate() {
                refuse(&mut seen);
                change(&mut seen.state_mut().model);
                settle(&mut seen);
                assert!(!shows(&seen, said), "{mode}, change {k}");
            }
            refuse(&mut seen);
            // The distance from the reference may be another.
            let q = [0.1_f64.cos(), 0.1_f64.sin(), 0.0, 0.0];
            let fault = (mode == Mode::Fault).then_some(Fault::Overspeed);
            let state = StateEvent { tick: 201, t: 0.2, mode, fault, q, ..StateEvent::default() };
            see_state(&mut seen.state_mut().model, state);
            settle(&mut seen);
            assert_eq!(shows(&seen, said), mode != Mode::Idle, "{mode}: turned");
        }
    }
}

/// Returns the news that this effect shakes the sphere.
pub(super) fn shaking(effect: &str) -> ShakingEvent {
    let (message, effect) = ("it shakes".to_owned(), Some(effect.to_owned()));
    let (frequency, amplitude, gain) = (16.0, 1.5, 0.5);
    ShakingEvent { tick: 200, t: 0.2, shaking: true, frequency, amplitude, effect, gain, message }
}

/// Returns a state in which the sphere is at this angle from its reference, rad.
fn turned(tick: u64, mode: Mode, angle: f64) -> StateEvent {
    let q = [(0.5 * angle).cos(), (0.5 * angle).sin(), 0.0, 0.0];
    let (t, reference) = (tick as f64 / 1000.0, Some([1.0, 0.0, 0.0, 0.0]));
    StateEvent { tick, t, mode, q, reference, ..StateEvent::default() }
}

#[test]
fn an_effect_that_shakes_the_sphere_is_named_until_it_is_calm() {
    let mut seen = window(SIZES[1], commanding(true));
    let event = shaking("stiff");
    let news = |shaking| News::Shaking(ShakingEvent { shaking, ..event.clone() });
    // A panel that comes later learns it from `info`.
    let told = News::Info(Box::new(InfoOk { shaking: Some(event.clone()), ..told() }));
    for (news, shaking) in [(news(true), true), (news(false), false), (told, true)] {
        hear(&mut seen.state_mut().model, news);
        see(&mut seen.state_mut().model, 201, Mode::Active);
        settle(&mut seen);
        assert_eq!(shows(&seen, "stiff shook the sphere at 16 Hz"), shaking);
        assert_eq!(shows(&seen, "Lower the stiffness or raise the damping."), shaking, "no remedy is known");
    }
}

/// Returns the model of a rig whose server warns of a spring as stiff as this one without damping.
pub(super) fn warned(mode: Mode) -> Model {
    let mut model = commanding(true);
    let effect = json!({"id": "spring", "kind": "spring", "stiffness": 400.0, "damping": 0.0});
    let scene = json!({"name": "Stiff", "effect": [effect]});
    let InfoOk { mut rig, limits, render, .. } = told();
    rig.simulated = true;
    let info = InfoOk { rig, limits, render, scene, ..model.info.clone() };
    hear(&mut model, News::Info(Box::new(info)));
    see(&mut model, 200, mode);
    model
}

#[test]
fn a_warning_is_read_whole_beside_recover() {
    for mode in [Mode::Active, Mode::Idle, Mode::Estop, Mode::Fault] {
        for size in [SIZES[0], SIZES[1], SMALLEST] {
            let mut model = warned(mode);
            model.state.as_mut().expect("a state").fault = (mode == Mode::Fault).then_some(Fault::Overspeed);
            let seen = window(size, model);
            let told = texts(&seen).into_iter().find(|it| it.text.starts_with("Warning: spring: may shake"));
            assert!(told.is_some_and(|it| it.is_whole()), "{mode}, {size:?}");
        }
    }
}

/// The server knows what to do on this rig. An older one does not tell it.
#[test]
fn the_remedy_of_a_fault_is_that_of_the_server() {
    for fault in Fault::ALL {
        for remedy in [Some("Do this and that.".to_owned()), None] {
            let mut model = commanding(true);
            fault_of(&mut model, fault);
            model.fault.as_mut().expect("a fault").remedy.clone_from(&remedy);
            let seen = window(SIZES[0], model);
            assert_eq!(shows(&seen, "Do this and that."), remedy.is_some(), "{fault:?}");
            assert_eq!(shows(&seen, fault.words().1), remedy.is_none(), "{fault:?}: one remedy");
            assert!(shows(&seen, &format!("No torque. {}", fault.words().0)), "{fault:?}");
        }
    }
}

/// The speed of the message is that of the fault, and the box says how fast the sphere is now.
#[test]
fn one_speed_is_told_after_overspeed() {
    let mut model = commanding(true);
    model.info.limits.speed = 0.3;
    let fault = Some(Fault::Overspeed);
    let message = "the sphere turned at 0.300 rad/s; the limit is 0.3 (limits.speed)".to_owned();
    let found = Some("faster than 0.3 rad/s (limits.speed)".to_owned());
    let event = FaultEvent { mode: Mode::Fault, fault, message, found, ..stopped_by("", None) };
    hear(&mut model, News::Fault(event));
    let mode = Mode::Fault;
    for (tick, speed) in [(200, 0.5), (201, 0.4)] {
        let (t, omega) = (tick as f64 / 1000.0, [0.0, speed, 0.0]);
        see_state(&mut model, StateEvent { tick, t, mode, fault, omega, ..StateEvent::default() });
    }
    let mut seen = window(SIZES[0], model);
    for size in [SIZES[0], SMALLEST] {
        seen.set_size(size.into());
        settle(&mut seen);
        assert!(seen.query_by_label("Speed: 0.50 / 0.3 rad/s").is_some(), "{size:?}");
        assert!(texts(&seen).iter().any(|it| it.text == "speed 0.50 / 0.3 rad/s" && it.is_whole()));
        assert!(shows(&seen, "Reset: 0.50 rad/s") && !shows(&seen, "0.300") && !shows(&seen, "0.40"));
    }
}

#[test]
fn a_sphere_that_is_too_far_is_anchored_by_one_press() {
    let mut model = commanding(true);
    model.info.limits.enable_max_angle = 0.5;
    see_state(&mut model, turned(200, Mode::Estop, 0.8));
    let mut seen = window(SMALLEST, model);
    seen.get_by_label("0.80 rad from reference: set its anchor to here").click();
    settle(&mut seen);
    let acts = &seen.state().acts;
    let is_asked = |act: &Act| {
        matches!(act, Act::Ask(Intent::Set { effect, key, value })
        if effect == "spring" && key == "anchor" && value == "here")
    };
    assert!(acts.len() == 1 && is_asked(&acts[0]), "{acts:?}");
}

#[test]
fn the_button_that_takes_command_never_releases_it() {
    let mut seen = window(SMALLEST, commanding(true));
    let places = |seen: &Seen| {
        ["Take command", "Release"].map(|name| {
            let button = seen.get_by_label(name);
            (button.rect(), button.accesskit_node().is_disabled())
        })
    };
    let mine = places(&seen);
    seen.state_mut().model.lease = Lease::Free;
    settle(&mut seen);
    let free = places(&seen);
    assert_eq!([mine[0].1, mine[1].1, free[0].1, free[1].1], [true, false, false, true]);
    assert_eq!([mine[0].0, mine[1].0], [free[0].0, free[1].0]);
    let told = texts(&seen).into_iter().find(|it| it.text == "nobody commands: a change takes command");
    let warn = Palette::of_theme(true, Color32::GRAY).warn;
    assert!(told.is_some_and(|it| it.is_whole() && it.color == warn));
}

/// No distance stands there while it matters to no button.
#[test]
fn beside_a_grey_recover_stands_why() {
    let changes: [(Change, &str); 4] = [
        (Box::new(|_| {}), "ACTIVE"),
        (Box::new(|model| model.lease = held_by("panel ben@lab3", 9)), "you observe"),
        (Box::new(grow_silent), "no contact"),
        (Box::new(disconnect), "no connection"),
    ];
    for (change, why) in changes {
        let mut model = commanding(true);
        see_state(&mut model, turned(200, Mode::Active, 0.2));
        change(&mut model);
        let seen = window(SMALLEST, model);
        assert!(shows(&seen, &format!("Recover is off: {why}")) && !shows(&seen, "from reference"), "{why}");
    }
}

#[test]
fn an_observer_of_a_fault_takes_over_before_the_reset() {
    for (k, fault) in Fault::ALL.into_iter().enumerate() {
        let simulated = k % 2 == 0;
        let mut model = commanding(simulated);
        fault_of(&mut model, fault);
        model.lease = held_by("panel ben@lab3", 9);
        let go_on = "To go on: Take over, Reset, then Enable.";
        // Of a simulated rig nothing has to be mended before.
        let (first, rest) = fault.words().1.split_once(". ").unwrap_or((fault.words().1, ""));
        let text =
            if simulated { go_on.to_owned() } else { format!("{}. {go_on}", first.trim_end_matches('.')) };
        let seen = window(SIZES[0], model);
        assert!(seen.query_by_label(&text).is_some() && shows(&seen, rest), "{fault:?}");
    }
}

#[test]
fn who_commands_is_grey_and_the_bars_are_empty_while_they_are_not_certain() {
    let mut seen = window(SIZES[0], commanding(false));
    let is_grey = |seen: &Seen| {
        let texts = texts(seen);
        let commands = texts.iter().find(|it| it.text == "you command").expect("a painted text");
        let is_grey = !commands.color.is_opaque();
        // An old value looks like a present one, however grey.
        assert_eq!(texts.iter().any(|it| it.text == "0.00 / 0 rad/s"), !is_grey);
        assert_eq!(texts.iter().filter(|it| it.text == "-").count(), if is_grey { 4 } else { 0 });
        assert_eq!(texts.iter().any(|it| it.text == "last torque 0.000 N m"), is_grey);
        is_grey
    };
    assert!(!is_grey(&seen));
    let changes: [(Change, bool); 3] = [
        (Box::new(grow_silent), true),
        (Box::new(stop_in_vain), false),
        (Box::new(|model: &mut Model| (grow_silent(model), stop_in_vain(model)).0), true),
    ];
    for (k, (change, old)) in changes.into_iter().enumerate() {
        seen.state_mut().model = commanding(false);
        change(&mut seen.state_mut().model);
        settle(&mut seen);
        assert!(is_grey(&seen), "change {k}");
        assert_eq!(shows(&seen, " s ago: ACTIVE, 0.00 N m"), old, "change {k}");
    }
}

#[test]
fn a_sphere_that_is_too_far_from_its_reference_to_enable_is_told() {
    for simulated in [true, false] {
        let mut seen = window(SIZES[1], commanding(simulated));
        seen.state_mut().model.info.limits.enable_max_angle = 0.5;
        let turn = |seen: &mut Seen, tick: u64, angle: f64| {
            see_state(&mut seen.state_mut().model, turned(tick, Mode::Idle, angle));
            settle(seen);
        };
        let refused =
            "The sphere is 0.800 rad from the reference of spring. The rig enables it within 0.5 rad";
        turn(&mut seen, 200, 0.8);
        // The server decides: the reference may have been changed since the torque ended.
        assert!(!seen.get_by_label("Enable").accesskit_node().is_disabled());
        assert!(shows(&seen, &format!("No torque. {refused}")) && !shows(&seen, "Ready."));
        // What to do stands in the box alone.
        let [turns, anchor] = ["; Enable works to 0.50", ": set its anchor to here"];
        let (told, other) = if simulated { (anchor, turns) } else { (turns, anchor) };
        assert!(shows(&seen, &format!("0.80 rad from reference{told}")) && !shows(&seen, other));
        assert_eq!(shows(&seen, "`hbot set spring anchor=here`"), simulated);
        let said = hint(&mut seen, "Enable");
        assert!(said.contains(refused), "{said}");
        assert_eq!(said.contains("`hbot set spring anchor=here`"), simulated, "{said}");
        turn(&mut seen, 201, 0.4);
        assert!(shows(&seen, "Ready.") && !shows(&seen, "hbot set") && !shows(&seen, "still turns"));
        seen.state_mut().model.state.as_mut().expect("a state").omega = [0.0, 14.4, 0.0];
        settle(&mut seen);
        assert!(shows(&seen, "The sphere still turns: 14.40 rad/s") && shows(&seen, "Ready."));
    }
}

#[test]
fn a_sphere_that_is_still_too_fast_for_a_reset_is_told() {
    let told = "Too fast for Reset: 45.25 rad/s.";
    for (fault, speed, simulated, fast) in [
        (Fault::Overspeed, 45.25, true, true),
        (Fault::Overspeed, 45.25, false, true),
        (Fault::Overspeed, 29.0, true, false),
        (Fault::Thermal, 45.25, true, false),
        (Fault::Thermal, 1.9, true, false),
    ] {
        // A moment later the sphere is slower, which is not yet enough.
        let mut model = commanding(simulated);
        model.info.limits.speed = 30.0;
        let (mode, omega) = (Mode::Fault, [0.0, speed, 0.0]);
        let fault = Some(fault);
        see_state(&mut model, StateEvent { tick: 200, t: 0.2, mode, fault, omega, ..StateEvent::default() });
        see_state(&mut model, StateEvent { tick: 300, t: 0.3, mode, fault, ..StateEvent::default() });
        let seen = window(SIZES[1], model);
        for (name, off) in [("Reset", fast), ("Recover", speed > 2.0)] {
            assert_eq!(seen.get_by_label(name).accesskit_node().is_disabled(), off, "{name}: {fault:?}");
        }
        assert_eq!(shows(&seen, "Recover is off: the sphere still turns"), !fast && speed > 2.0);
        assert_eq!(shows(&seen, told), fast, "{fault:?} at {speed} rad/s");
        assert!(texts(&seen).iter().all(|it| it.is_whole()));
    }
}

#[test]
fn torque_waits_for_a_sphere_that_spins() {
    for (simulated, rest) in [(true, "hold the sphere"), (false, "wait until the sphere rests")] {
        let mut model = commanding(simulated);
        let (mode, omega) = (Mode::Estop, [0.0, 3.0, 0.0]);
        see_state(&mut model, StateEvent { tick: 200, t: 0.2, mode, omega, ..StateEvent::default() });
        let seen = window(SIZES[0], model);
        assert!(shows(&seen, &format!("To go on, {rest}, then press Recover.")), "{simulated}");
        assert!(seen.get_by_label("Recover").accesskit_node().is_disabled());
    }
}

/// The stability is what a user must know before the stiffness is raised.
#[test]
fn the_sentence_on_stability_is_in_sight() {
    for [width, height] in [SIZES[0], SIZES[1], SMALLEST] {
        let seen = window([width, height], warned(Mode::Active));
        let sentence = seen.get_by_label_contains("expected to be stable up to");
        assert!(sentence.rect().bottom() <= height, "{width} x {height}: {:?}", sentence.rect());
    }
}

#[test]
fn a_real_rig_has_a_tape_across_the_window() {
    for simulated in [true, false] {
        for size in [SIZES[0], SMALLEST] {
            let mut seen = window(size, commanding(simulated));
            let tape =
                filled(&seen).into_iter().find(|(rect, color)| *color == LIVE && rect.width() == size[0]);
            assert_eq!(tape.is_some(), !simulated, "{size:?}");
            let stop = seen.get_by_label("Stop").rect();
            assert!(tape.is_none_or(|(rect, _)| rect.bottom() < stop.top()), "it covers no control");
            // The next rig there can be another.
            disconnect(&mut seen.state_mut().model);
            settle(&mut seen);
            assert!(filled(&seen).iter().all(|(_, color)| *color != LIVE));
        }
    }
}

/// What is old counts from the last state, not from now.
#[test]
fn plots_of_a_silent_rig_end_at_the_last_state() {
    let mut seen = window(SIZES[0], commanding(true));
    let now = ["time before now, s", "(dots: now)"];
    let old = ["time before the last state, s", "(dots: last heard)"];
    let shows = |seen: &Seen, words: [&str; 2]| {
        let texts = texts(seen);
        words.map(|word| texts.iter().any(|it| it.text == word))
    };
    assert_eq!([shows(&seen, now), shows(&seen, old)], [[true; 2], [false; 2]]);
    grow_silent(&mut seen.state_mut().model);
    settle(&mut seen);
    assert_eq!([shows(&seen, now), shows(&seen, old)], [[false; 2], [true; 2]]);
    disconnect(&mut seen.state_mut().model);
    settle(&mut seen);
    assert_eq!(shows(&seen, old), [true; 2]);
}

#[test]
fn a_plot_tells_the_time_and_the_values_at_the_pointer() {
    let mut model = commanding(true);
    for (tick, torque) in [(200, 0.1), (1200, 0.2), (2200, 0.3)] {
        let (t, torque) = (tick as f64 / 1000.0, [0.0, torque, 0.0]);
        see_state(&mut model, StateEvent { tick, t, mode: Mode::Active, torque, ..StateEvent::default() });
    }
    let mut seen = window(SIZES[0], model);
    let plot = seen.get_by_label_contains("Plot of torque, N m").rect();
    let told = |seen: &Seen| texts(seen).into_iter().any(|it| it.text == "0.20" && it.is_whole());
    assert!(!told(&seen));
    // The plot shows 10 s, and the sample of 1 s ago is the nearest.
    let from_right = 0.12 * plot.width();
    seen.hover_at(plot.right_center() - vec2(from_right, 0.0));
    settle(&mut seen);
    let all: Vec<_> = texts(&seen).into_iter().map(|it| it.text).collect();
    assert!(told(&seen) && texts(&seen).iter().any(|it| it.text == "-1.00 s"), "{all:?}");
}

#[test]
fn what_happened_last_stands_in_the_foot_with_its_time() {
    let mut seen = window(SIZES[0], commanding(true));
    fault_of(&mut seen.state_mut().model, Fault::Thermal);
    seen.state_mut().model.messages.hide("Prototype");
    settle(&mut seen);
    let is_last = |line: &String| line.ends_with(" UTC | the fault was thermal");
    assert!(lines(&seen).iter().any(is_last) && !shows(&seen, "connected to"));
    assert!(texts(&seen).iter().any(|it| it.text == "choose another scene"));
}

#[test]
fn what_cannot_be_pressed_is_hollow_and_names_stay_in_the_picture() {
    for size in [SIZES[0], SMALLEST] {
        let seen = window(size, commanding(true));
        for (name, enabled) in [("Enable", false), ("Disable", true), ("Reset", false), ("Recover", false)] {
            let place = seen.get_by_label(name).rect().expand(1.0);
            let is = filled(&seen).iter().any(|(rect, _)| place.contains_rect(*rect));
            assert_eq!(is, enabled, "{name}");
        }
        let name = texts(&seen).into_iter().find(|it| it.text == "s3").expect("the axis");
        assert!(seen.get_by_label_contains("Sphere: ").rect().contains_rect(name.place), "{name:?}");
    }
}

/// Without a next step no button is filled: then something else comes first.
#[test]
fn the_next_step_alone_is_filled() {
    let [near, far] = [0.1_f64, 0.8];
    for (mode, by, angle, next) in [
        (Mode::Active, ME, near, None),
        (Mode::Idle, ME, near, Some("Enable")),
        (Mode::Idle, ME, far, None),
        (Mode::Fault, ME, near, Some("Reset")),
        (Mode::Estop, ME, near, Some("Recover")),
        (Mode::Estop, ME, far, None),
        (Mode::Estop, "panel ben@lab3", near, Some("Reset")),
    ] {
        let seen = at(SIZES[0], mode, by, angle);
        let fill = Palette::of_theme(true, Color32::GRAY).text;
        let is_filled = |name: &&str| {
            let place = seen.get_by_label(name).rect().expand(1.0);
            filled(&seen).iter().any(|(rect, color)| *color == fill && place.contains_rect(*rect))
        };
        let leads: Vec<_> = ["Enable", "Disable", "Reset", "Recover"].into_iter().filter(is_filled).collect();
        assert_eq!(leads, Vec::from_iter(next), "{mode}, {by}, {angle}");
    }
}

/// Draws a rig in this mode, stopped by `by` if it is, with its sphere at this angle from the
/// reference.
fn at(size: [f32; 2], mode: Mode, by: &str, angle: f64) -> Seen {
    let mut model = commanding(true);
    model.info.limits.enable_max_angle = 0.5;
    if mode == Mode::Estop {
        hear(&mut model, News::Fault(stopped_by(by, Some(if by == ME { 4 } else { 9 }))));
    }
    let fault = (mode == Mode::Fault).then_some(Fault::Thermal);
    see_state(&mut model, StateEvent { fault, ..turned(200, mode, angle) });
    window(size, model)
}

#[test]
fn the_button_for_the_anchor_moves_nothing_and_the_box_names_it() {
    for size in [SIZES[0], SMALLEST] {
        let [near, far] = [0.1, 0.8].map(|angle| at(size, Mode::Estop, ME, angle));
        assert_eq!(places(&near), places(&far), "{size:?}");
        assert!(far.query_by_label("0.80 rad from reference: set its anchor to here").is_some());
        assert!(shows(&far, "press \"set its anchor to here\", then Recover."), "{size:?}");
    }
}

#[test]
fn a_warning_that_stands_in_full_in_the_box_is_not_told_again() {
    let mut model = warned(Mode::Active);
    for (height, shakes) in [(760.0, false), (800.0, false), (800.0, true)] {
        if shakes {
            hear(&mut model, News::Shaking(shaking("spring")));
            see(&mut model, 202, Mode::Active);
        }
        let model = std::mem::replace(&mut model, warned(Mode::Active));
        let seen = window([1280.0, height], model);
        // The list below the sliders can be out of sight.
        let told: Vec<_> = seen.query_all_by_label_contains("is stable").map(|it| it.rect()).collect();
        let end = seen.get_by_label_contains("Speed: ").rect().top();
        assert!(told.len() == 1 && told[0].bottom() < end, "{height}, {shakes}: {told:?}");
    }
}

#[test]
fn what_may_be_old_is_grey() {
    let distance = "0.20 rad from reference; Enable works to 0.50";
    let changes: [fn(&mut Model); 3] = [grow_quiet, grow_silent, grow_silent];
    let cases = [(distance, Tab::Scene), ("Spring", Tab::Scene), ("steer", Tab::Joints)];
    for ((text, tab), change) in cases.into_iter().zip(changes) {
        let mut model = commanding(false);
        model.info.limits.enable_max_angle = 0.5;
        report_joints(&mut model);
        see_state(
            &mut model,
            StateEvent { joints: vec![Default::default(); 4], ..turned(201, Mode::Idle, 0.2) },
        );
        let mut seen = window(SIZES[0], model);
        seen.state_mut().desk.tab = tab;
        settle(&mut seen);
        let opacities = |seen: &Seen| -> Vec<u8> {
            let of = texts(seen).into_iter().filter(|it| it.text == text);
            of.map(|it| it.color.a()).collect()
        };
        let before = opacities(&seen);
        change(&mut seen.state_mut().model);
        settle(&mut seen);
        let after = opacities(&seen);
        assert!(!before.is_empty() && before.len() == after.len(), "{text}: {before:?}, {after:?}");
        assert!(before.iter().zip(&after).all(|(before, after)| after < before), "{text}: {after:?}");
    }
}
