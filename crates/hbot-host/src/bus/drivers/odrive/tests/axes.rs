//! Tests of the state of one axis with messages of known content at known times. A tick is one
//! millisecond.

mod commands;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use hbot_core::inputs::Complaints;

use super::super::axis::Axis;
use super::super::message::{Message, error, state};
use super::super::order::{Order, Times};

/// The error bit of a failed motor driver, which the driver has no name for.
const DRV_FAULT: u32 = 1 << 5;
/// The start of a command that sets the position of axis 1, message 0x39.
const POSITION: &str = "t0398";

/// Axis 1 after bring-up. The motors are commanded off since tick 0.
struct Bench {
    axis: Axis,
    order: Order,
    tick: u32,
}

impl Bench {
    fn new(gear: f64) -> Self {
        Self::proved(gear, false)
    }

    /// Returns an axis whose watchdog was proved with its motor on, if `armed` is true.
    fn proved(gear: f64, armed: bool) -> Self {
        let axis = Axis::new(1, gear, Times::new(&super::expected()), armed);
        Self { axis, order: Order::default(), tick: 0 }
    }

    /// Returns an axis whose motors have been commanded on in tick 0, and which is in closed loop
    /// since tick 1.
    fn pushing() -> Self {
        let mut bench = Self::new(17.0);
        bench.command(true);
        bench.beat(state::CLOSED_LOOP, 0);
        bench
    }

    fn hear(&mut self, message: Message) {
        self.axis.hear(u64::from(self.tick) * 1_000_000, self.tick, self.order, &message);
    }

    fn beat(&mut self, state: u8, error: u32) {
        self.hear(Message::Heartbeat { error, state, result: 0 });
    }

    fn at(&mut self, position: f32, velocity: f32) {
        self.hear(Message::Estimates { position, velocity });
    }

    fn complaints(&self) -> Complaints {
        self.axis.complaints(self.tick, self.order)
    }

    /// Sends the command of this tick, and begins the next tick. Returns the lines of text of the
    /// command.
    fn command(&mut self, on: bool) -> Vec<String> {
        if on != self.order.on {
            self.order = Order { on, since: self.tick };
        }
        let mut line = Vec::new();
        self.axis.command(self.tick, self.order, 0.034, &mut line);
        self.tick += 1;
        let text = String::from_utf8(line).expect("text");
        text.split_terminator('\r').map(str::to_owned).collect()
    }

    fn commands_until(&mut self, tick: u32, on: bool) {
        while self.tick < tick {
            self.command(on);
        }
    }
}

#[test]
fn the_rate_of_a_joint_is_that_of_its_encoder_behind_the_gear() {
    for (gear, velocity, rate) in [(17.0, 17.0, TAU), (17.0, -8.5, -PI), (1.0, 0.25, FRAC_PI_2)] {
        let mut bench = Bench::new(gear);
        bench.at(40.0, velocity);
        assert!((bench.axis.rate() - rate).abs() < 1e-12, "{}", bench.axis.rate());
    }
}

#[test]
fn currents_and_temperatures_above_their_limits_and_values_that_are_no_numbers_are_complaints() {
    let complaints = |message| {
        let mut bench = Bench::new(1.0);
        bench.hear(message);
        bench.complaints()
    };
    for (measured, setpoint, not_finite, overcurrent) in [
        (1000.0, -1000.0, false, false),
        (1000.5, 0.0, false, true),
        (-1000.5, 0.0, false, true),
        (0.0, 1000.5, false, true),
        (0.0, -1000.5, false, true),
        (f32::NAN, 0.0, true, false),
        (0.0, f32::NAN, true, false),
        (f32::INFINITY, 0.0, true, true),
    ] {
        assert_eq!(
            complaints(Message::Current { measured, setpoint }),
            Complaints { not_finite, overcurrent, ..Complaints::default() },
            "{measured} A, {setpoint} A"
        );
    }
    for (inverter, motor, overtemperature) in [
        (150.0, 150.0, false),
        (150.5, 25.0, true),
        (25.0, 150.5, true),
        (150.5, f32::NAN, true),
        (25.0, f32::NAN, false),
    ] {
        assert_eq!(
            complaints(Message::Temperature { inverter, motor }),
            Complaints { overtemperature, ..Complaints::default() },
            "{inverter} °C, {motor} °C"
        );
    }
}

#[test]
fn a_position_or_velocity_that_is_no_number_is_a_complaint_and_is_not_used() {
    for (position, velocity) in [(f32::NAN, 0.5), (4.0, f32::NAN), (f32::INFINITY, 0.5), (4.0, f32::INFINITY)]
    {
        let mut bench = Bench::new(1.0);
        bench.at(3.25, 0.5);
        bench.at(position, velocity);
        assert!(bench.complaints().not_finite, "{position} turns, {velocity} turns/s");
        // The mark is at three turns. The quarter of a turn beyond it is 2^19 counts.
        assert_eq!(bench.axis.count(), 1 << 19);
        assert!((bench.axis.rate() - PI).abs() < 1e-12, "{}", bench.axis.rate());
        bench.at(3.25, 0.5);
        assert_eq!(bench.complaints(), Complaints::default());
    }
}

