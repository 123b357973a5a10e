//! Bringing a rig up, before any loop is closed over it: one joint at a time under a small torque ([`joint`]), and what the joints
//! say of each other while a person turns the sphere ([`calibrate`]). A wrong sign or zero in a closed loop is a runaway.

pub mod calibrate;
pub mod joint;

#[cfg(test)]
mod tests;

use std::sync::mpsc;
use std::time::Duration;

use hbot_config::{RigConfig, rig as config};
use hbot_core::inputs::JointFeedback;
use hbot_core::outputs::Drive;
use hbot_core::{MAX_JOINTS, Rig};
use hbot_link::ToController;
use hbot_sim::hand::Hand;
use hbot_sim::rig::{RigConfig as SimulatedConfig, SimulatedRig};
use thiserror::Error;

use crate::engine::Line;
use crate::handshake::{Expected, handshake};
use crate::last_word::{Program, without_core_file};
use crate::port::{NO_READINGS, Port};
use crate::run_loop::StopFlag;
use crate::sample::Counters;
use crate::serial::{Serial, unguarded};
use crate::server::StartError;
use crate::wire::{Memory, Wire};

/// How long a controller holds a torque that no other follows, ms.
const WATCHDOG_MS: u16 = 20;
/// Readings that may be missing in a row.
const PATIENCE: u32 = 50;

/// Motors off.
const OFF: Drive = Drive { enable: false, torque: [0.0; MAX_JOINTS] };
/// How many times motors are switched off at the end, in case a frame is lost.
const STOPS: u32 = 3;

/// Why there is no reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Interrupted {
    /// The line says nothing any more.
    #[error("the motor controllers have stopped answering: motors are off by their own watchdog")]
    Silent,
    /// Somebody wants it to end.
    #[error("stopped by a signal: motors are off")]
    Stopped,
}

/// The rig's lines without a loop: one command, one reading. Motors are switched off when it is dropped.
pub struct Bench<W: Wire> {
    ports: Vec<Port<W>>,
    rig: Rig,
    readings: JointFeedback,
    counters: Counters,
    buffer: [u8; 4096],
    tick: u32,
    period: Duration,
    /// The lines are simulated: their time is told, and does not pass.
    simulated: bool,
    /// Looked at before each command with torque.
    stop: StopFlag,
    notices: Vec<String>,
}

/// Opens the lines of `rig` and has the controllers on them say who they are. The simulated rig is held by a hand that turns it
/// about widely where `turned` says so, and stands free otherwise. Once `stop` is set no further torque is written. `helper` switches
/// the motors off if this process dies.
///
/// # Errors
/// A port does not open, or its controllers are not those of the rig.
pub fn open(
    rig: &RigConfig,
    turned: bool,
    stop: StopFlag,
    helper: &Program,
) -> Result<Bench<Box<dyn Wire>>, StartError> {
    let line = Line::of(rig);
    let mut notices = Vec::new();
    let (wires, simulated) = match &rig.link.port {
        config::Port::Sim => {
            let mut simulated = SimulatedRig::new(&SimulatedConfig::new(&rig.rig))?;
            simulated.set_hand(turned.then(|| Hand { amplitude: 0.8, rate: 0.4, ..Hand::default() }));
            let mut wire = Memory::new(simulated, mpsc::channel().1);
            handshake(&mut wire, &Expected::new("sim", &rig.rig, &line, 0))?;
            (vec![Box::new(wire) as Box<dyn Wire>], true)
        }
        config::Port::Devices(devices) => {
            without_core_file();
            let open = |(port, device): (usize, &String)| {
                let mut wire = Serial::open(device, rig.link.baud)?;
                let expected = Expected::new(device, &rig.rig, &line, port);
                handshake(&mut wire, &expected)?;
                if let Err(error) = wire.guard(helper, &expected) {
                    notices.push(unguarded(device, &error));
                }
                Ok::<Box<dyn Wire>, StartError>(Box::new(wire))
            };
            (devices.iter().enumerate().map(open).collect::<Result<_, _>>()?, false)
        }
    };
    let mut bench = Bench::new(&rig.rig, wires, &line, simulated);
    (bench.stop, bench.notices) = (stop, notices);
    Ok(bench)
}

