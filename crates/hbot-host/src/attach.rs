//! From a rig file to its motor buses: serial ports opened, controllers met, helpers started; or the
//! simulated rig.

use std::path::Path;
use std::sync::{Arc, mpsc};

use hbot_config::RigConfig;
use hbot_config::rig::Port;
use hbot_sim::phenomena::Phenomena;
use hbot_sim::pty::{PtyError, PtyOptions, PtyRig, spawn_pty};
use hbot_sim::rig::{RigConfig as SimulatedConfig, RigError, SimulatedRig};
use thiserror::Error;

use crate::bus::{Expected, MeetError, MotorBus, driver};
use crate::last_word::{Program, without_core_file};
use crate::layout::Layout;
use crate::line::serial::{LatencyTimer, OpenError, Peer, Serial, unguarded};
use crate::line::{Line, Memory, SimulatorCall};
use crate::realtime::{SIMULATOR_PRIORITY, real_time};
use crate::run_loop::Time;

/// Why the motors of a rig are not attached.
#[derive(Debug, Error)]
pub enum AttachError {
    /// The serial port.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The motor controllers.
    #[error(transparent)]
    Meet(#[from] MeetError),
    /// The simulated rig.
    #[error(transparent)]
    Simulator(#[from] RigError),
    /// Its pseudo-terminal.
    #[error(transparent)]
    Pty(#[from] PtyError),
    /// The system gives no thread.
    #[error("the system refuses: {0}")]
    System(#[from] std::io::Error),
}

/// The simulated rig, from outside of its thread.
#[derive(Clone)]
pub struct Simulator(Place);

/// Where the simulated rig runs.
#[derive(Clone)]
enum Place {
    /// In the loop's own thread.
    Loop(mpsc::Sender<SimulatorCall>),
    /// Behind a pseudo-terminal, in a thread that ends with the last of these.
    Terminal(Arc<PtyRig>),
}

impl Simulator {
    /// Has `call` done between two ticks. One that has ended does nothing.
    pub fn post(&self, call: SimulatorCall) {
        match &self.0 {
            Place::Loop(calls) => _ = calls.send(call),
            // A rig whose thread has ended shows in the loop as a lost link.
            Place::Terminal(pty) => _ = pty.post(call),
        }
    }

    /// Gives the simulated rig other phenomena.
    pub fn show(&self, phenomena: Phenomena) {
        self.post(Box::new(move |rig| rig.set_phenomena(phenomena)));
    }
}

/// The bus of a simulated rig, met, with what shows `phenomena` on it. In virtual time it is in
/// memory, otherwise behind a pseudo-terminal.
pub(crate) fn simulated(
    rig: &RigConfig,
    layout: &Layout,
    phenomena: Phenomena,
    time: Time,
) -> Result<(Box<dyn MotorBus>, Simulator), AttachError> {
    let mut config = SimulatedConfig::new(&rig.rig);
    config.protocol = rig.link.protocol;
    config.phenomena = Phenomena { link: None, ..phenomena };
    let simulated = SimulatedRig::new(&config)?;
    let (line, place): (Box<dyn Line>, _) = match time {
        Time::Virtual => {
            let (calls, inbox) = mpsc::channel();
            (Box::new(Memory::new(simulated, inbox)), Place::Loop(calls))
        }
        Time::Wall => {
            let pty = Arc::new(serve_pty(simulated)?);
            let serial = Serial::open(&pty.path().display().to_string(), rig.link.baud)?;
            (Box::new(serial), Place::Terminal(pty))
        }
    };
    let bus = met(rig, layout, line)?;
    let simulator = Simulator(place);
    if phenomena.link.is_some() {
        // After the meeting, which stands in a time of its own.
        simulator.post(Box::new(move |rig| rig.set_link(phenomena.link)));
    }
    Ok((bus, simulator))
}

/// The bus on a line to a simulated rig.
pub(crate) fn met(
    rig: &RigConfig,
    layout: &Layout,
    mut line: Box<dyn Line>,
) -> Result<Box<dyn MotorBus>, AttachError> {
    let expected = Expected::new(&Port::Sim.to_string(), &rig.rig, layout, 0);
    let protocol = driver(rig.link.protocol);
    protocol.meet(line.as_mut(), &expected)?;
    Ok(protocol.bus(line, expected))
}

fn serve_pty(rig: SimulatedRig) -> Result<PtyRig, PtyError> {
    let on_start = || {
        // Without the right to it the loop has none either, and says so.
        let _ = real_time(SIMULATOR_PRIORITY);
    };
    spawn_pty(rig, PtyOptions { on_start: Box::new(on_start), ..PtyOptions::default() })
}

/// The buses on real serial ports: opened, met, guarded by `helper`, and with `reopened` opened anew
/// where they vanish. `notices` gets what a user should know.
pub(crate) fn serial(
    rig: &RigConfig,
    devices: &[String],
    layout: &Layout,
    helper: Option<&Program>,
    reopened: bool,
    notices: &mut Vec<String>,
) -> Result<Vec<Box<dyn MotorBus>>, AttachError> {
    if helper.is_some() {
        without_core_file();
    }
    let protocol = driver(rig.link.protocol);
    let open = |(bus, device): (usize, &String)| {
        let mut line = Serial::open(device, rig.link.baud)?;
        let expected = Expected::new(device, &rig.rig, layout, bus);
        protocol.meet(&mut line, &expected)?;
        let off = protocol.off_bytes(&expected);
        if let Some(Err(error)) = helper.map(|helper| line.guard(helper, &off)) {
            notices.push(unguarded(device, &error));
        }
        if reopened {
            let peer = Peer { protocol, expected: expected.clone() };
            line.keep_open(device, rig.link.baud, peer, helper.cloned())?;
        }
        notices.extend(held_back(device));
        Ok(protocol.bus(Box::new(line), expected))
    };
    devices.iter().enumerate().map(open).collect()
}

/// What there is to know where a USB serial chip holds readings back.
fn held_back(device: &str) -> Option<String> {
    let timer = LatencyTimer::of(Path::new(device)).filter(|timer| timer.ms > 1)?;
    Some(format!(
        "{device} holds readings back for {} ms: write 1 to {} (contrib/ has a udev rule)",
        timer.ms,
        timer.path.display()
    ))
}
