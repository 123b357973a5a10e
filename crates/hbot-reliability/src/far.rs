//! The motor controllers of hbot's own link: a simulated rig at the far end of a pseudo-terminal.
//! Lines on standard input make it misbehave. It counts the commands that it receives.

use std::io::{Read as _, Write as _};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::Duration;

use hbot_config::RigConfig;
use hbot_host::run_loop::clock::now_ns;
use hbot_host::run_loop::realtime::{SIMULATOR_PRIORITY, real_time};
use hbot_link::{Command, Decoder, ToController};
use hbot_sim::controller::InjectedFault;
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use oorandom::Rand64;
use serde_json::json;
use serialport::{SerialPort as _, TTYPort};

use crate::Outcome;

/// How the simulated motor controllers answer commands.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Manner {
    /// The controllers send proper readings.
    Well,
    /// The controllers send random bytes, as many as the line takes.
    Babbles,
    /// The controllers send back the bytes that they received.
    Echoes,
}

/// Statistics of the commands that the simulated motor controllers have received.
#[derive(Default)]
struct Heard {
    since_ns: Option<u64>,
    commands: u64,
    /// Time from the start of the misbehaviour to the first command with zero torque, ns.
    zero_after_ns: Option<u64>,
    /// Number of commands with motors off and zero torque since the last command of another kind.
    last_zeros: u64,
}

impl Heard {
    fn take(&mut self, command: &Command, now_ns: u64) {
        let zero = command.torque.iter().all(|torque| *torque == 0.0);
        self.last_zeros = if zero && !command.enable { self.last_zeros + 1 } else { 0 };
        let Some(since) = self.since_ns else { return };
        self.commands += 1;
        if zero {
            self.zero_after_ns.get_or_insert(now_ns - since);
        }
    }

    /// Returns the statistics as one line of JSON.
    fn report(&self) -> String {
        let ms = |ns: Option<u64>| ns.map(|ns| ns as f64 * 1e-6);
        json!({"zero_after_ms": ms(self.zero_after_ns), "last_zeros": self.last_zeros, "commands": self.commands})
            .to_string()
    }
}

/// Opens a pseudo-terminal, prints the path of its far end, and gives this process real-time
/// priority if that is permitted. Returns both ends, and a receiver of the lines on standard input.
pub(crate) fn terminal() -> Outcome<(TTYPort, TTYPort, Receiver<String>)> {
    let (mut near, far) = TTYPort::pair()?;
    near.set_timeout(Duration::from_millis(1))?;
    println!("{}", far.name().ok_or("a pseudo-terminal without a name")?);
    // Without the right to real-time priority, other work on the machine can delay this process, as
    // it can delay the server.
    let _ = real_time(SIMULATOR_PRIORITY);
    let (orders, asked) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lines().map_while(Result::ok) {
            if orders.send(line).is_err() {
                return;
            }
        }
    });
    Ok((near, far, asked))
}

/// Writes random bytes to the line, as many as it takes. Further bytes are dropped.
pub(crate) fn babble(near: &mut TTYPort, random: &mut Rand64) {
    let garbage: Vec<u8> = (0..4096).map(|_| random.rand_u64() as u8).collect();
    let _ = near.write(&garbage);
}

/// Runs simulated motor controllers on a pseudo-terminal until standard input ends. Prints the path
/// of the terminal first.
pub(crate) fn run() -> Outcome<()> {
    let (mut near, _far, asked) = terminal()?;
    let mut rig = SimulatedRig::new(&SimulatedConfig::new(&RigConfig::prototype().rig))?;
    let (mut decoder, mut heard) = (Decoder::<ToController>::new(), Heard::default());
    let (start, mut buffer, mut reply) = (now_ns(), [0; 4096], Vec::new());
    let mut manner = Manner::Well;
    let mut random = Rand64::new(7);
    loop {
        let now = now_ns() - start;
        match asked.try_recv() {
            Ok(order) if order == "report" => println!("{}", heard.report()),
            Ok(order) => {
                heard = Heard { since_ns: Some(now), ..heard };
                match order.as_str() {
                    "mark" => {}
                    "mute" => rig.inject(InjectedFault::Mute(true)),
                    "reboot" => rig.inject(InjectedFault::Reboot),
                    "babble" => manner = Manner::Babbles,
                    "echo" => manner = Manner::Echoes,
                    other => return Err(format!("{other}?").into()),
                }
            }
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => return Ok(()),
        }
        if manner == Manner::Babbles {
            babble(&mut near, &mut random);
        }
        // Without bytes for a millisecond, the simulated sphere still has to move.
        let Ok(n) = near.read(&mut buffer) else {
            rig.advance_to(now);
            continue;
        };
        decoder.feed(&buffer[..n], |message| {
            if let Ok(ToController::Command(command)) = message {
                heard.take(&command, now_ns() - start);
            }
        });
        reply.clear();
        rig.receive(now_ns() - start, &buffer[..n], &mut reply);
        let _ = match manner {
            Manner::Well => near.write(&reply),
            Manner::Babbles => Ok(0),
            Manner::Echoes => near.write(&buffer[..n]),
        };
    }
}