#[test]
fn error_bits_of_currents_and_temperatures_are_complaints_of_their_kind() {
    for (bit, overcurrent, overtemperature) in [
        (DRV_FAULT, false, false),
        (error::DC_BUS_OVER_CURRENT, true, false),
        (error::CURRENT_LIMIT_VIOLATION, true, false),
        (error::MOTOR_OVER_TEMP, false, true),
        (error::INVERTER_OVER_TEMP, false, true),
    ] {
        let mut bench = Bench::new(1.0);
        bench.beat(state::IDLE, bit);
        let right = Complaints { fault: true, overcurrent, overtemperature, ..Complaints::default() };
        assert_eq!(bench.complaints(), right, "{bit:#x}");
    }
}

#[test]
fn an_expired_watchdog_is_excused_for_a_tenth_of_a_second() {
    let mut bench = Bench::new(1.0);
    bench.axis.excuse(0);
    bench.beat(state::IDLE, error::WATCHDOG_TIMER_EXPIRED);
    for (tick, watchdog) in [(0, false), (99, false), (100, true), (1000, true)] {
        bench.tick = tick;
        assert_eq!(bench.complaints(), Complaints { watchdog, ..Complaints::default() }, "tick {tick}");
    }
}

/// Steps between neighbouring `f32` numbers grow from 2^-14 to 2^-13 turns at 1024 turns. The
/// widest accepted steps are 2^-13 turns of the joint. At 1024 turns, the driver's upper bound for
/// them is exact.
#[test]
fn a_position_beyond_1024_turns_of_the_joint_is_a_fault() {
    for (gear, turns) in [(1.0, 1024.0_f32), (17.0, 17.0 * 1024.0)] {
        for (position, fault) in
            [(turns, false), (turns.next_up(), true), (-turns, false), (-2.0 * turns, true)]
        {
            let mut bench = Bench::new(gear);
            bench.at(position, 0.0);
            assert_eq!(bench.complaints(), Complaints { fault, ..Complaints::default() }, "{position}");
        }
    }
}

#[test]
fn a_motor_that_does_not_obey_in_time_is_a_complaint() {
    let disobeyed = |bench: &mut Bench, tick: u32| {
        bench.tick = tick;
        let complaints = bench.complaints();
        assert_eq!(Complaints { disobeyed: false, ..complaints }, Complaints::default(), "tick {tick}");
        complaints.disobeyed
    };
    // It stays on for more than 20 ms.
    let mut stays_on = Bench::pushing();
    stays_on.commands_until(50, true);
    stays_on.command(false);
    for (tick, complains) in [(51, false), (70, false), (71, true), (72, true), (1000, true)] {
        assert_eq!(disobeyed(&mut stays_on, tick), complains, "off since tick 50, on in tick {tick}");
    }
    // It is not on after 300 ms.
    let mut stays_off = Bench::new(17.0);
    stays_off.command(true);
    stays_off.beat(state::IDLE, 0);
    for (tick, complains) in [(1, false), (300, false), (301, true), (302, true), (1000, true)] {
        assert_eq!(disobeyed(&mut stays_off, tick), complains, "on since tick 0, off in tick {tick}");
    }
    // It was on, and is off again.
    let mut ends = Bench::pushing();
    ends.commands_until(15, true);
    ends.beat(state::IDLE, 0);
    assert!(disobeyed(&mut ends, 15));
    // An error explains why a motor is off.
    ends.beat(state::IDLE, DRV_FAULT);
    assert_eq!(ends.complaints(), Complaints { fault: true, ..Complaints::default() });
}

#[test]
fn a_motor_that_goes_off_without_an_error_may_have_restarted() {
    for (tick, error, lost) in [(20, 0, false), (21, 0, true), (500, 0, true), (500, DRV_FAULT, false)] {
        let mut bench = Bench::pushing();
        bench.commands_until(tick, true);
        bench.beat(state::IDLE, error);
        assert_eq!(bench.axis.is_lost(), lost, "tick {tick}, error {error:#x}");
        if lost {
            assert!(bench.command(true).is_empty(), "its watchdog must expire");
        }
    }
    // An axis that takes long to switch its motor on has not restarted.
    let mut slow = Bench::new(17.0);
    slow.commands_until(100, true);
    slow.beat(state::IDLE, 0);
    assert!(!slow.axis.is_lost());
}

#[test]
fn an_axis_whose_firmware_starts_has_restarted() {
    for (state, error, lost) in [
        (state::IDLE, 0, false),
        (state::UNDEFINED, 0, true),
        (state::IDLE, error::INITIALIZING, true),
        (state::UNDEFINED, error::INITIALIZING, true),
        (state::IDLE, DRV_FAULT, false),
    ] {
        let mut bench = Bench::new(1.0);
        bench.beat(state, error);
        assert_eq!(bench.axis.is_lost(), lost, "state {state}, error {error:#x}");
    }
}

