//! Tests of the motor buses as one set of joints, with buses whose reports a test writes: the last
//! command, the age and the damage of several lines, complaints, and zero offsets.

use hbot_config::RigConfig;
use hbot_config::rig::{Port, Protocol};
use hbot_core::inputs::Complaints;
use hbot_core::outputs::Drive;
use hbot_core::{MAX_JOINTS, Rig};

use crate::bus::{BusCommand, Heard, JointReading, MotorBus, Reading};
use crate::rig::layout::{JointPlace, Layout};
use crate::rig::motors::Motors;
use crate::tests::scripted::ScriptedBus;

/// Watchdog time of the tests, ms.
const WATCHDOG_MS: u16 = 23;

/// Returns motors on two buses, two joints on each. The second wheel's joints are in the order
/// drive, steer on their bus.
fn two_lines() -> (Motors, [ScriptedBus; 2]) {
    let place = |bus, at| JointPlace { bus, at, id: at as u8 };
    let places = vec![place(0, 0), place(0, 1), place(1, 1), place(1, 0)];
    let layout = Layout { places, ..Layout::single([]) };
    let lines = [ScriptedBus::default(), ScriptedBus::default()];
    let buses = lines.iter().map(|line| Box::new(line.clone()) as Box<dyn MotorBus>);
    (Motors::new(buses.collect(), &layout, WATCHDOG_MS), lines)
}

/// A reading in answer to the command of tick `answers`. The counts of the joints are `count` and
/// the numbers after it.
fn reading(answers: u32, count: i32) -> Heard {
    let joints = std::array::from_fn(|at| JointReading {
        count: count.wrapping_add(at as i32),
        rate: f64::from(count),
        ..JointReading::default()
    });
    Heard { reading: Some(Reading { answers, joints }), ..Heard::default() }
}

/// Motors with torque on every joint are commanded off: no torque remains in the command, and it
/// has the number of its tick and the watchdog time.
#[test]
fn switching_off_says_off_with_zero_torque_on_every_joint_of_every_bus() {
    let (mut motors, lines) = two_lines();
    let torque = std::array::from_fn(|joint| 0.1 + joint as f64);
    assert_eq!(motors.command(0, 7, &Drive { enable: true, torque }), 0);
    assert_eq!(lines[1].last().torque[..2], [3.1, 2.1], "in the order of the bus");
    assert!(lines.iter().all(|line| line.last().enable));
    assert_eq!(motors.switch_off(0, 8), 0);
    let off = BusCommand { tick: 8, enable: false, watchdog_ms: WATCHDOG_MS, torque: [0.0; MAX_JOINTS] };
    for line in &lines {
        assert_eq!((line.last(), line.script().commands.len()), (off, 2));
    }
}

#[test]
fn a_reading_of_two_lines_is_as_old_as_the_older_one() {
    // Also where the number of the tick wraps to 0.
    for tick in [100, 1, u32::MAX] {
        let before = |ticks: u32| tick.wrapping_sub(ticks);
        for [first, second] in [[1, 3], [3, 1], [2, 2]] {
            let (mut motors, lines) = two_lines();
            lines[0].reports(reading(before(first), 10));
            lines[1].reports(reading(before(second), 20));
            let news = motors.receive(0, tick);
            let feedback = news.feedback.expect("both have answered");
            assert_eq!(tick.wrapping_sub(feedback.sequence), first.max(second), "{tick}: {first}, {second}");
            assert_eq!((feedback.counts[..4].to_vec(), news.buses_with_reading), (vec![10, 11, 21, 20], 2));
        }
    }
}

