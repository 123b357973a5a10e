//! Tests of what the engine reports of a tick (times, counters), of the last commands, and of which
//! ticks a loop does, with a bus that takes time and that a test scripts.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use hbot_config::RigConfig;
use hbot_core::MAX_JOINTS;
use hbot_core::design::rig::RateEstimate;
use hbot_sim::socket::SharedTime;

use crate::bus::{Heard, JointReading, Reading};
use crate::rig::layout::Layout;
use crate::run_loop::clock::{Origin, now_ns};
use crate::run_loop::engine::{Engine, TickTime};
use crate::run_loop::{Ended, Schedule, StopFlag, lockstep, wall};
use crate::tests::scripted::{Script, ScriptedBus};
use crate::tests::tick_bench::{TickBench, default_scene, on_time};

fn bench() -> (TickBench, ScriptedBus) {
    let bus = ScriptedBus::default();
    let (rig, layout) = (RigConfig::prototype(), Layout::single(0..4));
    (TickBench::new(&rig, vec![Box::new(bus.clone())], &layout, default_scene()), bus)
}

/// The times of a sample: those of the loop are passed on, and those of the tick itself are
/// measured. This test sleeps because time is its subject.
#[test]
fn the_times_of_a_tick_are_those_of_its_line_and_of_its_computing() {
    let (mut bench, bus) = bench();
    let takes = [Duration::from_millis(3), Duration::from_millis(8)];
    bus.script().takes = takes;
    let moment = TickTime { tick: 3, t_ns: 3_000_000, awake_ns: 11, lateness_ns: 22, late: true, skipped: 2 };
    let begun = Instant::now();
    bench.engine.tick(&moment);
    let whole = begun.elapsed().as_nanos() as u64;
    let sample = bench.end.try_sample().expect("a sample");
    let timing = sample.timing;
    assert_eq!((sample.t_ns, timing.awake_ns, timing.lateness_ns, timing.age_ns), (3_000_000, 11, 22, None));
    let [read, write] = takes.map(|time| time.as_nanos() as u64);
    assert!(timing.line_ns >= read + write, "{} ns on the line", timing.line_ns);
    // A tick takes some hundred nanoseconds in a release build.
    assert!(timing.compute_ns > 50, "{} ns of computing", timing.compute_ns);
    assert!(timing.line_ns + timing.compute_ns <= whole, "{timing:?} of {whole} ns");
}

#[test]
fn what_happens_in_ticks_is_counted_from_tick_to_tick() {
    let (mut bench, bus) = bench();
    let report = Heard { damaged: 4, foreign: 5, reopened: true, ..Heard::default() };
    {
        let mut script = bus.script();
        (script.report, script.lasts, script.refuses) = (report, true, true);
    }
    for tick in 0..3 {
        bench.engine.tick(&TickTime { late: true, skipped: 2, ..on_time(3 * tick) });
    }
    *bus.script() = Script::default();
    bench.engine.tick(&on_time(9));
    let last = std::iter::from_fn(|| bench.end.try_sample()).last().expect("samples");
    let counted = last.counters;
    assert_eq!((counted.late, counted.skipped, counted.missed), (3, 6, 4));
    assert_eq!((counted.corrupt_frames, counted.foreign_frames, counted.reopened), (12, 15, 3));
    assert_eq!((counted.send_failures, counted.dropped_samples), (3, 0));
}

/// Joints that turn evenly, with rates that the core computes from their angles. A command that is
/// sent late is answered as late.
#[test]
fn a_tick_that_is_late_does_not_make_the_joints_look_fast() {
    const COUNTS_PER_TICK: f64 = 40.0;
    for rate in [RateEstimate::Difference, RateEstimate::Kalman { acceleration: 300.0 }] {
        let mut rig = RigConfig::prototype();
        rig.rig = rig.rig.with(|parts| parts.methods.rate = rate).expect("legal");
        let per_count = rig.rig.joints[0].radians_per_count().abs();
        let bus = ScriptedBus::default();
        let mut bench =
            TickBench::new(&rig, vec![Box::new(bus.clone())], &Layout::single(0..4), default_scene());
        let turning = COUNTS_PER_TICK * per_count / 1e-3;
        // When the last command was sent, in ticks.
        let mut sent: Option<(u32, f64)> = None;
        // Tick 100 begins 4.5 ms late, so that four ticks are left out.
        for tick in (0..=100).chain(105..200_u64) {
            if let Some((answers, at)) = sent {
                let reading =
                    JointReading { count: (COUNTS_PER_TICK * at) as i32, ..JointReading::default() };
                bus.reports(Heard {
                    reading: Some(Reading { answers, joints: [reading; MAX_JOINTS] }),
                    ..Heard::default()
                });
            }
            let lateness_ns = if tick == 100 { 4_500_000 } else { 0 };
            let skipped = if tick == 105 { 4 } else { 0 };
            bench.engine.tick(&TickTime { lateness_ns, skipped, ..on_time(tick) });
            sent = Some((tick as u32, tick as f64 + lateness_ns as f64 * 1e-6));
            let state = bench.end.try_sample().expect("a sample").state;
            if tick > 20 {
                let ratio = state.rate[0].abs() / turning;
                assert!((0.9..1.1).contains(&ratio), "{rate:?}, tick {tick}: {ratio} of the true rate");
            }
        }
    }
}