/// A jump is a difference of more than half a turn from the position that the velocities predict. A
/// position within one and a half turns of 0 can be that of an axis that has restarted.
#[test]
fn a_jump_or_a_silence_shows_a_restart() {
    for (from, silent_ms, to, lost) in [
        (3.0, 1, 3.5, false),
        (3.0, 1, 3.75, true),
        (3.0, 1, 2.25, true),
        (3.0, 10, 5.0, true),
        // After more than 10 ms, the axis may have turned.
        (3.0, 11, 5.0, false),
        (3.0, 11, 1.5, true),
        (3.0, 100, 0.0, true),
        // After more than 250 ms, it may have restarted at the position where it was.
        (1.0, 100, 1.0, false),
        (1.0, 250, 1.0, false),
        (1.0, 251, 1.0, true),
        (1.0, 1000, 1.0, true),
        (3.0, 1000, 3.0, false),
    ] {
        let mut bench = Bench::new(1.0);
        // It turns there within 0.1 s.
        bench.at(3.0, 20.0 * (from - 3.0));
        bench.tick += 100;
        bench.at(from, 0.0);
        bench.tick += silent_ms;
        bench.at(to, 0.0);
        assert_eq!(bench.axis.is_lost(), lost, "from {from} to {to} in {silent_ms} ms");
    }
    // Bring-up has marked it. What is near 0 then has restarted since.
    let mut restarted = Bench::new(1.0);
    restarted.at(0.5, 0.0);
    assert!(restarted.axis.is_lost());
    // 100 turns per second for 10 ms are one turn.
    let mut turning = Bench::new(1.0);
    turning.at(3.0, 100.0);
    turning.tick += 10;
    turning.at(4.0, 100.0);
    assert!(!turning.axis.is_lost());
}

/// The count wraps at 1024 turns of the encoder, which are no whole turns of this joint.
#[test]
fn the_first_position_is_counted_from_the_mark_without_whole_turns_of_the_joint_if_it_is_far() {
    let mark = super::super::axis::mark(17.0);
    for (turns, counted) in [(510.0, 510.0), (1700.25, 0.25), (-1700.25, -0.25)] {
        let mut bench = Bench::new(17.0);
        bench.at((mark + turns) as f32, 0.0);
        assert_eq!(f64::from(bench.axis.count()), counted * f64::from(1 << 21), "{turns}");
    }
}

/// The mark of a gear of 1 is at three turns.
#[test]
fn a_move_of_the_position_is_no_restart_and_leaves_the_count() {
    for (position, turns) in [(4.0, 1_i32), (9.0, 6), (63.0, 60), (-47.0, -50)] {
        let moved = || {
            let mut bench = Bench::new(1.0);
            bench.tick = 99;
            bench.beat(state::IDLE, 0);
            bench.at(position, 0.0);
            assert_eq!(bench.axis.count(), turns << 21);
            let right = format!("{POSITION}0000404000000000");
            assert_eq!(bench.command(false)[1..], [right], "to three turns");
            bench
        };
        let mut bench = moved();
        bench.at(3.0, 0.0);
        assert_eq!((bench.axis.count(), bench.axis.is_lost()), (turns << 21, false), "{position}");
        // It counts once.
        bench.tick += 1;
        bench.at(3.0, 0.0);
        assert_eq!((bench.axis.count(), bench.axis.is_lost()), (turns << 21, false), "{position}");
        // A joint can turn during the move, but not by as much as half of the move.
        let middle = position - turns as f32 / 2.0;
        let mut turned = moved();
        turned.at(middle - 0.25 * turns.signum() as f32, 0.0);
        assert!(!turned.axis.is_lost(), "{position}: a quarter of a turn beyond the middle");
        let mut half = moved();
        half.at(middle, 0.0);
        assert_eq!(half.axis.is_lost(), turns != 1, "{position}: half a turn is no jump, more is one");
    }
}

#[test]
fn an_axis_on_a_line_that_was_reopened_begins_anew_and_its_count_goes_on() {
    let mut bench = Bench::new(1.0);
    bench.tick = 99;
    bench.beat(state::IDLE, 0);
    bench.at(4.0, 0.0);
    bench.command(false);
    bench.at(3.0, 0.0);
    bench.beat(state::IDLE, DRV_FAULT);
    assert_eq!(bench.complaints(), Complaints { fault: true, ..Complaints::default() });
    bench.axis.met_again();
    assert_eq!(bench.complaints(), Complaints::default());
    assert_eq!(bench.axis.count(), 1 << 21);
    // It was turned while the line was lost.
    bench.tick += 1;
    bench.at(5.0, 0.0);
    assert_eq!((bench.axis.count(), bench.axis.is_lost()), (3 << 21, false));
    // Bring-up has shown that the watchdog works.
    bench.beat(state::UNDEFINED, 0);
    assert!(bench.axis.is_lost());
    bench.axis.met_again();
    assert!(!bench.axis.is_lost());
}
