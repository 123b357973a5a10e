//! Tests of the plots: what they show, pausing, and export.

use eframe::egui::accesskit::Role;
use egui_kittest::kittest::Queryable as _;
use hbot_gui::PanelOptions;

use crate::bench::{AloneServer, Seat, ServerSetup};

/// A scene in which the simulated hand moves the sphere against a spring of 2 N m/rad and 0.02 N m
/// s/rad.
const MOVED: &str = r#"
name = "Moved"
[[effect]]
id = "spring"
kind = "spring"
stiffness = 2
damping = 0.02
[simulate]
hand = { amplitude = 0.2 }
"#;

/// The part of a line of the CSV file that the tests check.
#[derive(serde::Deserialize)]
struct Row {
    t: f64,
    q_w: f64,
    q_x: f64,
    q_y: f64,
    q_z: f64,
}

fn moved() -> (AloneServer, Seat) {
    moving(MOVED, false)
}

fn moving(scene: &str, paced: bool) -> (AloneServer, Seat) {
    let bench = AloneServer::start(&ServerSetup { scene, paced, ..ServerSetup::default() });
    let options = PanelOptions { samples_per_s: 60, ..PanelOptions::new(&bench.address.to_string()) };
    let mut seat = Seat::with(options);
    seat.until_text("ACTIVE");
    (bench, seat)
}

#[test]
fn the_fitted_stiffness_is_that_of_the_spring() {
    let (_bench, mut seat) = moved();
    seat.click("Torque / deflection");
    for axis in ["n1", "n2", "n3"] {
        // The fit is exact to the digits shown: the law is linear in the angle, and the torque
        // belongs to the orientation of its tick.
        seat.until_text(&format!("{axis} 2.000 (0.0244)"));
    }
    seat.click("Zero here");
    seat.click("Zero at reference");
}

#[test]
fn what_is_exported_is_all_that_is_kept() {
    let (bench, mut seat) = moved();
    seat.until_text("Plot of torque");
    seat.pick("Time shown", "2 s");
    // More than is shown.
    let from = bench.client("a clock").ping(serde_json::Value::Null).expect("an answer").t;
    let mut witness = crate::bench::Witness::new(&bench);
    seat.until("5 s later", |_| witness.later(0.0).t > from + 5.0);
    seat.click("Pause");
    assert!(seat.harness.query_by_label("Go on").is_some());
    seat.click("Export CSV");
    seat.until_text("samples in");
    let file = std::fs::read_dir(seat.out.path())
        .expect("a folder")
        .flatten()
        .find(|entry| entry.path().extension().is_some_and(|e| e == "csv"))
        .expect("a file");
    let mut csv = csv::Reader::from_path(file.path()).expect("CSV");
    let rows: Vec<Row> = csv.deserialize().collect::<Result<_, _>>().expect("numbers");
    let (first, last) = (rows[0].t, rows[rows.len() - 1].t);
    // The plots show 2 s, and 30 s are kept.
    assert!((4.0..=30.0).contains(&(last - first)), "{first} s to {last} s");
    for row in &rows {
        let norm: f64 = [row.q_w, row.q_x, row.q_y, row.q_z].iter().map(|x| x * x).sum();
        assert!((norm - 1.0).abs() < 1e-12, "q has unit norm to rounding: {norm}");
    }
    seat.click("Go on");
}

#[test]
fn the_rate_of_samples_and_the_ground_are_chosen() {
    let (_bench, mut seat) = moved();
    seat.pick("Samples a second", "250 samples/s");
    seat.until("the choice", |harness| {
        harness.get_by_label("Samples a second").value().is_some_and(|value| value.contains("250"))
    });
    seat.until_text("ACTIVE");
    let dark = seat.harness.ctx.theme();
    seat.click("Light or dark");
    assert_ne!(seat.harness.ctx.theme(), dark);
}

#[test]
fn a_fit_describes_the_stiffness_since_its_last_change() {
    // In real time the samples before the change stay in the plot for ten seconds. The lead of 2.2
    // ms adds 2.2 ms times the stiffness to the damping of 0.02 N m s/rad.
    let (_bench, mut seat) = moving(MOVED, true);
    seat.click("Torque / deflection");
    seat.until_text("n1 2.000 (0.0244)");
    seat.type_number("Stiffness value", "3");
    seat.until_text("since spring: stiffness = 3.0");
    seat.until_text("n1 3.000 (0.0266)");
}

#[test]
fn a_wall_is_not_told_as_a_spring() {
    let scene =
        MOVED.replace("kind = \"spring\"\nstiffness = 2", "kind = \"end_stop\"\ncone = 0.05\nstiffness = 2");
    let (_bench, mut seat) = moving(&scene, false);
    seat.click("Torque / deflection");
    seat.until_text("is not one spring");
}

#[test]
fn every_plot_marks_scenes_changed_parameters_and_stops() {
    let (_bench, mut seat) = moving(MOVED, true);
    seat.until_text("you command");
    seat.type_number("Stiffness value", "1.5");
    for (plot, axis) in [
        ("Torque", "torque, N m"),
        ("Angle", "turn from reference, rad"),
        ("Speed", "angular velocity, rad/s"),
        ("Slip", "slip, m/s"),
        ("Energy", "energy to the hand, J"),
    ] {
        // A bar at the left can have the same name, but only this is a button.
        seat.harness.get_by_role_and_label(Role::Button, plot).click_accesskit();
        seat.until_text(&format!("Plot of {axis}"));
        seat.until_text("; spring: stiffness = 1.5,");
    }
    seat.pick("Scene file", "thick-air");
    seat.click("Load");
    seat.until_text("; scene Thick air,");
    seat.click("Stop");
    seat.until_text("; estop,");
}
