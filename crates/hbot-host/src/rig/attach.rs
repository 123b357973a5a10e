//! Creates the motor buses of a rig file. It opens the serial ports, checks the controllers and
//! starts the helpers, or starts the simulated rig.

use std::path::Path;
use std::sync::{Arc, mpsc};

use hbot_config::RigConfig;
use hbot_config::rig::Port;
use hbot_sim::controller::{Lags, SimulatedJoint};
use hbot_sim::phenomena::Phenomena;
use hbot_sim::pty::{PtyOptions, spawn_pty};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig, SimulatedRigError};
use hbot_sim::served::{ServeError, ServedRig};
use hbot_sim::socket::{SharedTime, spawn_socket};
use thiserror::Error;

use crate::bus::{Expected, MeetError, MotorBus, driver, filtering_warnings};
use crate::line::serial::{LatencyTimer, OpenError, Peer, Serial, unguarded};
use crate::line::{Line, Memory, SimulatorCall, Socket};
use crate::rig::built::{self, Mismatch};
use crate::rig::last_word::{Program, without_core_file};
use crate::rig::layout::Layout;
use crate::run_loop::Time;
use crate::run_loop::realtime::{SIMULATOR_PRIORITY, real_time};

/// The reason why the program could not connect to the motors of a rig.
#[derive(Debug, Error)]
pub enum AttachError {
    /// A serial port could not be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The motor controllers do not answer, or are not those that the rig file names.
    #[error(transparent)]
    Meet(#[from] MeetError),
    /// The simulated rig cannot be built from the other rig file.
    #[error(transparent)]
    Built(#[from] Mismatch),
    /// The simulated rig could not be created.
    #[error(transparent)]
    Simulator(#[from] SimulatedRigError),
    /// The line of the simulated rig could not be created.
    #[error(transparent)]
    Serve(#[from] ServeError),
    /// The operating system could not start a thread.
    #[error("the system refuses: {0}")]
    System(#[from] std::io::Error),
}

/// A handle to the simulated rig for use from other threads.
#[derive(Clone)]
pub struct Simulator(Place);

/// The thread in which the simulated rig runs.
#[derive(Clone)]
enum Place {
    /// The rig runs in the thread of the control loop.
    Loop(mpsc::Sender<SimulatorCall>),
    /// The rig runs in a separate thread. The thread ends when the last handle is dropped.
    Thread(Arc<ServedRig>),
}

impl Simulator {
    /// Runs `call` on the simulated rig between two ticks. Does nothing if the rig has ended.
    pub fn post(&self, call: SimulatorCall) {
        match &self.0 {
            Place::Loop(calls) => _ = calls.send(call),
            // If the rig's thread has ended, the server ends too.
            Place::Thread(served) => _ = served.post(call),
        }
    }

    /// Returns why the thread of the simulated rig has failed. Returns `None` if it has not, or if
    /// the rig runs in the loop's thread.
    #[must_use]
    pub fn failure(&self) -> Option<&str> {
        match &self.0 {
            Place::Loop(_) => None,
            Place::Thread(served) => served.failure(),
        }
    }

    /// Replaces the phenomena of a real rig, such as play in the gears, that the simulated rig
    /// shows.
    pub fn show(&self, phenomena: Phenomena) {
        self.post(Box::new(move |rig| rig.set_phenomena(phenomena)));
    }
}

/// A simulated rig whose motor controllers have been checked.
pub(crate) struct Attached {
    /// The motor bus through which the rig is commanded.
    pub(crate) bus: Box<dyn MotorBus>,
    /// The motor controllers that were checked.
    pub(crate) expected: Expected,
    /// A handle to the rig for other threads.
    pub(crate) simulator: Simulator,
    /// The time that the rig shares with the loop. `None` if its time does not wait for the loop,
    /// or if it runs in the loop's thread.
    pub(crate) shared: Option<SharedTime>,
}

/// Creates a simulated rig with the given phenomena and checks its motor controllers. In virtual
/// time the line is in memory. In wall-clock time it is what the port of the rig file asks for: a
/// pair of sockets or a pseudo-terminal.
///
/// The rig is built as the rig file `built` describes it, or, without one, as `rig` does.
pub(crate) fn simulated(
    rig: &RigConfig,
    built: Option<&RigConfig>,
    layout: &Layout,
    phenomena: Phenomena,
    time: Time,
) -> Result<Attached, AttachError> {
    let ideal = Phenomena { link: None, hand: None, ..phenomena };
    let simulated = match built {
        Some(built) => built::simulated_rig(rig, built, ideal)?,
        None => simulated_rig(rig, ideal)?,
    };
    let mut shared = None;
    let (line, place): (Box<dyn Line>, _) = match (time, &rig.link.port) {
        (Time::Virtual, _) => {
            let (calls, inbox) = mpsc::channel();
            (Box::new(Memory::new(simulated, inbox)), Place::Loop(calls))
        }
        (Time::Wall, Port::SimPty) => {
            let pty =
                spawn_pty(simulated, PtyOptions { on_start: Box::new(urgent), ..PtyOptions::default() })?;
            let serial = Serial::open(&pty.path().display().to_string(), rig.link.baud)?;
            (Box::new(serial), Place::Thread(Arc::new(pty.into_served())))
        }
        (Time::Wall, _) => {
            let (served, end) = spawn_socket(simulated, rig.rig.timing.period_ns, urgent)?;
            shared = Some(end.time.clone());
            (Box::new(Socket::from(end)), Place::Thread(Arc::new(served)))
        }
    };
    let (expected, bus) = met(rig, layout, line)?;
    let simulator = Simulator(place);
    let Phenomena { link, hand, .. } = phenomena;
    if link.is_some() || hand.is_some() {
        // The line is impaired only after the controllers have been checked, because that check
        // uses a separate time.
        simulator.post(Box::new(move |rig| {
            rig.set_link(link);
            rig.set_hand(hand);
        }));
    }
    Ok(Attached { bus, expected, simulator, shared })
}

/// Creates the simulated rig that a rig file describes. Its motor controllers use the protocol that
/// the rig file names.
pub(crate) fn simulated_rig(
    rig: &RigConfig,
    phenomena: Phenomena,
) -> Result<SimulatedRig, SimulatedRigError> {
    let line = rig.link.protocol.into();
    let lags = Lags { torque: Some(rig.torque_lag), rate: Some(rig.rate_lag) };
    let joints = simulated_joints(rig);
    SimulatedRig::new(&SimulatedConfig { line, lags, phenomena, joints, ..SimulatedConfig::new(&rig.rig) })
}

/// Returns the joints of a simulated rig that is built as `rig` describes it, with the zeros of its
/// encoders.
#[must_use]
pub fn simulated_joints(rig: &RigConfig) -> Vec<SimulatedJoint> {
    // What a count is less than is in the geometry of the rig.
    let whole = Layout::of(rig).offsets;
    let joints = rig.rig.joints[..rig.rig.device.joints()].iter().zip(whole).map(|(joint, counts)| {
        let zero = f64::from(counts) * joint.radians_per_count();
        SimulatedJoint { zero, ..SimulatedJoint::from(joint) }
    });
    joints.collect()
}

/// A motor bus, and the controllers on its line, which have been checked.
pub(crate) type MetBus = (Expected, Box<dyn MotorBus>);

/// Checks the simulated motor controllers at the other end of `line`, and returns them with the
/// motor bus through which they are commanded. They use the protocol that the rig file names.
pub(crate) fn met(rig: &RigConfig, layout: &Layout, mut line: Box<dyn Line>) -> Result<MetBus, AttachError> {
    let expected = Expected::new(&rig.link.port.to_string(), &rig.rig, layout, 0);
    let protocol = driver(rig.link.protocol);
    protocol.meet(line.as_mut(), &expected)?;
    let bus = protocol.bus(line, expected.clone());
    Ok((expected, bus))
}

/// Requests a real-time priority for the thread of the simulated rig, which calls it.
pub fn urgent() {
    // If the system refuses the priority, it also refuses it to the loop, which reports it.
    let _ = real_time(SIMULATOR_PRIORITY);
}

/// Opens the rig's serial ports, and checks the motor controllers on them. For each port, starts a
/// process of the program `helper`, which switches the motors off if this program dies. If
/// `reopened` is true, lost lines are reopened later. Adds notices for the user to `notices`.
pub(crate) fn serial(
    rig: &RigConfig,
    devices: &[String],
    layout: &Layout,
    helper: Option<&Program>,
    reopened: bool,
    notices: &mut Vec<String>,
) -> Result<Vec<MetBus>, AttachError> {
    if helper.is_some() {
        without_core_file();
    }
    let protocol = driver(rig.link.protocol);
    let open = |(bus, device): (usize, &String)| {
        let mut line = Serial::open(device, rig.link.baud)?;
        let expected = Expected::new(device, &rig.rig, layout, bus);
        protocol.meet(&mut line, &expected)?;
        notices.extend(filtering_warnings(rig, &expected));
        let off = protocol.off_bytes(&expected);
        if let Some(Err(error)) = helper.map(|helper| line.guard(helper, &off)) {
            notices.push(unguarded(device, &error));
        }
        if reopened {
            let peer = Peer { protocol, expected: expected.clone() };
            line.keep_open(device, rig.link.baud, peer, helper.cloned())?;
        }
        notices.extend(held_back(device));
        let bus = protocol.bus(Box::new(line), expected.clone());
        Ok((expected, bus))
    };
    devices.iter().enumerate().map(open).collect()
}

/// Returns a notice for the user if the USB serial chip of `device` delays received data by more
/// than 1 ms.
fn held_back(device: &str) -> Option<String> {
    LatencyTimer::of(Path::new(device)).and_then(|timer| delay(device, &timer))
}

fn delay(device: &str, timer: &LatencyTimer) -> Option<String> {
    (timer.ms > 1).then(|| {
        format!(
            "{device} holds readings back for {} ms: write 1 to {} (contrib/ has a udev rule)",
            timer.ms,
            timer.path.display()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A server over a serial port compares the filters of its servos with the rig file.
    #[test]
    fn a_servo_that_is_later_than_the_rig_file_says_is_a_notice() {
        let text = include_str!("../../../../rigs/prototype-moteus.toml");
        let rig = RigConfig::from_toml(text, "rigs/prototype-moteus.toml").expect("legal");
        let mut simulated = simulated_rig(&rig, Phenomena::default()).expect("it can be simulated");
        assert!(simulated.controllers_mut().set(1, "motor_position.sources.0.pll_filter_hz", 100.0));
        let pty = spawn_pty(simulated, PtyOptions::default());
        let pty = pty.expect("this test needs pseudo-terminals (/dev/ptmx)");
        let device = pty.path().display().to_string();
        let mut notices = Vec::new();
        let met = serial(&rig, &[device], &Layout::of(&rig), None, false, &mut notices);
        assert_eq!(met.map(|lines| lines.len()).map_err(|error| error.to_string()), Ok(1));
        let right = "wheel[0].drive: motor_position.sources.0.pll_filter_hz = 100 Hz in the controller, so the reported \
                     rate is 7.9 ms late and not 3.9 ms";
        assert!(notices.len() == 1 && notices[0].starts_with(right), "{notices:?}");
    }

    #[test]
    fn a_chip_that_delays_readings_by_more_than_a_millisecond_is_a_notice() {
        let of = |ms| delay("/dev/ttyUSB0", &LatencyTimer { path: "latency_timer".into(), ms });
        assert_eq!((of(0), of(1)), (None, None));
        for ms in [2, 16, 255] {
            let notice = format!("/dev/ttyUSB0 holds readings back for {ms} ms: write 1 to latency_timer");
            assert!(of(ms).is_some_and(|said| said.starts_with(&notice)), "{:?}", of(ms));
        }
    }
}
