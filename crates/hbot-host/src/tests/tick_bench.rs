//! An engine for tests, which call its ticks themselves. It includes the service's end of the
//! bridge to the engine.

use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::inputs::Command;
use hbot_core::safety::mode::Mode;
use hbot_core::{CompiledScene, Controller};

use crate::bus::MotorBus;
use crate::rig::layout::Layout;
use crate::rig::motors::Motors;
use crate::run_loop::bridge::{ServiceEnd, bridge};
use crate::run_loop::engine::{Engine, TickTime};
use crate::run_loop::sample::Sample;

/// An engine for tests. In service a thread calls its ticks. Here the test calls them.
pub(crate) struct TickBench {
    pub(crate) engine: Engine,
    pub(crate) end: ServiceEnd,
    /// Number of the next tick.
    pub(crate) tick: u64,
}

/// Returns the timing of a tick that begins exactly at its deadline, in a loop at 1 kHz.
pub(crate) fn on_time(tick: u64) -> TickTime {
    TickTime { tick, t_ns: tick * 1_000_000, awake_ns: 0, lateness_ns: 0, late: false, skipped: 0 }
}

pub(crate) fn default_scene() -> Box<CompiledScene> {
    Box::new(RunningScene::new().load(SceneFile::default_scene()))
}

impl TickBench {
    pub(crate) fn new(
        rig: &RigConfig,
        buses: Vec<Box<dyn MotorBus>>,
        layout: &Layout,
        scene: Box<CompiledScene>,
    ) -> Self {
        let (inner, end) = bridge().expect("a bridge");
        let motors = Motors::new(buses, layout, rig.link.watchdog_ms);
        let engine =
            Engine::new(motors, Controller::new(rig.rig).with_named_commands(true), scene, inner, None);
        Self { engine, end, tick: 0 }
    }

    pub(crate) fn tick(&mut self) -> Sample {
        self.engine.tick(&on_time(self.tick));
        self.tick += 1;
        self.end.try_sample().expect("a sample a tick")
    }

    pub(crate) fn ticks(&mut self, n: u32) -> Sample {
        (1..n).for_each(|_| _ = self.tick());
        self.tick()
    }

    pub(crate) fn order(&mut self, command: Command) -> Sample {
        self.end.order(command).expect("a place");
        self.tick()
    }

    pub(crate) fn active(&mut self) {
        self.ticks(5);
        self.order(Command::Enable);
        assert_eq!(self.ticks(600).state.mode, Mode::Active);
    }
}
