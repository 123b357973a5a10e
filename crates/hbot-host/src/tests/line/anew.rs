//! Tests of what a bus of hbot's own link forgets when its line is reopened, and of the messages
//! that switch motors off.

use super::*;

fn reopen(fake: &Fake, rebooted: bool) {
    fake.with(|far| far.renewed = Some(Renewed { rebooted }));
}

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

/// The beginning of a frame from before the loss does not damage the first frame after it.
#[test]
fn a_reopened_line_forgets_the_frame_that_its_loss_has_cut() {
    let (mut bus, fake) = bus_and_line();
    let frame = |sequence| answer(sequence, ControllerFlags::default(), 4, None);
    let first = frame(1)[..frame(1).len() / 2].to_vec();
    // Without a loss the two run into each other: neither is read, and one damaged frame counts.
    assert_eq!(read(&mut *bus, &fake, 2, &first), Heard::default());
    let torn = read(&mut *bus, &fake, 3, &frame(2));
    assert_eq!((torn.reading, torn.damaged), (None, 1));
    assert_eq!(read(&mut *bus, &fake, 4, &first), Heard::default());
    reopen(&fake, false);
    let whole = read(&mut *bus, &fake, 5, &frame(4));
    assert_eq!((whole.reading.map(|reading| reading.answers), whole.damaged), (Some(4), 0));
    assert!(whole.reopened && !whole.zeros_lost);
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
    reopen(&fake, false);
    assert!(!read(&mut *bus, &fake, 4, &[]).zeros_lost);
    assert!(!read(&mut *bus, &fake, 5, &[]).zeros_lost);
}

/// Controllers that lost power while their line was lost have lost their zeros, whether or not they
/// say so in the same tick.
#[test]
fn controllers_that_lost_power_behind_a_lost_line_have_lost_their_zeros() {
    for flags in [ControllerFlags::default(), ControllerFlags::UNDESCRIBED] {
        for rebooted in [false, true] {
            let (mut bus, fake) = bus_and_line();
            reopen(&fake, rebooted);
            let heard = read(&mut *bus, &fake, 3, &answer(2, flags, 4, None));
            let undescribed = flags == ControllerFlags::UNDESCRIBED;
            assert_eq!(heard.zeros_lost, rebooted || undescribed, "{flags:?}, rebooted: {rebooted}");
            assert!(heard.reopened && heard.reading.is_some());
        }
    }
}

/// The commands that a line got, as the controllers read them.
fn commands(bytes: &[u8]) -> Vec<Command> {
    let mut found = Vec::new();
    Decoder::<ToController>::new().feed(bytes, |message| {
        if let Ok(ToController::Command(command)) = message {
            found.push(command);
        }
    });
    found
}

/// The bytes of the helper process work after any bytes: they end a frame that was cut.
#[test]
fn the_bytes_that_switch_off_say_off_with_zero_torque_whatever_came_before() {
    let rig = RigConfig::prototype().rig;
    let expected = Expected::new("test", &rig, &Layout::single(0..4), 0);
    let off = HbotLink.off_bytes(&expected);
    assert!(off.len() <= 255, "{}", off.len());
    for before in [&[][..], &[5, 1, 2], &[0], &[0xff; 40]] {
        let found = commands(&[before, &off].concat());
        assert_eq!(found.len(), 1, "after {before:?}");
        assert!(!found[0].enable && found[0].watchdog_ms == 1);
        assert_eq!(found[0].torque[..], [0.0_f32; 4]);
    }
}
