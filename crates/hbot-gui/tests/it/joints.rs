//! Tests of the tab for the joints with a real server.

use std::time::{Duration, Instant};

use egui_kittest::kittest::Queryable as _;
use hbot_api::ControllerInfo;

use crate::bench::{AloneServer, Seat, ServerSetup, Wire};
use crate::controls::seated;

/// The rig file of the prototype with moteus servos, which report their currents.
pub(crate) const MOTEUS: &str = include_str!("../../../../rigs/prototype-moteus.toml");

/// A scene with a constant torque, in which every motor has a part. The simulated hand holds the
/// sphere still, so the currents of the motors do not change.
const PUSH: &str = r#"
name = "Push"
[[effect]]
id = "push"
kind = "constant"
torque = [0.05, 0.1, 0.1]
[simulate]
hand = { stiffness = 50, damping = 1, amplitude = 0 }
"#;

#[test]
fn the_tab_for_the_joints_shows_what_the_motor_controllers_report() {
    let bench = AloneServer::start(&ServerSetup::default());
    let mut client = bench.client("a witness");
    let mut seat = Seat::at(bench.address);
    seat.until_text("you command");
    seat.click("Joints");
    seat.until_text("25.0 \u{b0}C");
    let told: Vec<ControllerInfo> = client.controllers().expect("an answer");
    let firmware = told[0].firmware.as_deref().expect("the simulated firmware has a name");
    assert!(firmware.starts_with("hbot-sim ") && seat.shows(firmware), "{}", seat.texts());
    let temperatures = seat.harness.query_all_by_label_contains("25.0 \u{b0}C").count();
    assert_eq!(temperatures, 4, "one for each joint: {}", seat.texts());
    bench.stop();
}

#[test]
fn the_tab_for_the_joints_follows_the_currents_of_the_motors() {
    let bench = AloneServer::start(&ServerSetup { file: MOTEUS, scene: PUSH, ..ServerSetup::default() });
    let (mut seat, _witness) = seated(&bench);
    let mut client = bench.client("another witness");
    seat.click("Joints");
    seat.until_text("moteus 0x010f, register map 5");
    seat.until("the currents of motors that push", |harness| {
        let told = client.controllers().expect("an answer");
        let currents: Vec<f64> = told.iter().filter_map(|it| it.current_a).collect();
        let shown = |current: &f64| harness.query_all_by_label(&format!("{current:+.3} A")).next().is_some();
        currents.len() == 4 && currents.iter().any(|it| it.abs() > 0.02) && currents.iter().all(shown)
    });
    seat.click("Stop");
    seat.until("no current", |harness| harness.query_all_by_label("+0.000 A").count() == 4);
    bench.stop();
}

#[test]
fn an_older_server_is_asked_for_the_controllers_once_and_the_tab_says_why_there_are_none() {
    let bench = AloneServer::start(&ServerSetup::default());
    let wire = Wire::to_one_without(bench.address, "controllers");
    let mut seat = Seat::at(wire.address);
    seat.until_text("you command");
    seat.click("Joints");
    seat.until_text("Motor controllers: not reported, because this server is older");
    assert!(seat.shows("rate, rad/s"), "the joints themselves are shown: {}", seat.texts());
    // The panel asks a server that answers every second.
    let start = Instant::now();
    while start.elapsed() < Duration::from_millis(2500) {
        seat.frame();
        std::thread::sleep(Duration::from_millis(15));
    }
    assert_eq!(wire.replaced(), 1);
    seat.click("Messages");
    assert!(!seat.shows("unknown op") && !seat.shows("controllers"), "{}", seat.texts());
    assert!(seat.shows("ACTIVE"), "{}", seat.texts());
    bench.stop();
}