#[test]
fn samples_that_find_no_place_are_counted() {
    let (mut bench, _bus) = bench();
    // The ring has room for 4096 samples.
    for tick in 0..4101 {
        bench.engine.tick(&on_time(tick));
    }
    assert!(bench.engine.bridge().is_full());
    let first = bench.end.try_sample().expect("a sample");
    assert_eq!((first.state.tick, first.counters.dropped_samples), (0, 0));
    assert!(!bench.engine.bridge().is_full());
    bench.engine.tick(&on_time(4101));
    let last = std::iter::from_fn(|| bench.end.try_sample()).last().expect("samples");
    // Ticks 4096 to 4100 found no place.
    assert_eq!((last.state.tick, last.counters.dropped_samples), (4101, 5));
}

#[test]
fn the_last_sample_has_all_counts_though_the_service_slept() {
    let (mut bench, _bus) = bench();
    for tick in 0..5000 {
        bench.engine.tick(&on_time(tick));
    }
    let mut end = bench.end;
    let service = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(50));
        std::iter::repeat_with(|| end.try_sample()).flatten().find(|sample| sample.state.tick == 4999)
    });
    bench.engine.stop(5000, Duration::ZERO);
    let last = service.join().expect("no panic").expect("the last sample");
    assert_eq!(last.counters.dropped_samples, 903);
}

/// Three commands switch the motors off, `pause` apart, in case a frame is damaged. Their numbers
/// and times go on from those of the last tick. This test sleeps because time is its subject.
#[test]
fn the_last_commands_are_three_with_a_pause_between_them() {
    for first in [42, u32::MAX] {
        let pause = Duration::from_millis(40);
        // The first command goes out at once. A busy machine can hold it up, but not each time.
        let at_once = (0..50).any(|_| {
            let (mut bench, bus) = bench();
            bench.engine.tick(&on_time(41));
            *bus.script() = Script { refuses: true, ..Script::default() };
            let begun = Instant::now();
            bench.engine.stop(first, pause);
            assert_eq!(bench.engine.counters().send_failures, 3);
            let script = bus.script();
            // What the line has not taken is left to the helper process.
            assert_eq!((script.commands.len(), script.released), (3, 0));
            for (k, (command, now_ns, _)) in script.commands.iter().enumerate() {
                assert_eq!(command.tick, first.wrapping_add(k as u32));
                assert!(!command.enable && command.torque == [0.0; MAX_JOINTS], "{command:?}");
                assert_eq!(*now_ns, 41_000_000 + k as u64 * 40_000_000);
            }
            let came = [0, 1, 2].map(|k: usize| script.commands[k].2);
            assert!(came[1] - came[0] >= pause && came[2] - came[1] >= pause);
            came[0] - begun < pause
        });
        assert!(at_once, "a pause before the first command");
    }
}

/// A loop in virtual time does the ticks that it is asked for, without a gap, and then switches the
/// motors off.
#[test]
fn a_loop_in_virtual_time_ends_after_its_ticks() {
    for ticks in [0, 1, 700] {
        let (bench, bus) = bench();
        let TickBench { engine, mut end, .. } = bench;
        assert_eq!(lockstep(engine, 500_000, Some(ticks), &StopFlag::default()), Ended::Stopped);
        let samples: Vec<_> = std::iter::from_fn(|| end.try_sample()).collect();
        let times: Vec<_> = samples.iter().map(|sample| (sample.state.tick, sample.t_ns)).collect();
        assert_eq!(times, (0..ticks).map(|tick| (tick, tick * 500_000)).collect::<Vec<_>>());
        assert!(end.is_over());
        let counted = samples.last().map(|sample| sample.counters).unwrap_or_default();
        assert_eq!((counted.late, counted.skipped, counted.missed), (0, 0, ticks));
        let numbers: Vec<_> = bus.script().commands.iter().map(|(it, ..)| it.tick).collect();
        assert_eq!(numbers, (0..ticks as u32 + 3).collect::<Vec<_>>(), "three more at the end");
    }
}

