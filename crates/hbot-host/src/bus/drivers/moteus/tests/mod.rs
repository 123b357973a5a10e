//! Compares the driver with vectors from the vendor's own software, and tests what the conformance
//! suite cannot see.

mod answers;
mod meeting;
mod servos;
mod state;
mod tick;
mod vectors;

use std::sync::mpsc::{Sender, channel};

use hbot_config::RigConfig;
use hbot_core::MAX_JOINTS;
use hbot_core::inputs::Complaints;
use hbot_sim::rig::SimulatedRig;

use super::Moteus;
use super::text::{Dialect, Inbox, Said};
use crate::bus::{BusCommand, Expected, Heard, MotorBus, Protocol as _};
use crate::line::{Memory, SimulatorCall};
use crate::rig::attach::simulated_rig;
use crate::rig::layout::Layout;

/// Gives a line to an [`Inbox`] byte by byte and returns the content that the inbox decodes.
fn said(line: &str, dialect: Dialect) -> Said {
    let mut inbox = Inbox::new(dialect);
    let mut said: Vec<_> = line.bytes().chain(*b"\r\n").filter_map(|byte| inbox.take(byte)).collect();
    assert_eq!(said.len(), 1, "{line}");
    said.remove(0).0
}

/// A test bench: four simulated servos on a line, and the bus that commands them.
struct Bench {
    bus: Box<dyn MotorBus>,
    calls: Sender<SimulatorCall>,
    tick: u32,
}

/// Returns the prototype's rig with moteus servos, a line to simulated servos, and a channel. A
/// function that is sent into the channel is run on the simulated rig between two ticks.
fn rig_and_line() -> (RigConfig, Memory, Sender<SimulatorCall>) {
    let text = include_str!("../../../../../../../rigs/prototype-moteus.toml");
    let rig = RigConfig::from_toml(text, "rigs/prototype-moteus.toml").expect("legal");
    let simulated = simulated_rig(&rig, Default::default()).expect("it can be simulated");
    let (calls, inbox) = channel();
    (rig, Memory::new(simulated, inbox), calls)
}

impl Bench {
    fn new() -> Self {
        let (rig, mut line, calls) = rig_and_line();
        let expected = Expected::new("sim", &rig.rig, &Layout::of(&rig), 0);
        Moteus.meet(&mut line, &expected).expect("they are the rig's");
        Self { bus: Moteus.bus(Box::new(line), expected), calls, tick: 1 }
    }

    /// Makes the line run `call` on the simulated rig before the next command.
    fn post(&self, call: impl FnOnce(&mut SimulatedRig) + Send + 'static) {
        self.calls.send(Box::new(call)).expect("the line is there");
    }

    fn tick(&mut self, enable: bool) -> Heard {
        let now_ns = u64::from(self.tick) * 1_000_000;
        let heard = self.bus.receive(now_ns, self.tick);
        let mut torque = [0.0; MAX_JOINTS];
        if enable {
            torque[..4].copy_from_slice(&[0.01, -0.01, 0.02, 0.005]);
        }
        self.bus.command(now_ns, &BusCommand { tick: self.tick, enable, watchdog_ms: 20, torque });
        self.tick += 1;
        heard
    }

    fn ticks(&mut self, n: u32, enable: bool) -> (Complaints, u32, bool) {
        (0..n).fold((Complaints::default(), 0, false), |(complaints, readings, lost), _| {
            let heard = self.tick(enable);
            let readings = readings + u32::from(heard.reading.is_some());
            (complaints.or(heard.complaints), readings, lost | heard.zeros_lost)
        })
    }
}
