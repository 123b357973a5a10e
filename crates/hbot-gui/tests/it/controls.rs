//! Tests of the buttons, of the stiffness controls, and of how faults are shown.

use eframe::egui::Key;
use egui_kittest::kittest::Queryable as _;
use hbot_api::{Fault, Mode};
use serde_json::{Value, json};

use crate::bench::{AloneServer, Seat, ServerSetup, Witness, norm};

/// Waits until the rig is active and a new panel holds the lease. Returns the panel, and a second
/// client that sees what the server does.
pub(crate) fn seated(bench: &AloneServer) -> (Seat, Witness) {
    let mut witness = Witness::new(bench);
    witness.state("active", |state| state.mode == Mode::Active);
    let mut seat = Seat::at(bench.address);
    seat.until_text("ACTIVE");
    seat.until_text("you command");
    (seat, witness)
}

fn settled(witness: &mut Witness) -> f64 {
    norm(witness.later(5.0).torque)
}

/// Waits until the server uses the value `value` for the parameter `key` of the spring.
fn arrived(seat: &mut Seat, witness: &mut Witness, key: &str, value: &Value) {
    let near = |a: &Value, b: &Value| match (a.as_f64(), b.as_f64()) {
        // The slider's resolution is limited by the pixels of the screen.
        (Some(a), Some(b)) => (a - b).abs() < 0.01 * b.abs() + 1e-12,
        _ => a == b,
    };
    let mut last = Value::Null;
    seat.until(&format!("{key} = {value}"), |_| {
        last = witness.parameter("spring", key);
        near(&last, value)
    });
}

#[test]
fn the_stiffness_slider_changes_the_torque_that_the_server_applies() {
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, mut witness) = seated(&bench);
    let soft = settled(&mut witness);
    assert!((soft - 0.04).abs() < 0.001, "0.2 N m/rad at 0.2 rad: {soft} N m");
    seat.set("Stiffness", 2.0);
    arrived(&mut seat, &mut witness, "stiffness", &json!(2.0));
    let stiff = settled(&mut witness);
    // The hand has 50 N m/rad, so it yields to the stiffer spring by up to 4 %.
    assert!((stiff / soft - 10.0).abs() < 0.5, "{soft} to {stiff} N m");
    seat.type_number("Stiffness value", "1");
    arrived(&mut seat, &mut witness, "stiffness", &json!(1.0));
    let middle = settled(&mut witness);
    assert!((middle / soft - 5.0).abs() < 0.15, "{soft} to {middle} N m");
}

#[test]
fn each_axis_has_its_own_stiffness_and_damping() {
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, mut witness) = seated(&bench);
    seat.click("Each axis");
    let rows = |a: f64, b: f64, c: f64| json!([[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]]);
    arrived(&mut seat, &mut witness, "stiffness", &rows(0.2, 0.2, 0.2));
    seat.type_number("Stiffness n1 value", "0.4");
    arrived(&mut seat, &mut witness, "stiffness", &rows(0.4, 0.2, 0.2));
    let torque = settled(&mut witness);
    // The reference is turned about n1 only. The hand yields by 0.8 %.
    assert!((torque - 0.08).abs() < 0.001, "{torque} N m");
    seat.type_number("Stiffness n3 value", "3");
    arrived(&mut seat, &mut witness, "stiffness", &rows(0.4, 0.2, 3.0));
    seat.type_number("Damping n2 value", "0.01");
    arrived(&mut seat, &mut witness, "damping", &rows(0.0, 0.01, 0.0));
    seat.click("Each axis");
    arrived(&mut seat, &mut witness, "stiffness", &json!(1.2));
    seat.set("Damping", 0.05);
    arrived(&mut seat, &mut witness, "damping", &json!(0.05));
    seat.pick("Law", "quaternion");
    arrived(&mut seat, &mut witness, "law", &json!("quaternion"));
}

#[test]
fn a_value_that_the_server_refuses_is_told_and_not_shown() {
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, mut witness) = seated(&bench);
    // A zero quaternion: each number is legal, but the server refuses the whole.
    seat.type_number("spring reference 1", "0");
    // The first change is still legal. Wait for it, because a second change of the same parameter
    // would replace it while it waits.
    seat.until("the first", |_| witness.parameter("spring", "reference")[0].as_f64() == Some(0.0));
    seat.type_number("spring reference 2", "0");
    seat.until_text("the quaternion has no length");
    let reference = witness.parameter("spring", "reference");
    assert_eq!(reference[0].as_f64(), Some(0.0), "{reference}");
    assert!(reference[1].as_f64().is_some_and(|x| x > 0.09), "{reference}");
    seat.until("what runs is shown again", |harness| {
        harness.get_by_label("spring reference 2").value().is_some_and(|text| text.starts_with("0.09"))
    });
}

#[test]
fn a_number_outside_its_range_is_refused_in_the_line_for_messages() {
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, mut witness) = seated(&bench);
    for (label, name, unit) in
        [("Stiffness value", "Stiffness", " N m/rad"), ("spring stiffness", "spring stiffness", "")]
    {
        for typed in ["5000", "-5"] {
            seat.type_number(label, typed);
            seat.until_text(&format!("{name}: {typed}; legal: 0 to 1000{unit}"));
        }
    }
    seat.type_number("Damping value", "0.01");
    arrived(&mut seat, &mut witness, "damping", &json!(0.01));
    assert_eq!(witness.parameter("spring", "stiffness"), json!(0.2), "what was before");
}

