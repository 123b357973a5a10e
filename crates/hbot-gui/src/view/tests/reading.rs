//! Tests of what an observer and a hasty reader can read.

use eframe::egui::{Color32, Theme, vec2};
use egui_kittest::kittest::Queryable as _;
use hbot_api::{Fault, FaultEvent, Mode, StateEvent};

use super::{SIZES, SMALLEST, contrast, fault_of, settle, shows, window};
use crate::model::tests::{commanding, grow_silent, hear, held_by, see, see_state, stop_in_vain, stopped_by};
use crate::net::News;
use crate::view::painted::{filled, lines, rims, texts};
use crate::view::theme::Palette;

/// 4.5 is what WCAG 2.2 asks of text (criterion 1.4.3).
#[test]
fn an_observer_reads_what_is_grey() {
    for size in [SIZES[0], SIZES[1], SMALLEST] {
        let mut model = commanding(true);
        model.lease = held_by("panel ben@lab3", 9);
        let mut seen = window(size, model);
        for theme in [Theme::Dark, Theme::Light] {
            seen.ctx.set_theme(theme);
            settle(&mut seen);
            let visuals = seen.ctx.style_of(theme).visuals.clone();
            let (ground, weak) = (visuals.panel_fill, visuals.weak_text_color());
            let left = seen.get_by_label("Stop").rect().x_range();
            for text in texts(&seen).into_iter().filter(|it| left.contains(it.place.left())) {
                let ink = text.color;
                if !ink.is_opaque() || ink == weak {
                    assert!(text.size >= 13.0, "{size:?}: {text:?}");
                    let contrast = contrast(ground.blend(ink), ground);
                    assert!(contrast >= 4.5, "{size:?}, {theme:?}: {contrast} of {text:?}");
                }
            }
        }
    }
}

/// A mark in the plots alone is easily missed.
#[test]
fn a_fault_that_the_rig_has_left_is_told_for_a_while() {
    for size in [SIZES[0], SMALLEST] {
        let mut seen = window(size, commanding(false));
        let at =
            |tick: u64, mode| StateEvent { tick, t: tick as f64 / 1000.0, mode, ..StateEvent::default() };
        seen.state_mut().model.info.rig.rate_hz = 1000;
        for tick in [2000, 5000] {
            let model = &mut seen.state_mut().model;
            let event =
                FaultEvent { tick, mode: Mode::Fault, fault: Some(Fault::LinkLost), ..stopped_by("", None) };
            hear(model, News::Fault(event));
            see_state(model, StateEvent { fault: Some(Fault::LinkLost), ..at(tick, Mode::Fault) });
            see_state(model, at(tick + 500, Mode::Active));
        }
        see_state(&mut seen.state_mut().model, at(7100, Mode::Active));
        settle(&mut seen);
        let told = "2 faults in 10 s, the last 2 s ago: link_lost";
        let all = texts(&seen).into_iter().find(|it| it.text.starts_with(told)).expect("the faults");
        // A low window has no room for what it was.
        let why = format!("{told}. The motor controllers do not answer.");
        assert_eq!(all.text, if size == SIZES[0] { &*why } else { told });
        assert!(all.place.bottom() <= seen.get_by_label("Traction").rect().top(), "{all:?}");
        assert!(shows(&seen, "ACTIVE: after a fault"), "{:?}", lines(&seen));
        let warn = Palette::of_theme(true, Color32::GRAY).warn;
        let stop = seen.get_by_label("Stop").rect();
        let is_edge = |width: f32, color| color == warn && (width - stop.width()).abs() < 3.0;
        assert!(rims(&seen).iter().any(|(rect, rim)| is_edge(rect.width(), rim.color)), "{size:?}");
        see_state(&mut seen.state_mut().model, at(12_600, Mode::Active));
        settle(&mut seen);
        assert!(shows(&seen, "Fault 7 s ago: link_lost"), "{:?}", lines(&seen));
        see_state(&mut seen.state_mut().model, at(15_100, Mode::Active));
        settle(&mut seen);
        assert!(!shows(&seen, "s ago: link_lost") && !shows(&seen, "after a fault"), "{:?}", lines(&seen));
    }
}

