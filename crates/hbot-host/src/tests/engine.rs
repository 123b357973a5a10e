//! Tests that a tick allocates no memory, with a line in memory and over a pseudo-terminal.

use std::sync::mpsc;

use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::inputs::{Command, Stamp};
use hbot_core::safety::mode::Mode;
use hbot_core::{CompiledScene, Vec3};
use hbot_sim::pty::{PtyOptions, spawn_pty};
use hbot_testing::prototype::simulated;
use serde_json::{Map, json};

use crate::line::serial::Serial;
use crate::line::{Line, Memory};
use crate::rig::attach::met;
use crate::rig::layout::Layout;
use crate::tests::tick_bench::{TickBench, on_time};

const TICKS: u64 = 10_000;

/// An engine with the inputs that it has in service: a test sends it commands and scenes and
/// fetches its samples.
struct Busy {
    bench: TickBench,
    scenes: Vec<Box<CompiledScene>>,
    mode: Mode,
    seen: u64,
}

impl Busy {
    fn new(line: impl Line + 'static) -> Self {
        let rig = RigConfig::prototype();
        let layout = Layout::single(0..4);
        let (_, bus) = met(&rig, &layout, Box::new(line)).expect("the simulated rig answers");
        let mut running = RunningScene::new();
        let first = Box::new(running.load(SceneFile::default_scene()));
        let scenes = (0..100_u32)
            .map(|i| {
                let stiffness = Map::from_iter([("stiffness".to_owned(), json!(1.0 + 0.02 * f64::from(i)))]);
                Box::new(running.set("spring", &stiffness).expect("a legal stiffness"))
            })
            .collect();
        let bench = TickBench::new(&rig, vec![bus], &layout, first);
        Self { bench, scenes, mode: Mode::Unreferenced, seen: 0 }
    }

    fn in_memory() -> Self {
        Self::new(Memory::new(simulated(), mpsc::channel().1))
    }

    /// Acts as the service between two ticks: sends commands and scenes, and fetches samples. The
    /// scenes were allocated in advance.
    fn outside(&mut self, tick: u64) {
        let stamp = Stamp { seq: Some(tick), tick: Some(tick) };
        match tick % 100 {
            5 if self.mode == Mode::Idle => _ = self.bench.end.order(Command::Enable).expect("a place"),
            20 => {
                let torque = Vec3::new(0.1, 0.05, -0.02);
                self.bench.end.order(Command::Stream { torque, valid_ticks: 20, stamp }).expect("a place");
            }
            50 => self.bench.end.install(self.scenes.pop().expect("enough scenes")).expect("a place"),
            _ => {}
        }
        while let Some(sample) = self.bench.end.try_sample() {
            self.mode = sample.state.mode;
            self.seen += 1;
        }
    }
}

/// Runs ticks and rehearsals of the engine. Returns how many memory allocations they made; those of
/// `outside` and `between` are not counted.
fn allocations(busy: &mut Busy, mut between: impl FnMut()) -> u64 {
    let mut found = 0;
    for tick in 0..TICKS {
        busy.outside(tick);
        between();
        let info = allocation_counter::measure(|| {
            busy.bench.engine.rehearse(tick);
            busy.bench.engine.tick(&on_time(tick));
        });
        found += info.count_total + info.count_current.unsigned_abs();
    }
    busy.outside(TICKS);
    found
}

#[test]
fn ten_thousand_ticks_allocate_and_free_nothing_in_memory() {
    let mut busy = Busy::in_memory();
    let found = allocations(&mut busy, || ());
    assert_eq!(found, 0, "allocations in the tick");
    assert_eq!((busy.mode, busy.seen), (Mode::Active, TICKS));
    let counted = allocation_counter::measure(|| drop(std::hint::black_box(Box::new(1))));
    assert_eq!(counted.count_total, 1, "the counter counts");
}

#[test]
fn ten_thousand_ticks_allocate_and_free_nothing_over_a_pseudo_terminal() {
    let pty = spawn_pty(simulated(), PtyOptions::default()).expect("this test needs pseudo-terminals");
    let serial =
        Serial::open(&pty.path().display().to_string(), RigConfig::prototype().link.baud).expect("it opens");
    let mut busy = Busy::new(serial);
    // Ticks as fast as the line answers, without keeping the period.
    let found = allocations(&mut busy, || std::thread::sleep(std::time::Duration::from_micros(50)));
    assert_eq!(found, 0, "allocations in the tick");
    assert_eq!(busy.seen, TICKS);
}

#[test]
fn rehearsals_change_nothing() {
    let run = |rehearsals: u64| {
        let mut busy = Busy::in_memory();
        let states = (0..2_000).map(|tick| {
            busy.outside(tick);
            // Rehearses several times before each tick, also for later ticks.
            (0..rehearsals).for_each(|k| busy.bench.engine.rehearse(tick + k));
            busy.bench.engine.tick(&on_time(tick));
            let sample = busy.bench.end.try_sample().expect("a sample");
            busy.mode = sample.state.mode;
            sample.state
        });
        states.collect::<Vec<_>>()
    };
    let without = run(0);
    assert!(without.iter().any(|state| state.torque != Vec3::ZERO));
    assert_eq!(run(3), without);
}
