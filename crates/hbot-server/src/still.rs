//! A sample for tests.

use hbot_core::inputs::{Inputs, MAX_COMMANDS};
use hbot_core::{CompiledScene, Controller};
use hbot_host::run_loop::sample::{Counters, Sample, TickTiming};

/// Returns a sample for tests, with the tick number `tick`. Its state is that after one tick of the
/// control law without a reading from the motor controllers.
pub(crate) fn still(tick: u64) -> Sample {
    let mut controller = Controller::new(hbot_config::RigConfig::prototype().rig);
    let state = controller.tick(&CompiledScene::empty(), &Inputs::quiet(tick)).state;
    Sample {
        state,
        t_ns: tick * 1_000_000,
        scene: 0,
        timing: TickTiming::default(),
        counters: Counters::default(),
        answers: [None; MAX_COMMANDS],
        telemetry: Default::default(),
        complaints: Default::default(),
        restarted: false,
    }
}
