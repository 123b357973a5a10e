//! The limits at which a bad link, clock or encoder becomes a fault.

use crate::prelude::*;

#[test]
fn ten_skipped_ticks_in_a_row_are_a_fault_and_nine_are_not() {
    let skip = |n: u64| {
        let mut bench = active();
        bench.tick += n;
        bench.step().state.cause
    };
    assert_eq!(skip(9), None);
    assert_eq!(skip(10), Some(Cause::Deadline));
    assert_eq!(skip(u64::MAX / 2), Some(Cause::Deadline));
}

#[test]
fn a_link_is_lost_after_its_time_out_and_not_before() {
    for timeout in [1, 20, 100] {
        let rig = altered(&rig(), |rig| rig.timing.timeout_ticks = timeout);
        let mut bench = Bench::active(rig, CompiledScene::empty());
        // This many ticks can lack feedback. With one more the link is lost.
        for k in 1..=timeout {
            assert_eq!(bench.deaf().state.cause, None, "{k} of {timeout} ticks without feedback");
        }
        assert_eq!(bench.deaf().state.cause, Some(Cause::LinkLost));
        assert!(matches!(bench.command(Command::Reset).reply(), Reply::Done), "feedback is back");
    }
}

#[test]
fn skipped_ticks_count_as_ticks_without_feedback() {
    let mut bench = active();
    bench.deaf();
    bench.tick += 9;
    assert_eq!(bench.deaf().state.cause, None);
    bench.tick += 9;
    assert_eq!(bench.deaf().state.cause, Some(Cause::LinkLost), "21 ticks");
}

#[test]
fn a_rig_that_never_answers_is_a_lost_link_too() {
    let mut bench = Bench::new(rig());
    let last = (0..25).map(|_| bench.deaf()).last().unwrap();
    assert_eq!(last.state.cause, Some(Cause::LinkLost));
    assert_eq!(bench.command(Command::Reset).state.mode, Mode::Unreferenced);
    assert_eq!(bench.step().state.mode, Mode::Idle);
}

#[test]
fn readings_that_answer_too_old_a_command_are_a_lost_link_for_as_long_as_they_do() {
    for (late, lost) in [(18, false), (19, false), (20, true), (30, true), (100, true)] {
        let mut bench = active();
        let mut line = std::collections::VecDeque::new();
        let mut cause = None;
        for k in 0..400_u32 {
            line.push_back(bench.feedback());
            // The delay increases slowly, so that no gap is long.
            let now = line.len() as u32 > late.min(k / 4);
            let reading = if now { line.pop_front() } else { None };
            cause = bench.step_with(|inputs| inputs.feedback = reading).state.cause;
        }
        assert_eq!(cause, lost.then_some(Cause::LinkLost), "{late} ticks late");
        if lost {
            assert_eq!(bench.command(Command::Reset).reply(), Reply::Done, "news again");
        }
    }
}

#[test]
fn one_reading_in_twenty_for_ever_is_a_lost_link_and_one_in_five_is_not() {
    for (every, lost) in [(20, true), (10, true), (5, false), (2, false)] {
        let mut bench = active();
        let cause =
            (0..2000).find_map(|k| if k % every == 0 { bench.step() } else { bench.deaf() }.state.cause);
        assert_eq!(cause, lost.then_some(Cause::LinkLost), "one in {every}");
    }
}

#[test]
fn missing_readings_add_up_to_a_lost_link_above_five_times_the_time_out() {
    // In ten ticks nine readings are missing, and the one that arrives makes up for four. After 19
    // rounds 99 are missing. The reading of tick 190 takes off four. With the sixth missing reading
    // after it there are 101, which is above five times 20.
    let mut bench = active();
    let lost = (0..2000).find_map(|k| {
        let outputs = if k % 10 == 0 { bench.step() } else { bench.deaf() };
        outputs.state.cause.map(|cause| (k, cause))
    });
    assert_eq!(lost, Some((196, Cause::LinkLost)));
}

#[test]
fn after_any_silence_25_readings_make_a_link_good_again() {
    for silence in [201, 400, 5000] {
        let mut bench = active();
        let last = (0..silence).map(|_| bench.deaf()).last();
        assert_eq!(last.and_then(|outputs| outputs.state.cause), Some(Cause::LinkLost));
        // The count of missing readings is at most 200, and each reading takes off four.
        bench.run(23);
        assert!(matches!(bench.command(Command::Reset).reply(), Reply::Refused(_)), "{silence} ticks");
        assert_eq!(bench.command(Command::Reset).reply(), Reply::Done, "{silence} ticks");
    }
}

#[test]
fn a_tick_that_comes_again_is_no_missing_reading() {
    let mut bench = active();
    let now = bench.deaf().state.tick;
    for _ in 0..300 {
        let again = bench.step_with(|inputs| (inputs.tick, inputs.feedback) = (now, None));
        assert_eq!(again.state.cause, None);
    }
}
