//! Tests of the built-in simulated rig in wall-clock time when loop or rig are held up, as on a
//! busy machine. A thread that sleeps stands for a thread that gets no processor.

use std::sync::mpsc;
use std::time::{Duration, Instant};

use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::safety::mode::{Cause, Mode};
use hbot_sim::phenomena::{Hand, Phenomena};
use hbot_testing::patience::until;

use crate::rig::host::{Host, HostOptions};
use crate::run_loop::Time;
use crate::run_loop::bridge::ServiceEnd;
use crate::run_loop::sample::Sample;

/// How long a thread is held up. It is five times the 20 ms of lateness that are a fault on a real
/// rig, and longer than the watchdog time of 50 ms of the simulated motor controllers.
const HELD_UP: Duration = Duration::from_millis(100);
/// The tick in which the loop is held up. The soft start has ended by then.
const HELD_TICK: u64 = 800;

/// Starts the loop on the built-in simulated rig, whose sphere a hand turns. `held_up` is how long
/// the loop is held up in tick [`HELD_TICK`].
fn start(held_up: Duration) -> (Host, ServiceEnd) {
    let options = HostOptions {
        rig: RigConfig::prototype(),
        built: None,
        scene: Box::new(RunningScene::new().load(SceneFile::default_scene())),
        phenomena: Phenomena { hand: Some(Hand::default()), ..Phenomena::default() },
        time: Time::Wall,
        ticks: None,
        buses: None,
        last_word: None,
        recorder: Some(Box::new(move |ticked| {
            if ticked.inputs.tick == HELD_TICK {
                std::thread::sleep(held_up);
            }
        })),
    };
    Host::start(options).expect("the simulated rig")
}

/// Waits for the first sample for which `wanted` is true. The ticks must have no gaps on the way.
fn sample_where(end: &mut ServiceEnd, next: &mut u64, wanted: impl Fn(&Sample) -> bool) -> Sample {
    until("a tick", || {
        let sample = end.try_sample()?;
        assert_eq!(sample.state.tick, *next, "a tick is missing");
        *next += 1;
        wanted(&sample).then_some(sample)
    })
}

fn sample_of(end: &mut ServiceEnd, next: &mut u64, tick: u64) -> Sample {
    sample_where(end, next, |sample| sample.state.tick >= tick)
}

#[test]
fn the_time_of_the_simulated_rig_waits_for_a_loop_that_is_held_up() {
    let (_host, mut end) = start(HELD_UP);
    let mut next = 0;
    let before = sample_of(&mut end, &mut next, HELD_TICK);
    assert_eq!(before.state.mode, Mode::Active);
    let after = sample_of(&mut end, &mut next, HELD_TICK + 1000);
    assert_eq!((after.state.mode, after.state.cause), (Mode::Active, None));
    // 100 ms are 100 ticks. The tick that was held up was itself in time.
    let skipped = after.counters.skipped - before.counters.skipped;
    assert!(skipped >= 99, "{skipped} skipped ticks are counted");
}

#[test]
fn the_loop_waits_for_a_simulated_rig_that_is_held_up() {
    let (host, mut end) = start(Duration::ZERO);
    let mut next = 0;
    let before = sample_of(&mut end, &mut next, HELD_TICK);
    let simulator = host.simulator().expect("a simulated rig");
    simulator.post(Box::new(|_| std::thread::sleep(HELD_UP)));
    // The rig is held up in the tick at which this request reaches it. 100 ms are 100 ticks. All
    // but two are skipped: one tick may have begun before the rig was held up, and one may end
    // after.
    let held =
        sample_where(&mut end, &mut next, |sample| sample.counters.skipped >= before.counters.skipped + 98);
    let after = sample_of(&mut end, &mut next, held.state.tick + 1000);
    assert_eq!((after.state.mode, after.state.cause), (Mode::Active, None));
    // The loop had no tick without a reading.
    assert_eq!(after.counters.missed, before.counters.missed);
}

#[test]
fn a_simulated_rig_whose_thread_has_ended_is_a_lost_link() {
    let (host, mut end) = start(Duration::ZERO);
    sample_of(&mut end, &mut 0, HELD_TICK);
    let simulator = host.simulator().expect("a simulated rig");
    simulator.post(Box::new(|_| panic!("this panic ends the rig's thread, as the test wants")));
    let cause = until("a fault", || end.try_sample()?.state.cause);
    assert_eq!(cause, Cause::LinkLost);
}

/// The loop waits for its simulated rig for two seconds, and no longer. This test takes that time
/// because time is its subject.
#[test]
fn a_simulated_rig_that_is_held_up_for_more_than_two_seconds_is_a_lost_link() {
    let (host, mut end) = start(Duration::ZERO);
    sample_of(&mut end, &mut 0, HELD_TICK);
    let simulator = host.simulator().expect("a simulated rig");
    let (release, released) = mpsc::channel::<()>();
    let begun = Instant::now();
    simulator.post(Box::new(move |_| {
        // It ends with an error as soon as the sender is dropped.
        let _ = released.recv();
    }));
    let cause = until("a fault", || end.try_sample()?.state.cause);
    assert_eq!(cause, Cause::LinkLost);
    // The wait may have begun before, with an answer that the rig owed already.
    assert!(begun.elapsed() >= Duration::from_millis(1500), "after {:?}", begun.elapsed());
    drop(release);
}
