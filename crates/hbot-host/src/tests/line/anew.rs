//! What a bus of hbot's own link forgets when its line is reopened.

use super::*;

fn description(counts_per_turn: u32) -> Vec<u8> {
    let joint = JointDescription { counts_per_turn };
    let description = Description {
        protocol: PROTOCOL_VERSION,
        joints: (0..4).map(|_| joint).collect(),
        ..Description::default()
    };
    let mut frame = [0; MAX_FEEDBACK_FRAME];
    let n = encode(&FromController::Description(description), &mut frame).expect("it fits");
    frame[..n].to_vec()
}

/// Strangers on the line make the zeros worthless for as long as they are there. The thread that
/// reopens a line identifies its controllers, so foreign controllers from before are forgotten.
#[test]
fn a_reopened_line_forgets_foreign_controllers() {
    let (mut bus, fake) = bus_and_line();
    let counts = RigConfig::prototype().rig.joints[0].counts_per_turn;
    assert!(!read(&mut *bus, &fake, 1, &description(counts)).zeros_lost, "they are those of the rig");
    assert!(read(&mut *bus, &fake, 2, &description(counts + 1)).zeros_lost);
    assert!(read(&mut *bus, &fake, 3, &[]).zeros_lost, "they are still there");
    fake.with(|far| far.renewed = Some(Renewed { rebooted: false }));
    assert!(!read(&mut *bus, &fake, 4, &[]).zeros_lost);
    assert!(!read(&mut *bus, &fake, 5, &[]).zeros_lost);
}
