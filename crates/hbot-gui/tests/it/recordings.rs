//! Tests of recordings: the panel makes one, opens it, and shows its moments.

use egui_kittest::kittest::Queryable as _;
use hbot_api::Mode;
use hbot_record::reader::Item;

use crate::bench::{AloneServer, Seat, ServerSetup, Wire, Witness};
use crate::controls::seated;

fn recorded(
    seat: &mut Seat,
    witness: &mut Witness,
    name: &str,
    meanwhile: impl FnOnce(&mut Seat, &mut Witness),
) -> std::path::PathBuf {
    seat.click("Record");
    seat.type_text("Name of the recording", name);
    seat.click("Start recording");
    seat.until_text(" states, 0 lost");
    meanwhile(seat, witness);
    seat.click("Stop recording");
    seat.until_text("recorded ");
    seat.out.path().join(format!("{name}.mcap"))
}

#[test]
fn a_recording_of_the_panel_is_opened_and_scrubbed() {
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, mut witness) = seated(&bench);
    let path = recorded(&mut seat, &mut witness, "run", |seat, witness| {
        let begun = witness.later(0.5);
        assert_eq!(begun.mode, Mode::Active);
        seat.click("Stop");
        witness.state("stopped", |state| state.mode == Mode::Estop);
        witness.later(0.5);
    });
    assert!(path.exists());
    // A second recording of this name is refused, and the first one stays.
    let bytes = std::fs::metadata(&path).expect("a file").len();
    seat.type_text("Name of the recording", "run");
    seat.click("Start recording");
    seat.until_text("run.mcap: File exists");
    assert_eq!(std::fs::metadata(&path).expect("a file").len(), bytes);

    assert!(seat.shows("SIMULATED"));
    seat.until("the list", |harness| harness.query_by_label("run.mcap").is_some());
    seat.click("run.mcap");
    seat.until_text("RECORDING");
    assert!(!seat.shows("SIMULATED"));
    assert!(seat.shows("The column at the left shows the rig as it is now."));
    // The last moment is that of a stopped rig, the first one that of an active rig with torque.
    seat.harness.check_accessibility();
    let slider = seat.harness.get_by_label("Time in the recording");
    let node = egui_kittest::kittest::NodeT::accesskit_node(&slider);
    let (from, to) = (node.min_numeric_value(), node.max_numeric_value());
    let (from, to) = (from.expect("a first time"), to.expect("a last time"));
    assert!(to - from > 0.9, "{from} to {to} s");
    seat.set("Time in the recording", to);
    assert!(seat.painted().iter().any(|text| text == &format!("{to:.3} s")), "{:?}", seat.painted());
    let torque = |seat: &Seat| {
        let label = seat.harness.get_by_label_contains("Sphere: orientation");
        let text = egui_kittest::kittest::NodeT::accesskit_node(&label).label().expect("its words");
        let (_, after) = text.split_once("torque ").expect("a torque");
        after.split(' ').next().and_then(|x| x.parse::<f64>().ok()).expect("a number")
    };
    assert_eq!(torque(&seat), 0.0, "stopped");
    seat.set("Time in the recording", from);
    // 0.2 N m/rad at 0.2 rad.
    assert!((torque(&seat) - 0.04).abs() < 0.001, "{} N m", torque(&seat));
    // The rig itself is still stopped, and the buttons are for it.
    assert!(seat.shows("ESTOP") && seat.shows("Stopped by you."));
    seat.click("Play the recording");
    seat.until("it goes on", |_| true);
    for _ in 0..10 {
        seat.frame();
    }
    let now = seat.harness.get_by_label("Time in the recording");
    let now = egui_kittest::kittest::NodeT::accesskit_node(&now).numeric_value().expect("a time");
    assert!(now > from, "{now} s");
    seat.click("Close the recording");
    assert!(seat.shows("SIMULATED") && !seat.shows("RECORDING"));
}

#[test]
fn a_recording_whose_connection_breaks_is_told_as_a_failure_and_can_be_read() {
    let bench = AloneServer::start(&ServerSetup::default());
    let wire = Wire::to(bench.address);
    let mut seat = Seat::at(wire.address);
    seat.until_text("ACTIVE");
    seat.click("Record");
    seat.type_text("Name of the recording", "cut");
    seat.click("Start recording");
    seat.until_text(" states, 0 lost");
    wire.cut();
    seat.click("Messages");
    seat.until_text("the recording has ended early");
    assert!(seat.shows("cut.mcap") && seat.shows(": recorded "), "{}", seat.texts());
    let file = std::fs::File::open(seat.out.path().join("cut.mcap")).expect("a file");
    let mut reader = hbot_record::Reader::new(std::io::BufReader::new(file)).expect("a recording");
    while let Some(item) = reader.next().expect("readable") {
        assert!(!matches!(item, Item::Damaged(_) | Item::Cut), "the file has its end");
    }
}

#[test]
fn a_file_that_is_no_recording_is_told() {
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, _witness) = seated(&bench);
    seat.click("Record");
    let path = seat.out.path().join("other.mcap");
    std::fs::write(&path, "not a recording").expect("written");
    seat.until("the list", |harness| harness.query_by_label("other.mcap").is_some());
    seat.click("other.mcap");
    seat.until_text("not an MCAP file");
    assert!(seat.shows("SIMULATED"));
}
