//! Tests of how loud the box with the mode is, and of what stands under the stop button.

use eframe::egui::{Color32, Rect, Stroke, vec2};
use egui_kittest::kittest::Queryable as _;
use hbot_api::{Fault, Mode, StateEvent};

use super::status::{shaking, warned};
use super::{SIZES, SMALLEST, Seen, limited, settle, shows, window};
use crate::model::Model;
use crate::model::tests::{
    commanding, disconnect, grow_quiet, grow_silent, hear, hello, see, see_state, stop_in_vain,
};
use crate::net::{Intent, News};
use crate::view::painted::{Text, filled, rims, texts, vertical_lines};
use crate::view::theme::{Palette, STOP};

const KEYS: &str = "Esc or Space, anywhere in this window";
const NO_SWITCH: &str = "Not an emergency switch";
const SENT: &str = "STOP sent, not confirmed yet";
const NO_ANSWER: &str = "may not arrive";
const NO_CONNECTION: &str = "cannot reach the rig";

fn palette() -> Palette {
    Palette::of_theme(true, Color32::GRAY)
}

fn color_of(seen: &Seen, word: &str) -> Option<Color32> {
    texts(seen).into_iter().find(|it| it.text.split(':').next() == Some(word)).map(|it| it.color)
}

#[test]
fn the_lines_in_and_under_stop_say_whether_a_stop_arrives() {
    for size in [SIZES[0], SIZES[1], SMALLEST] {
        let mut seen = window(size, commanding(false));
        let mut check = |change: &dyn Fn(&mut Model), lines: &[&str]| {
            seen.state_mut().model = commanding(false);
            change(&mut seen.state_mut().model);
            settle(&mut seen);
            let stop = seen.get_by_label("Stop").rect();
            for line in [KEYS, SENT, NO_SWITCH, NO_ANSWER, NO_CONNECTION] {
                let told = texts(&seen).into_iter().find(|it| it.text == line);
                assert_eq!(told.is_some(), lines.contains(&line), "{size:?}: {line:?} of {lines:?}");
                let Some(told) = told else { continue };
                let inside = line != KEYS && line != SENT;
                assert_eq!((told.is_whole(), stop.contains_rect(told.place)), (true, inside), "{told:?}");
                assert!(!inside || told.place.height() >= 13.0, "{told:?}");
                assert_eq!(told.color == palette().warn, line == SENT, "{told:?}");
            }
        };
        check(&|_| {}, &[KEYS, NO_SWITCH]);
        check(&|model| model.asked(&Intent::Stop), &[SENT, NO_SWITCH]);
        check(&|model| (grow_silent(model), model.asked(&Intent::Stop)).1, &[SENT, NO_ANSWER]);
        check(&grow_quiet, &[KEYS, NO_ANSWER]);
        check(&grow_silent, &[KEYS, NO_ANSWER]);
        check(&|model| (grow_silent(model), stop_in_vain(model)).1, &[KEYS, NO_ANSWER]);
        check(&disconnect, &[KEYS, NO_CONNECTION]);
        check(&|model| (disconnect(model), model.asked(&Intent::Stop)).1, &[KEYS, NO_CONNECTION]);
    }
}

#[test]
fn what_may_be_old_is_grey_and_says_how_old_it_is() {
    for mode in [Mode::Active, Mode::Idle] {
        let mut model = commanding(false);
        see(&mut model, 200, mode);
        let mut seen = window(SIZES[0], model);
        let word = mode.as_str().to_uppercase();
        let before = color_of(&seen, &word);
        assert!(!shows(&seen, "last heard") && before.is_some());
        grow_quiet(&mut seen.state_mut().model);
        settle(&mut seen);
        assert!(shows(&seen, "last heard 0.") && !shows(&seen, "NO CONTACT"));
        let after = color_of(&seen, &word).expect("the mode");
        assert!(Some(after) != before && after.r() == after.g() && after.g() == after.b(), "{after:?}");
        let bar = color_of(&seen, "0.00 / 0.90 N m").expect("the bar of the torque");
        assert!(!bar.is_opaque(), "grey");
    }
}