#[test]
fn the_button_esc_and_space_stop_and_reset_and_enable_lead_back() {
    type Way = dyn Fn(&mut Seat);
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, mut witness) = seated(&bench);
    let ways: [(&str, &Way); 4] = [
        ("the button", &|seat| seat.click("Stop")),
        ("Esc", &|seat| seat.harness.key_press(Key::Escape)),
        ("Space", &|seat| seat.harness.key_press(Key::Space)),
        ("Space in a text field", &|seat| {
            seat.type_text("Save scene as", "ab");
            seat.harness.key_press(Key::Space);
            seat.harness.get_by_label("Save scene as").type_text(" ");
        }),
    ];
    for (name, stop) in ways {
        stop(&mut seat);
        seat.frame();
        let state = witness.state(name, |state| state.mode == Mode::Estop);
        assert_eq!(norm(state.torque), 0.0, "{name}");
        seat.until_text("ESTOP");
        assert!(!seat.is_enabled("Enable"), "not from a stop");
        seat.click("Reset");
        seat.until_text("IDLE");
        seat.click("Enable");
        seat.until_text("ACTIVE");
    }
    assert_eq!(
        seat.harness.get_by_label("Save scene as").value().as_deref(),
        Some("ab"),
        "no blank was typed"
    );
}

#[test]
fn disable_and_enable() {
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, mut witness) = seated(&bench);
    assert!(!seat.is_enabled("Enable") && !seat.is_enabled("Reset"));
    seat.click("Disable");
    witness.state("idle", |state| state.mode == Mode::Idle);
    seat.until_text("IDLE");
    assert!(!seat.is_enabled("Disable"));
    seat.click("Enable");
    witness.state("active", |state| state.mode == Mode::Active);
    seat.until_text("ACTIVE");
}

#[test]
fn a_fault_is_told_in_plain_words_with_what_to_do() {
    // The default hand turns the sphere at 0.4 rad/s.
    let rig = [("speed = 30 ", "speed = 0.05 ")];
    let scene = "name = \"Nothing\"\neffect = []";
    let bench = AloneServer::start(&ServerSetup { rig: &rig, scene, ..ServerSetup::default() });
    let mut witness = Witness::new(&bench);
    witness.state("overspeed", |state| state.fault == Some(Fault::Overspeed));
    let mut seat = Seat::at(bench.address);
    seat.until_text("FAULT");
    assert!(seat.shows("The sphere turned faster than the rig allows."));
    assert!(seat.shows("Let it come to rest."));
    // The sphere still turns, so the server would refuse, and the panel says why.
    seat.until_text("you command");
    seat.until_text("Too fast for Reset: ");
    assert!(!seat.is_enabled("Reset") && !seat.is_enabled("Enable") && !seat.is_enabled("Recover"));
}

#[test]
fn every_control_has_a_name_and_is_reached_by_tab() {
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, mut witness) = seated(&bench);
    for tab in ["Joints", "Health", "Record", "Messages", "Scene"] {
        seat.click(tab);
        seat.harness.check_accessibility();
    }
    for plot in ["Angle", "Torque / deflection"] {
        seat.click(plot);
        seat.harness.check_accessibility();
    }
    let wanted = "Stop, Disable, Stiffness, Stiffness value, Damping, Law, Each axis, Scene file, spring \
        on, spring gain, Pause, Export CSV, Zero here, Light or dark, Release";
    let mut wanted: Vec<&str> = wanted.split(", ").collect();
    for _ in 0..120 {
        seat.harness.key_press(Key::Tab);
        seat.frame();
        wanted.retain(|label| !seat.harness.get_by_label(label).is_focused());
        if wanted.is_empty() {
            break;
        }
    }
    assert!(wanted.is_empty(), "not reached by Tab: {wanted:?}");
    // Enter presses the control that has the focus.
    seat.harness.get_by_label("Disable").focus();
    seat.frame();
    seat.harness.key_press(Key::Enter);
    seat.frame();
    witness.state("idle", |state| state.mode == Mode::Idle);
}

#[test]
fn recover_leads_back_in_one_step() {
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, mut witness) = seated(&bench);
    assert!(!seat.is_enabled("Recover"), "nothing to recover from");
    // The hand holds the sphere 0.2 rad away.
    seat.until_text("Recover is off: ACTIVE");
    seat.click("Stop");
    witness.state("stopped", |state| state.mode == Mode::Estop);
    seat.until_text("0.20 rad from reference; Enable works to 0.50");
    seat.click("Recover");
    witness.state("active", |state| state.mode == Mode::Active);
    seat.until_text("ACTIVE");
}

#[test]
fn recover_waits_until_the_sphere_is_near_its_reference() {
    // 0.8 rad is more than the rig's 0.5 rad.
    let far = crate::bench::STILL.replace(
        "[0.9950041652780258, 0.09983341664682815, 0, 0]",
        "[0.9210609940028851, 0.3894183423086505, 0, 0]",
    );
    let bench = AloneServer::with_scene(&far);
    let mut witness = Witness::new(&bench);
    let mut seat = Seat::at(bench.address);
    seat.until_text("you command");
    seat.click("Stop");
    witness.state("stopped", |state| state.mode == Mode::Estop);
    seat.until_text("0.80 rad from reference: set its anchor to here");
    assert!(!seat.shows("turn to within"), "one remedy");
    assert!(!seat.is_enabled("Recover"));
    seat.click("Reset");
    seat.until_text("The rig enables it within 0.5 rad: press \"set its anchor to here\" above");
    assert!(seat.is_enabled("Enable") && seat.shows("`hbot set spring anchor=here`"));
}
