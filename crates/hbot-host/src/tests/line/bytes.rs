//! Tests of a bus of hbot's own link and its line, without an engine: which answers are readings,
//! how much is read in a tick, and what is written after a command that was cut.

use super::*;
use crate::tests::scripted::{Bytes, ScriptedLine};

fn good(sequence: u32) -> Vec<u8> {
    answer(sequence, ControllerFlags::ENABLED, 4, None)
}

/// The loop reads before it sends the command of its tick. So an answer to this command cannot come
/// from the rig's controllers, also in the first tick and where the number wraps to 0.
#[test]
fn an_answer_to_the_command_that_is_about_to_be_sent_is_no_reading() {
    for tick in [0, 1, 1000, i32::MAX as u32, u32::MAX] {
        let (mut bus, fake) = bus_and_line();
        let early = read(&mut *bus, &fake, tick, &good(tick));
        assert_eq!((early.reading, early.foreign), (None, 1), "tick {tick}");
        // In the next tick it has been sent.
        let heard = read(&mut *bus, &fake, tick.wrapping_add(1), &good(tick));
        assert_eq!(heard.reading.map(|reading| reading.answers), Some(tick));
        assert_eq!(heard.foreign, 0, "tick {tick}");
    }
}

#[test]
fn an_answer_that_comes_twice_or_late_is_no_second_reading() {
    for tick in [100, 1, u32::MAX] {
        let (mut bus, fake) = bus_and_line();
        let sequence = tick.wrapping_sub(1);
        assert!(read(&mut *bus, &fake, tick, &good(sequence)).reading.is_some());
        for old in [sequence, sequence.wrapping_sub(1), sequence.wrapping_sub(500)] {
            let heard = read(&mut *bus, &fake, tick.wrapping_add(1), &good(old));
            assert_eq!((heard.reading, heard.foreign, heard.damaged), (None, 0, 0), "{old} in tick {tick}");
        }
        assert!(read(&mut *bus, &fake, tick.wrapping_add(2), &good(tick)).reading.is_some());
    }
}

fn bus(line: &ScriptedLine) -> Box<dyn MotorBus> {
    let expected = Expected::new("test", &RigConfig::prototype().rig, &Layout::single(0..4), 0);
    HbotLink.bus(Box::new(line.clone()), expected)
}

/// After a time in which the loop stood still, many answers wait. The newest is found in the next
/// tick, unless more than four reads of 4096 bytes are waiting. A line with little to say is read
/// once.
#[test]
fn what_waits_on_a_line_is_read_in_one_tick() {
    let frame = good(0).len();
    for (bytes, reads) in [(0, 1), (1000, 1), (4000, 1), (5000, 2), (9000, 3), (13_000, 4), (16_000, 4)] {
        let line = ScriptedLine::default();
        let mut bus = bus(&line);
        let answers = bytes / frame;
        line.end().arrived = (0..answers as u32).flat_map(good).collect();
        let heard = bus.receive(0, 1000);
        let newest = heard.reading.map(|reading| reading.answers as usize + 1);
        assert_eq!((newest.unwrap_or(0), heard.damaged), (answers, 0), "{bytes} bytes");
        assert_eq!(line.end().reads, reads, "{bytes} bytes");
    }
    // A line that never falls silent does not hold the tick up.
    let line = ScriptedLine::default();
    let mut bus = bus(&line);
    let all: Vec<u8> = (0..1000).flat_map(good).collect();
    line.end().arrived.clone_from(&all);
    bus.receive(0, 5000);
    let end = line.end();
    assert_eq!((end.reads, end.arrived.len()), (4, all.len() - 4 * 4096));
}

/// One zero byte ends a frame that was cut. Without a cut there is none.
#[test]
fn a_zero_byte_follows_a_command_that_was_cut_and_no_other() {
    let line = ScriptedLine::default();
    let mut bus = bus(&line);
    let mut written = |tick: u32, room: Option<usize>| {
        *line.end() = Bytes { room, ..Bytes::default() };
        let command =
            BusCommand { tick, enable: true, watchdog_ms: 20, torque: [0.25; hbot_core::MAX_JOINTS] };
        let whole = bus.command(0, &command);
        (whole, std::mem::take(&mut line.end().written))
    };
    let (whole, frame) = written(7, None);
    assert!(whole && frame.last() == Some(&0) && frame[0] != 0, "{frame:?}");
    // The line takes a part, then nothing, not even the zero byte.
    assert_eq!(written(7, Some(5)), (false, frame[..5].to_vec()));
    assert_eq!(written(7, Some(0)), (false, Vec::new()));
    assert_eq!(written(7, None), (true, [&[0][..], &frame].concat()));
    assert_eq!(written(7, None), (true, frame.clone()), "the line is in order again");
    assert_eq!(written(7, Some(frame.len() - 1)), (false, frame[..frame.len() - 1].to_vec()));
    assert_eq!(written(7, None), (true, [&[0][..], &frame].concat()));
    assert_eq!(written(7, None), (true, frame));
}

/// Controllers that have lost power are asked in every hundredth tick. Others are not asked,
/// because the question and its answer take time on the line.
#[test]
fn only_controllers_that_lost_power_are_asked_to_describe_themselves_and_rarely() {
    for (flags, asked) in [(ControllerFlags::default(), 0), (ControllerFlags::UNDESCRIBED, 10)] {
        let (mut bus, fake) = bus_and_line();
        for tick in 1..=1000 {
            read(&mut *bus, &fake, tick, &answer(tick - 1, flags, 4, None));
            let torque = [0.0; hbot_core::MAX_JOINTS];
            assert!(bus.command(0, &BusCommand { tick, enable: false, watchdog_ms: 20, torque }));
        }
        assert_eq!(fake.with(|far| far.asked), asked, "{flags:?}");
    }
}

/// The line ends its helper process when it learns that the motors are off.
#[test]
fn the_line_learns_that_the_motors_are_off() {
    let line = ScriptedLine::default();
    let mut bus = bus(&line);
    bus.receive(0, 1);
    assert_eq!(line.end().released, 0);
    bus.release();
    assert_eq!(line.end().released, 1);
}