impl<W: Wire> Bench<W> {
    /// A bench on lines whose controllers have said who they are.
    #[must_use]
    pub fn new(rig: &Rig, wires: Vec<W>, line: &Line, simulated: bool) -> Self {
        let port = |(port, wire)| Port::new(wire, rig, line, port);
        Self {
            ports: wires.into_iter().enumerate().map(port).collect(),
            rig: *rig,
            readings: NO_READINGS,
            counters: Counters::default(),
            buffer: [0; 4096],
            tick: 0,
            period: Duration::from_nanos(rig.timing.period_ns),
            simulated,
            stop: StopFlag::default(),
            notices: Vec::new(),
        }
    }

    /// What a user should know about how it runs.
    #[must_use]
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// The rig as its file has it.
    #[must_use]
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The time between two exchanges, s.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        self.rig.timing.period_s()
    }

    /// One command, with torques in the controllers' own sense or motors off, and the reading that comes back. Waits a period.
    ///
    /// # Errors
    /// Nothing has come for many periods, or somebody wants it to end: then this command has not been written.
    pub fn exchange(&mut self, torque: Option<&[f64; MAX_JOINTS]>) -> Result<JointFeedback, Interrupted> {
        let drive = Drive { enable: torque.is_some(), torque: torque.copied().unwrap_or([0.0; MAX_JOINTS]) };
        let stop = self.stop.clone();
        self.converse(&drive, || stop.is_set())
    }

    /// Switches the motors off: three commands that have been answered.
    ///
    /// # Errors
    /// Nothing has come for many periods.
    pub fn switch_off(&mut self) -> Result<(), Interrupted> {
        (0..STOPS).try_for_each(|_| self.converse(&OFF, || false).map(drop))
    }

    /// Writes the same command until each line has answered it, unless it is to `stop`.
    fn converse(&mut self, drive: &Drive, stop: impl Fn() -> bool) -> Result<JointFeedback, Interrupted> {
        for _ in 0..PATIENCE {
            if stop() {
                return Err(Interrupted::Stopped);
            }
            let mut heard = 0;
            for port in &mut self.ports {
                port.wire.set_time(u64::from(self.tick) * self.rig.timing.period_ns);
                let command = port.command(self.tick, WATCHDOG_MS, drive);
                // A frame that is not taken is missed by the reading that does not come.
                let _ = port.write(&ToController::Command(command));
            }
            self.tick += 1;
            if !self.simulated {
                std::thread::sleep(self.period);
            }
            self.readings.complaints = Default::default();
            for port in &mut self.ports {
                port.receive(self.tick, &mut self.buffer, &mut self.counters);
                let complaints = std::mem::take(&mut port.complaints);
                self.readings.complaints = self.readings.complaints.or(complaints);
                if let Some(feedback) = port.fresh.take() {
                    port.take(&feedback, &mut self.readings);
                    heard += 1;
                }
            }
            if heard == self.ports.len() {
                return Ok(self.readings);
            }
        }
        Err(Interrupted::Silent)
    }

    /// The turn of a joint in its controller's sense for so many counts, rad.
    #[must_use]
    pub fn turned(&self, joint: usize, counts: i32) -> f64 {
        let joint = &self.rig.joints[joint];
        f64::from(counts) * std::f64::consts::TAU / (f64::from(joint.counts_per_turn) * joint.gear)
    }
}

/// Whatever ends it, an error, a signal or a panic: motors are off. Commands are written that many times whether they are answered or not.
impl<W: Wire> Drop for Bench<W> {
    fn drop(&mut self) {
        for k in 0..STOPS {
            if k > 0 && !self.simulated {
                std::thread::sleep(self.period);
            }
            for port in &mut self.ports {
                let command = port.command(self.tick.wrapping_add(k), WATCHDOG_MS, &OFF);
                // The helper and the watchdog are left where a line does not take it.
                let _ = port.write(&ToController::Command(command));
            }
        }
        self.ports.iter_mut().for_each(|port| port.wire.all_said());
    }
}