/// In virtual time the loop waits for whoever takes the samples, so that none is lost. It ends when
/// it is asked to, also while it waits.
#[test]
fn a_loop_in_virtual_time_waits_for_room_for_its_samples_until_it_is_stopped() {
    let (bench, _bus) = bench();
    let TickBench { engine, mut end, .. } = bench;
    let stop = StopFlag::default();
    let ended = std::thread::scope(|scope| {
        let flag = stop.clone();
        let running = scope.spawn(move || lockstep(engine, 1_000_000, None, &flag));
        // More samples than the ring holds.
        for tick in 0..6000 {
            let sample = hbot_testing::patience::until("a sample", || end.try_sample());
            assert_eq!((sample.state.tick, sample.counters.dropped_samples), (tick, 0));
        }
        hbot_testing::patience::eventually("the ring is full", || end.tick() == 6000 + 4095);
        assert!(!running.is_finished());
        stop.stop();
        running.join().expect("no panic")
    });
    assert_eq!(ended, Ended::Stopped);
    let left: Vec<_> = std::iter::from_fn(|| end.try_sample()).map(|sample| sample.state.tick).collect();
    assert!(left.into_iter().eq(6000..6000 + 4096) && end.is_over());
}

/// Runs a loop in wall-clock time until it ends, and returns how it ended and the time of tick 0.
/// The loop has its own thread, because it asks for real-time priority.
fn on_the_clock(engine: Engine, schedule: &Schedule) -> (Ended, Origin) {
    let mut origin = None;
    let run = || wall(engine, schedule, &StopFlag::default(), |_, at| origin = Some(at));
    let ended = std::thread::scope(|scope| scope.spawn(run).join().expect("no panic"));
    (ended, origin.expect("it is told before the first tick"))
}

/// A loop in wall-clock time does the ticks that it is asked for, none before its deadline, and
/// then switches the motors off. Its time waits here, as it does for a simulated rig, so a busy
/// machine leaves out no tick.
#[test]
fn a_loop_in_wall_clock_time_ends_after_its_ticks() {
    let period = Duration::from_millis(1);
    for ticks in [0, 1, 50] {
        let (bench, bus) = bench();
        let TickBench { engine, mut end, .. } = bench;
        let shared = Some(SharedTime::default());
        let schedule = Schedule { period_ns: 1_000_000, early_ns: 0, ticks: Some(ticks), shared };
        let (begun, begun_ns) = (Instant::now(), now_ns());
        let (ended, origin) = on_the_clock(engine, &schedule);
        assert_eq!(ended, Ended::Stopped);
        let ahead = origin.monotonic_ns.saturating_sub(begun_ns);
        assert!(ahead >= 1_000_000, "the first deadline is {ahead} ns ahead");
        let samples = std::iter::from_fn(|| end.try_sample());
        let times: Vec<_> = samples.map(|sample| (sample.state.tick, sample.t_ns)).collect();
        assert_eq!(times, (0..ticks).map(|tick| (tick, tick * 1_000_000)).collect::<Vec<_>>());
        assert!(end.is_over());
        let script = bus.script();
        let numbers: Vec<_> = script.commands.iter().map(|(it, ..)| it.tick).collect();
        assert_eq!(numbers, (0..ticks as u32 + 3).collect::<Vec<_>>(), "three more at the end");
        for (tick, (_, _, came)) in (0..ticks as u32).zip(&script.commands) {
            let after = *came - begun;
            assert!(after >= period * (tick + 1), "tick {tick} came after {after:?}");
        }
    }
}

/// A bus that takes 2.5 ms makes a loop of 1 ms leave out at least two ticks after each one.
#[test]
fn ticks_that_a_loop_in_wall_clock_time_leaves_out_are_counted() {
    let (bench, bus) = bench();
    bus.script().takes[0] = Duration::from_micros(2500);
    let TickBench { engine, mut end, .. } = bench;
    let schedule = Schedule { period_ns: 1_000_000, early_ns: 0, ticks: Some(60), shared: None };
    assert_eq!(on_the_clock(engine, &schedule).0, Ended::Stopped);
    let samples: Vec<_> = std::iter::from_fn(|| end.try_sample()).collect();
    for (done, sample) in (0_u64..).zip(&samples) {
        let (tick, skipped) = (sample.state.tick, sample.counters.skipped);
        assert_eq!((tick, sample.t_ns), (done + skipped, tick * 1_000_000));
        assert!(skipped >= 2 * done, "{skipped} before tick {tick}");
    }
    // The loop ends after the first tick with number 59 or more. Skipped ticks can take it beyond.
    let [before @ .., last] = &samples[..] else { panic!("no tick") };
    assert!(before.iter().all(|sample| sample.state.tick + 1 < 60));
    assert!(last.state.tick + 1 >= 60, "the last is tick {}", last.state.tick);
}

#[test]
fn a_stop_flag_is_one_flag_for_its_clones_and_for_signal_handlers() {
    let flag = StopFlag::default();
    assert!(!flag.is_set());
    flag.clone().shared().store(true, Ordering::Relaxed);
    assert!(flag.is_set() && !StopFlag::default().is_set());
}