#[test]
fn advice_about_the_scene_stands_apart_from_the_fault() {
    for (simulated, first) in [(false, "Let it come to rest. To go on: "), (true, "To go on: ")] {
        let mut model = commanding(simulated);
        fault_of(&mut model, Fault::Overspeed);
        let seen = window(SIZES[0], model);
        let way = seen.get_by_label(&format!("{first}Reset, then Enable.")).rect();
        let advice = seen.get_by_label_contains("Less stiffness or more damping keeps it slower.").rect();
        assert!(way.bottom() <= advice.top(), "{simulated}");
    }
}

#[test]
fn a_bar_is_long_enough_to_be_read_beside_its_figures() {
    for size in [SIZES[0], SIZES[1], SMALLEST] {
        let mut model = commanding(true);
        (model.info.limits.speed, model.info.limits.slip) = (30.0, 0.05);
        let omega = [0.0, 12.34, 0.0];
        see_state(
            &mut model,
            StateEvent {
                tick: 200,
                t: 0.2,
                mode: Mode::Active,
                omega,
                scale: 0.001,
                ..StateEvent::default()
            },
        );
        let seen = window(size, model);
        for figures in ["12.34 / 30 rad/s", "0.0 / 50 mm/s", "> 99 % cut"] {
            assert!(texts(&seen).iter().any(|it| it.text == figures && it.is_whole()), "{size:?}: {figures}");
        }
        for name in ["Speed: ", "Traction: ", "Slip: ", "Saturation: "] {
            let bar = seen.get_by_label_contains(name).rect();
            assert!(bar.width() >= 64.0, "{size:?}, {name}: {bar}");
        }
    }
}

#[test]
fn a_long_name_of_who_commands_is_not_cut_before_it_says_what_it_is() {
    for (size, name) in
        [(SIZES[0], "you observe, ben@lab3 commands"), (SMALLEST, "ben@a-machine-with-a-long-name commands")]
    {
        let mut model = commanding(true);
        let who = name.trim_start_matches("you observe, ").trim_end_matches(" commands");
        model.lease = held_by(&format!("panel {who}"), 9);
        let seen = window(size, model);
        assert!(texts(&seen).iter().any(|it| it.text == name && it.is_whole()), "{:?}", lines(&seen));
    }
}

#[test]
fn the_foot_says_what_to_do_about_a_stop_that_is_not_confirmed() {
    let mut model = commanding(false);
    grow_silent(&mut model);
    stop_in_vain(&mut model);
    model.messages.hide("Prototype");
    let seen = window(SIZES[0], model);
    let is_last = |it: &String| {
        it.ends_with("the server has not confirmed the stop (no answer). Cut the motors' power")
    };
    assert!(lines(&seen).iter().any(is_last), "{:?}", lines(&seen));
}

/// The server resets it at any speed but that of the fault. Rest is better.
#[test]
fn reset_is_the_next_step_once_the_sphere_rests() {
    for (speed, leads) in [(0.05, true), (1.0, false)] {
        let mut model = commanding(true);
        let fault = Some(Fault::Thermal);
        let omega = [0.0, speed, 0.0];
        see(&mut model, 150, Mode::Active);
        see_state(
            &mut model,
            StateEvent { tick: 200, t: 0.2, mode: Mode::Fault, fault, omega, ..StateEvent::default() },
        );
        let seen = window(SIZES[0], model);
        let fill = Palette::of_theme(true, Color32::GRAY).text;
        let reset = seen.get_by_label("Reset");
        assert!(!egui_kittest::kittest::NodeT::accesskit_node(&reset).is_disabled());
        let place = reset.rect().expand2(vec2(1.0, 1.0));
        let is_filled = filled(&seen).iter().any(|(rect, it)| *it == fill && place.contains_rect(*rect));
        assert_eq!(is_filled, leads, "{speed} rad/s");
    }
}