#[test]
fn a_server_that_pushes_again_is_told_beside_a_stop_that_is_not_confirmed() {
    let words = "Connected again: the rig is ACTIVE and pushes. Press STOP.";
    for size in [SIZES[0], SMALLEST] {
        let mut model = commanding(false);
        stop_in_vain(&mut model);
        let mut seen = window(size, model);
        assert!(!shows(&seen, words) && shows(&seen, "(no answer)"));
        disconnect(&mut seen.state_mut().model);
        hear(&mut seen.state_mut().model, News::Connected(hello(9)));
        see(&mut seen.state_mut().model, 5, Mode::Active);
        settle(&mut seen);
        assert!(shows(&seen, "NOT STOPPED") && shows(&seen, words) && !shows(&seen, "(no answer)"));
        // STOP works again, so it comes first.
        let all = texts(&seen);
        let top = |text: &str| all.iter().find(|it| it.text == text).expect(text).place.top();
        assert!(top(words) < top("If it pushes on, cut the motors' power."));
    }
}

#[test]
fn only_a_rig_with_motors_has_power_to_cut() {
    for simulated in [true, false] {
        let changes: [fn(&mut Model); 5] = [
            grow_silent,
            stop_in_vain,
            |model| (grow_silent(model), stop_in_vain(model)).1,
            disconnect,
            |model| (disconnect(model), stop_in_vain(model)).1,
        ];
        for (k, change) in changes.into_iter().enumerate() {
            let mut model = commanding(simulated);
            change(&mut model);
            let online = model.is_online();
            let seen = window(SIZES[0], model);
            let has_none = simulated && online;
            assert_eq!(shows(&seen, "ut the motors' power"), !has_none, "change {k}");
            assert_eq!(shows(&seen, "Simulated: nothing real moves."), has_none, "change {k}");
        }
        // What a panel at another server says about the rig that it has left.
        let mut model = commanding(simulated);
        stop_in_vain(&mut model);
        model.asked(&Intent::Connect("other:4268".to_owned()));
        let seen = window(SIZES[0], model);
        assert!(shows(&seen, "Cut the motors' power."));
    }
    // Nothing is known of a rig that has never answered.
    let mut model = Model::new("rig:4268", "panel me@here", 120);
    stop_in_vain(&mut model);
    assert!(shows(&window(SIZES[0], model), "Cut the motors' power."));
}

#[test]
fn a_box_is_as_loud_as_the_worst_in_it() {
    let color_of_box = |seen: &Seen| {
        let stop = seen.get_by_label("Stop").rect();
        // Half a point for rounding.
        let rim = |color| {
            rims(seen).iter().any(|(rect, it)| it.color == color && (rect.width() - stop.width()).abs() < 3.0)
        };
        let color = color_of(seen, "ACTIVE").expect("the mode");
        let palette = palette();
        let all = [palette.warn, palette.torque, palette.good];
        assert_eq!(all.map(rim), all.map(|it| it == color));
        color
    };
    for size in [SIZES[0], SMALLEST] {
        let shaky = window(size, warned(Mode::Active));
        assert_eq!(color_of_box(&shaky), palette().warn, "a spring that may shake");
        assert!(shows(&shaky, "ACTIVE: warning") && shows(&shaky, "\u{25c6}"));
        // The limit of this rig is 0.9 N m.
        for (torque, lasts, at_limit) in [(0.86, 300, true), (0.84, 300, false), (0.9, 100, false)] {
            let mut model = commanding(true);
            for tick in 0..500 {
                let torque = [0.0, if tick < 500 - lasts { 0.0 } else { torque }, 0.0];
                let (t, tick) = (0.2 + 1e-3 * f64::from(tick), 200 + tick as u64);
                let state = StateEvent { tick, t, mode: Mode::Active, torque, ..StateEvent::default() };
                see_state(&mut model, state);
            }
            let seen = window(size, model);
            let color = if at_limit { palette().torque } else { palette().good };
            assert_eq!(color_of_box(&seen), color, "{torque} N m for {lasts} ms, {size:?}");
            assert_eq!(shows(&seen, "ACTIVE: at limit"), at_limit);
        }
    }
}