/// A line that falls silent keeps the age of the rig at that of its last reading, whatever the
/// other one sends.
#[test]
fn a_line_that_falls_silent_makes_the_reading_old() {
    let (mut motors, lines) = two_lines();
    lines[0].reports(reading(4, 10));
    assert!(motors.receive(0, 5).feedback.is_none(), "the other line has never answered");
    lines[1].reports(reading(5, 20));
    let sequence =
        |motors: &mut Motors, tick| motors.receive(0, tick).feedback.map(|feedback| feedback.sequence);
    assert_eq!(sequence(&mut motors, 6), Some(4));
    for tick in 7..20 {
        lines[0].reports(reading(tick - 1, 10));
        assert_eq!(sequence(&mut motors, tick), Some(5), "tick {tick}");
    }
    assert_eq!(sequence(&mut motors, 20), None, "no news at all");
}

#[test]
fn damage_and_foreign_frames_on_either_line_count_and_the_sum_does_not_wrap() {
    for (damaged, sum) in [([2, 0], 2), ([0, 3], 3), ([2, 3], 5), ([u16::MAX, 3], u16::MAX)] {
        let (mut motors, lines) = two_lines();
        for (line, damaged) in lines.iter().zip(damaged) {
            line.reports(Heard { damaged, foreign: u32::from(damaged), ..Heard::default() });
        }
        let news = motors.receive(0, 9);
        let foreign: u64 = damaged.into_iter().map(u64::from).sum();
        assert_eq!((news.damaged, news.foreign), (sum, foreign));
        assert!(news.feedback.is_none());
    }
}

#[test]
fn lost_zeros_and_reopened_lines_are_reported_by_either_line() {
    for which in [0, 1] {
        let (mut motors, lines) = two_lines();
        lines[which].reports(Heard { zeros_lost: true, reopened: true, ..Heard::default() });
        let news = motors.receive(0, 9);
        assert_eq!((news.zeros_lost, news.reopened), (true, 1), "line {which}");
        let news = motors.receive(0, 10);
        assert_eq!((news.zeros_lost, news.reopened), (false, 0), "once");
    }
}

/// A complaint can arrive in a frame that is no new reading, for example in one that came twice. It
/// takes effect all the same, with the readings that are known.
#[test]
fn a_complaint_without_a_new_reading_takes_effect_in_its_tick() {
    let (mut motors, lines) = two_lines();
    for (line, count) in lines.iter().zip([10, 20]) {
        line.reports(reading(4, count));
    }
    motors.receive(0, 5);
    let complaints = Complaints { overtemperature: true, ..Complaints::default() };
    lines[1].reports(Heard { complaints, ..Heard::default() });
    let news = motors.receive(0, 6);
    let feedback = news.feedback.expect("a complaint is news");
    assert_eq!((feedback.complaints, feedback.sequence), (complaints, 4));
    assert_eq!((feedback.counts[..4].to_vec(), news.buses_with_reading), (vec![10, 11, 21, 20], 0));
    assert!(motors.receive(0, 7).feedback.is_none(), "it was said once");
    lines[0].reports(reading(7, 10));
    assert_eq!(motors.receive(0, 8).feedback.expect("a reading").complaints, Complaints::default());
}

/// A line that was reopened reports an expired watchdog in that tick, before torque is sent on it.
#[test]
fn a_reopened_line_reports_an_expired_watchdog_once_and_at_once() {
    let watchdog =
        |motors: &mut Motors, tick| motors.receive(0, tick).feedback.map(|f| f.complaints.watchdog);
    let (mut motors, lines) = two_lines();
    lines.iter().for_each(|line| line.reports(reading(4, 10)));
    assert_eq!(watchdog(&mut motors, 5), Some(false));
    lines[0].reports(Heard { reopened: true, ..Heard::default() });
    assert_eq!(watchdog(&mut motors, 6), Some(true));
    assert_eq!(watchdog(&mut motors, 7), None);
    lines[0].reports(reading(7, 10));
    assert_eq!(watchdog(&mut motors, 8), Some(false));
}

