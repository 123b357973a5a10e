//! Tests of the tab for the joints with a real server.

use egui_kittest::kittest::Queryable as _;
use hbot_api::ControllerInfo;

use crate::bench::{AloneServer, Seat, ServerSetup};

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