/// A word, the change of the model that leads to it, and which look it has.
type Case = (&'static str, fn(&mut Model), usize);

/// What differs in meaning differs in shape or fill, not in colour alone.
#[test]
fn each_headline_has_a_look_of_its_own() {
    let calm = Color32::from_rgb(0x34, 0x3b, 0x44);
    let fault: fn(&mut Model) = |model| super::fault_of(model, Fault::Thermal);
    let changes: [Case; 8] = [
        ("ACTIVE", |_| {}, 5),
        ("ENABLING", |model| see(model, 200, Mode::Enabling), 2),
        ("FAULT", fault, 0),
        ("ESTOP", |model| see(model, 200, Mode::Estop), 1),
        ("IDLE", |model| see(model, 200, Mode::Idle), 1),
        ("NO CONTACT", grow_silent, 4),
        ("NO CONTACT", disconnect, 4),
        ("NOT STOPPED", stop_in_vain, 3),
    ];
    for (word, change, look) in changes {
        for simulated in [true, false] {
            let mut model = commanding(simulated);
            change(&mut model);
            let seen = window(SIZES[0], model);
            let stop = seen.get_by_label("Stop").rect();
            let is = |rect: &Rect| (rect.width() - stop.width()).abs() < 16.0 && rect.top() > stop.bottom();
            let has = |color| filled(&seen).iter().any(|(rect, it)| *it == color && is(rect));
            let dashes = vertical_lines(&seen).iter().filter(|x| (**x - stop.left()).abs() < 2.0).count();
            let edge =
                |(rect, it): &(Rect, Stroke)| it.color == palette().warn && it.width == 3.0 && is(rect);
            let edge = rims(&seen).iter().any(edge);
            let looks = [has(palette().warn), has(calm), dashes > 5, has(Color32::BLACK), edge];
            assert_eq!(looks, std::array::from_fn(|k| k == look), "{word}");
            let head = texts(&seen).into_iter().find(|it| it.text == word).expect("the word");
            assert!(head.place.height() > 28.0, "{word}: {:?}", head.place);
            // Nothing real moves, so nothing is red.
            let red = word == "NOT STOPPED" && !simulated;
            let reds = filled(&seen).iter().filter(|(_, color)| *color == STOP).count();
            assert_eq!(reds, usize::from(word != "ESTOP") + usize::from(red), "{word}");
            assert_eq!(shows(&seen, "silent "), word == "NO CONTACT", "{word}");
            assert_eq!(shows(&seen, " s ago: ACTIVE, 0.00 N m"), word == "NO CONTACT", "{word}");
            let says = |it: &Text| it.text == "stopped, 0.00 N m" && it.is_whole();
            assert_eq!(texts(&seen).iter().any(says), word == "ESTOP", "{word}: in the button");
            assert_eq!(stop.size(), vec2(283.0, 60.0), "{word}");
        }
    }
}

#[test]
fn one_instruction_is_given_while_it_shakes() {
    for size in [SIZES[0], SMALLEST] {
        let mut model = warned(Mode::Active);
        hear(&mut model, News::Shaking(shaking("spring")));
        see(&mut model, 202, Mode::Active);
        let seen = window(size, model);
        assert!(
            shows(&seen, "ACTIVE: shakes")
                && shows(&seen, "\u{2248}")
                && shows(&seen, "spring shook the sphere at 16 Hz")
                && !shows(&seen, "Lower the stiffness")
        );
        let remedies = texts(&seen).into_iter().filter(|it| it.text.starts_with("Set stiffness = "));
        let below = seen.get_by_label("Stiffness").rect();
        let in_box =
            remedies.filter(|it| it.place.bottom() < below.top() && it.place.left() < below.right()).count();
        assert_eq!(in_box, 1, "{size:?}");
    }
}

/// The sliders below stay under the pointer.
#[test]
fn what_the_limits_cut_does_not_widen_the_column() {
    for size in [SIZES[0], SIZES[1], SMALLEST] {
        let mut seen = window(size, commanding(true));
        let before = seen.get_by_label("Stiffness").rect();
        limited(&mut seen.state_mut().model, 0.0);
        settle(&mut seen);
        assert_eq!(seen.get_by_label("Stiffness").rect(), before, "{size:?}");
        assert!(shows(&seen, "ACTIVE: reduced"), "{size:?}");
        let told = texts(&seen).into_iter().find(|it| it.text == "> 99 % cut");
        assert!(told.is_some_and(|it| it.is_whole()), "{size:?}");
    }
}