/// A motor that is on or off against the command stays so in ticks in which only others answer.
#[test]
fn a_disobedient_motor_is_reported_while_only_another_line_answers() {
    let disobeyed =
        |motors: &mut Motors, tick| motors.receive(0, tick).feedback.map(|f| f.complaints.disobeyed);
    let (mut motors, lines) = two_lines();
    lines.iter().for_each(|line| line.reports(reading(4, 10)));
    assert_eq!(disobeyed(&mut motors, 5), Some(false));
    let complaints = Complaints { disobeyed: true, ..Complaints::default() };
    lines[0].reports(Heard { complaints, ..reading(5, 10) });
    assert_eq!(disobeyed(&mut motors, 6), Some(true));
    assert_eq!(disobeyed(&mut motors, 7), None, "nobody answers");
    lines[1].reports(reading(7, 10));
    assert_eq!(disobeyed(&mut motors, 8), Some(true), "the other answers");
    lines[0].reports(reading(8, 10));
    assert_eq!(disobeyed(&mut motors, 9), Some(false));
}

/// Without a restart too, the counts after it are measured from another zero.
#[test]
fn an_index_that_is_no_longer_seen_is_a_lost_zero() {
    let (mut motors, lines) = two_lines();
    let lost: Vec<bool> = [false, true, true, false, false, true]
        .into_iter()
        .enumerate()
        .map(|(tick, index_seen)| {
            let mut heard = reading(tick as u32, 10);
            heard.reading.as_mut().expect("a reading").joints[1].index_seen = index_seen;
            lines[1].reports(heard);
            motors.receive(0, tick as u32 + 1).zeros_lost
        })
        .collect();
    assert_eq!(lost, [false, false, false, true, false, false]);
}

/// A line that was lost for long comes back with controllers whose watchdog has indeed expired.
#[test]
fn a_watchdog_that_a_reopened_line_reports_itself_is_reported() {
    let (mut motors, lines) = two_lines();
    lines.iter().for_each(|line| line.reports(reading(4, 10)));
    motors.receive(0, 5);
    let complaints = Complaints { watchdog: true, ..Complaints::default() };
    lines[0].reports(Heard { reopened: true, complaints, ..reading(5, 10) });
    assert_eq!(motors.receive(0, 6).feedback.expect("a reading").complaints, complaints);
}

/// Returns the prototype's rig with zero offsets of the first wheel's joints, gears and signs.
fn offset_rig(offsets: [f64; 2], gear: f64, reversed: bool) -> RigConfig {
    let mut config = RigConfig::prototype();
    config.zero_offsets[..2].copy_from_slice(&offsets);
    let altered: Result<Rig, _> = config.rig.with(|parts| {
        for joint in &mut parts.joints {
            (joint.gear, joint.reversed) = (gear, reversed);
        }
    });
    config.rig = altered.expect("a legal rig");
    config
}

/// When the encoder reads zero, the joint is at its zero offset. This holds for any gear and sign,
/// because the offset is in counts of the encoder.
#[test]
fn a_joint_whose_encoder_reads_zero_is_at_its_zero_offset() {
    for (gear, reversed) in [(1.0, false), (1.0, true), (17.0, false), (17.0, true)] {
        let config = offset_rig([0.5, 0.7], gear, reversed);
        let layout = Layout::of(&config);
        let line = ScriptedBus::default();
        let mut motors = Motors::new(vec![Box::new(line.clone())], &layout, WATCHDOG_MS);
        line.reports(reading(0, 0));
        let counts = motors.receive(0, 1).feedback.expect("a reading").counts;
        let count = config.rig.joints[0].radians_per_count();
        assert_eq!(count < 0.0, reversed);
        // The offset is rounded to a count.
        let angle = f64::from(counts[0]) * count;
        assert!((angle - 0.5).abs() <= 0.5 * count.abs(), "gear {gear}, reversed {reversed}: {angle} rad");
        // A drive joint needs no zero, so its offset has no effect. The bus numbers it 1.
        assert_eq!(counts[1], 1, "gear {gear}, reversed {reversed}");
        assert_eq!(counts[2], 2, "the other wheel has no offset");
    }
}

