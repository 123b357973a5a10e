//! Tests that a tick allocates no memory, with a line in memory and over a pseudo-terminal.

use std::sync::mpsc;

use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::inputs::{Command, Stamp};
use hbot_core::mode::Mode;
use hbot_core::{CompiledScene, Controller, Vec3};
use hbot_sim::pty::{PtyOptions, spawn_pty};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use serde_json::{Map, json};

use crate::attach::met;
use crate::bridge::{ServiceEnd, bridge};
use crate::engine::{Engine, TickTime};
use crate::layout::Layout;
use crate::line::serial::Serial;
use crate::line::{Line, Memory};
use crate::motors::Motors;

const TICKS: u64 = 10_000;

struct Bench {
    engine: Engine,
    end: ServiceEnd,
    scenes: Vec<Box<CompiledScene>>,
    mode: Mode,
    seen: u64,
}

fn simulated() -> (RigConfig, SimulatedRig) {
    let rig = RigConfig::prototype();
    let simulated =
        SimulatedRig::new(&SimulatedConfig::new(&rig.rig)).expect("the prototype can be simulated");
    (rig, simulated)
}

impl Bench {
    fn new(rig: &RigConfig, line: impl Line + 'static) -> Self {
        let layout = Layout::single(0..4);
        let bus = met(rig, &layout, Box::new(line)).expect("the simulated rig answers");
        let (inner, end) = bridge().expect("a bridge");
        let mut running = RunningScene::new();
        let first = Box::new(running.load(SceneFile::default_scene()));
        let scenes = (0..100_u32)
            .map(|i| {
                let stiffness = Map::from_iter([("stiffness".to_owned(), json!(1.0 + 0.02 * f64::from(i)))]);
                Box::new(running.set("spring", &stiffness).expect("a legal stiffness"))
            })
            .collect();
        let motors = Motors::new(vec![bus], &layout, rig.link.watchdog_ms);
        let engine = Engine::new(motors, Controller::new(rig.rig), first, inner, None);
        Self { engine, end, scenes, mode: Mode::Unreferenced, seen: 0 }
    }

    /// Acts as the service between two ticks: sends commands and scenes, and fetches samples. The
    /// scenes were allocated in advance.
    fn outside(&mut self, tick: u64) {
        let stamp = Stamp { seq: Some(tick), tick: Some(tick) };
        match tick % 100 {
            5 if self.mode == Mode::Idle => _ = self.end.order(Command::Enable).expect("a place"),
            20 => {
                let torque = Vec3::new(0.1, 0.05, -0.02);
                self.end.order(Command::Stream { torque, valid_ticks: 20, stamp }).expect("a place");
            }
            50 => self.end.install(self.scenes.pop().expect("enough scenes")).expect("a place"),
            _ => {}
        }
        while let Some(sample) = self.end.try_sample() {
            self.mode = sample.state.mode;
            self.seen += 1;
        }
    }
}

fn moment(tick: u64) -> TickTime {
    TickTime { tick, t_ns: tick * 1_000_000, awake_ns: 0, lateness_ns: 0, late: false, skipped: 0 }
}

/// Runs ticks and rehearsals of the engine. Returns how many memory allocations they made; those of
/// `outside` and `between` are not counted.
fn allocations(bench: &mut Bench, mut between: impl FnMut()) -> u64 {
    let mut found = 0;
    for tick in 0..TICKS {
        bench.outside(tick);
        between();
        let info = allocation_counter::measure(|| {
            bench.engine.rehearse(tick);
            bench.engine.tick(&moment(tick));
        });
        found += info.count_total + info.count_current.unsigned_abs();
    }
    bench.outside(TICKS);
    found
}

#[test]
fn ten_thousand_ticks_allocate_and_free_nothing_in_memory() {
    let (rig, simulated) = simulated();
    let (_calls, inbox) = mpsc::channel();
    let mut bench = Bench::new(&rig, Memory::new(simulated, inbox));
    let found = allocations(&mut bench, || ());
    assert_eq!(found, 0, "allocations in the tick");
    assert_eq!((bench.mode, bench.seen), (Mode::Active, TICKS));
    let counted = allocation_counter::measure(|| drop(std::hint::black_box(Box::new(1))));
    assert_eq!(counted.count_total, 1, "the counter counts");
}

#[test]
fn ten_thousand_ticks_allocate_and_free_nothing_over_a_pseudo_terminal() {
    let (rig, simulated) = simulated();
    let pty = spawn_pty(simulated, PtyOptions::default()).expect("this test needs pseudo-terminals");
    let serial = Serial::open(&pty.path().display().to_string(), rig.link.baud).expect("it opens");
    let mut bench = Bench::new(&rig, serial);
    // Ticks as fast as the line answers, without keeping the period.
    let found = allocations(&mut bench, || std::thread::sleep(std::time::Duration::from_micros(50)));
    assert_eq!(found, 0, "allocations in the tick");
    assert_eq!(bench.seen, TICKS);
}

#[test]
fn rehearsals_change_nothing() {
    let run = |rehearsals: u64| {
        let (rig, simulated) = simulated();
        let (_calls, inbox) = mpsc::channel();
        let mut bench = Bench::new(&rig, Memory::new(simulated, inbox));
        let states = (0..2_000).map(|tick| {
            bench.outside(tick);
            // Rehearses several times before each tick, also for later ticks.
            (0..rehearsals).for_each(|k| bench.engine.rehearse(tick + k));
            bench.engine.tick(&moment(tick));
            let sample = bench.end.try_sample().expect("a sample");
            bench.mode = sample.state.mode;
            sample.state
        });
        states.collect::<Vec<_>>()
    };
    let without = run(0);
    assert!(without.iter().any(|state| state.torque != Vec3::ZERO));
    assert_eq!(run(3), without);
}

#[test]
fn an_estop_is_done_in_the_next_tick_whatever_waits_before_it() {
    let (rig, simulated) = simulated();
    let (_calls, inbox) = mpsc::channel();
    let mut bench = Bench::new(&rig, Memory::new(simulated, inbox));
    let found = allocations(&mut bench, || ());
    assert_eq!((found, bench.mode), (0, Mode::Active));
    while bench.end.order(Command::Disable).is_ok() {}
    // The ring is full and has no room for the stop either.
    assert!(bench.end.order(Command::Estop).is_err());
    bench.engine.tick(&moment(TICKS));
    let sample = bench.end.try_sample().expect("a sample");
    assert_eq!((sample.state.mode, sample.state.torque), (Mode::Estop, Vec3::ZERO));
}
