//! Tests of the age of positions.

use std::sync::mpsc::channel;

use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::safety::mode::{Cause, Mode};
use hbot_core::{Controller, MAX_JOINTS};
use hbot_host::bus::drivers::odrive::Odrive;
use hbot_host::bus::{BusCommand, Protocol as _};
use hbot_host::line::SimulatorCall;
use hbot_host::rig::layout::Layout;
use hbot_host::rig::motors::Motors;
use hbot_host::run_loop::bridge::bridge;
use hbot_host::run_loop::engine::{Engine, Recorder, TickTime};

use super::{Lossy, RIG, line, link};

/// Whatever the axes send comes 5 ms later every quarter of a second, and commands arrive at once.
/// No message says so, but the answers to questions come late too. The whole loop runs in virtual
/// time.
#[test]
fn answers_that_come_later_and_later_have_their_age_and_end_in_link_lost() {
    let rig = RigConfig::from_toml(RIG, "rigs/prototype-odrive.toml").expect("it is legal");
    let (mut line, calls, expected) = line(|_| ());
    Odrive.meet(&mut line, &expected).expect("they are good");
    let motors = Motors::new(vec![Odrive.bus(Box::new(line), expected)], &Layout::of(&rig), 20);
    let (end, mut service) = bridge().expect("a bridge");
    let scene = Box::new(RunningScene::new().load(SceneFile::default_scene()));
    let (told, heard) = channel();
    let recorder: Recorder = Box::new(move |ticked| {
        let answered = ticked.inputs.feedback.map(|feedback| feedback.sequence);
        told.send(answered.filter(|_| ticked.outputs.state.fresh)).expect("the test waits for it");
    });
    let controller = Controller::new(rig.rig);
    let mut engine = Engine::new(motors, controller, scene, end, Some(recorder)).enabling(true);
    let (mut delay, mut lost, mut right) = (0, None, [0; 5]);
    for tick in 0..3000_u64 {
        if tick >= 1500 && tick.is_multiple_of(250) && lost.is_none() {
            delay += 5;
            let latency_s = f64::from(delay) * 1e-3;
            let call: SimulatorCall = Box::new(move |rig| rig.set_link(link(latency_s)));
            calls.send(call).expect("the line is there");
        }
        let time =
            TickTime { tick, t_ns: tick * 1_000_000, awake_ns: 0, lateness_ns: 0, late: false, skipped: 0 };
        engine.tick(&time);
        let sample = service.try_sample().expect("a sample a tick");
        if sample.state.mode == Mode::Fault {
            lost = lost.or(Some((delay, sample.state.cause)));
        } else if tick > 1400 {
            assert_eq!(sample.state.mode, Mode::Active, "{tick}");
        }
        // A position leaves its axis every millisecond and is read in the first tick after it has
        // arrived. The driver has 150 ms to notice a step.
        let settled = tick > 600 && tick % 250 > 150;
        if let Some(answered) = heard.recv().expect("a tick")
            && settled
            && lost.is_none()
        {
            assert_eq!((tick as u32).wrapping_sub(answered), delay + 1, "in tick {tick}");
            right[delay as usize / 5] += 1;
        }
    }
    assert_eq!(lost, Some((20, Some(Cause::LinkLost))), "20 ticks are legal, and 21 are not");
    assert!(right[..4].iter().all(|count| *count > 90), "readings of the right age: {right:?}");
}

/// A position whose age is not known is no reading. Questions are repeated until one is answered.
#[test]
fn there_is_no_reading_before_the_age_of_positions_is_known() {
    let (mut line, _calls, expected) = line(|_| ());
    Odrive.meet(&mut line, &expected).expect("they are good");
    // The current of axis 3 is message 0x74, its temperature 0x75.
    let mut left = 3;
    let loses = move |text: &str| {
        let hit = text.starts_with("r074") || text.starts_with("r075");
        left -= i32::from(hit && left > 0);
        hit && left > 0
    };
    let mut bus = Odrive.bus(Box::new(Lossy { line, loses }), expected);
    let mut first = None;
    for tick in 0..40 {
        let heard = bus.receive(u64::from(tick) * 1_000_000, tick);
        first = first.or(heard.reading.map(|reading| (tick, tick - reading.answers)));
        let command = BusCommand { tick, enable: false, watchdog_ms: 20, torque: [0.0; MAX_JOINTS] };
        assert!(bus.command(u64::from(tick) * 1_000_000, &command));
    }
    // The questions of ticks 0 and 5 are lost. That of tick 10 asks for the temperature again, so
    // its answer can be that to tick 0.
    assert_eq!(first, Some((11, 11)));
}