/// Counts wrap at 32 bits, and so does the sum of a count and its offset.
#[test]
fn a_zero_offset_wraps_like_the_counter() {
    let layout = Layout::of(&offset_rig([0.5, 0.0], 1.0, false));
    let line = ScriptedBus::default();
    let mut motors = Motors::new(vec![Box::new(line.clone())], &layout, WATCHDOG_MS);
    line.reports(reading(0, i32::MAX));
    let counts = motors.receive(0, 1).feedback.expect("a reading").counts;
    assert!(counts[0] < 0, "{}", counts[0]);
    assert_eq!(counts[0].wrapping_sub(i32::MAX), layout.offsets[0]);
}

fn layout_of(ports: [usize; 4], controllers: [usize; 4]) -> Layout {
    let mut config = RigConfig::prototype();
    config.link.port = Port::Devices(vec!["/dev/one".to_owned(), "/dev/two".to_owned()]);
    (config.ports, config.controllers) = (ports.to_vec(), controllers.to_vec());
    Layout::of(&config)
}

/// On each line the joints have the order of their controllers, whatever the other line has.
#[test]
fn joints_of_several_ports_have_the_order_of_their_controllers_on_each() {
    for (ports, controllers, order) in [
        ([0, 0, 1, 1], [0, 1, 0, 1], [0, 1, 0, 1]),
        ([0, 1, 1, 0], [7, 3, 9, 2], [1, 0, 1, 0]),
        // Both lines have controllers of the same number.
        ([0, 1, 0, 1], [5, 5, 4, 6], [1, 0, 0, 1]),
        ([1, 1, 1, 0], [30, 20, 10, 40], [2, 1, 0, 0]),
        ([0, 0, 0, 0], [3, 1, 2, 0], [3, 1, 2, 0]),
    ] {
        let layout = layout_of(ports, controllers);
        let place =
            |joint: usize| JointPlace { bus: ports[joint], at: order[joint], id: controllers[joint] as u8 };
        assert_eq!(layout.places, [0, 1, 2, 3].map(place), "{ports:?}, {controllers:?}");
        assert_eq!(layout.buses(), 1 + ports.iter().max().expect("four"));
    }
}

/// Simulated controllers are on one line, in the order of the joints. Their ids count up from the
/// first id that their protocol allows.
#[test]
fn simulated_controllers_have_the_first_ids_of_their_protocol() {
    for (protocol, first) in [(Protocol::Hbot, 0), (Protocol::Moteus, 1), (Protocol::Odrive, 0)] {
        let mut config = RigConfig::prototype();
        (config.link.port, config.link.protocol) = (Port::Sim, protocol);
        let places: Vec<_> = (first..).zip(0..4).map(|(id, at)| JointPlace { bus: 0, at, id }).collect();
        assert_eq!(Layout::of(&config).places, places, "{protocol:?}");
    }
}

#[test]
fn motors_have_answered_as_soon_as_one_line_has() {
    for which in [0, 1] {
        let (mut motors, lines) = two_lines();
        assert_eq!((motors.buses(), motors.has_answered()), (2, false));
        lines[which].reports(reading(4, 10));
        motors.receive(0, 5);
        assert!(motors.has_answered());
        let counts = [[10, 11, 0, 0], [0, 0, 11, 10]][which];
        assert_eq!(motors.readings().counts[..4], counts, "in the order of the rig");
    }
}

#[test]
fn telemetry_has_the_order_of_the_rig() {
    let (mut motors, _lines) = two_lines();
    let told: Vec<_> = (0..5).map(|_| motors.next_telemetry(7)).collect();
    let joints: Vec<_> = told.iter().map(|(joint, _)| *joint).collect();
    assert_eq!(joints, [1, 2, 3, 0, 1], "the joints take turns");
    // The second wheel's joints are in the order drive, steer on their bus.
    let currents: Vec<_> = told[..4].iter().map(|(_, telemetry)| telemetry.current).collect();
    assert_eq!(currents, [Some(11.0), Some(11.0), Some(10.0), Some(10.0)]);
}
