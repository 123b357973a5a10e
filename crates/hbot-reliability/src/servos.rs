//! The motor controllers of another vendor: a simulated rig at the far end of a pseudo-terminal.
//! Lines on standard input make it misbehave. It records the torque of its motors.

use std::io::{Read as _, Write as _};
use std::sync::mpsc::TryRecvError;
use std::time::Duration;

use hbot_config::RigConfig;
use hbot_config::rig::Protocol;
use hbot_core::design::device::MAX_JOINTS;
use hbot_host::run_loop::clock::now_ns;
use hbot_sim::controller::InjectedFault;
use hbot_sim::phenomena::{Hand, Link};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use moteus_protocol::command::{PositionCommand, PositionFormat};
use moteus_protocol::fdcanusb::{EncodeOptions, MAX_LINE_LENGTH, encode_can_send};
use moteus_protocol::{CanFdFrame, calculate_arbitration_id};
use oorandom::Rand64;
use serde_json::json;
use serialport::SerialPort as _;

use crate::{Outcome, far, rigs};

/// Index of the joint of which the controller misbehaves alone.
const ONE: usize = 1;
/// Longest time between two looks at the motors, ns.
const LOOK_NS: u64 = 200_000;
/// The id to which all moteus servos listen.
const ALL_SERVOS: usize = 127;

/// What the simulated motors did since the start of the misbehaviour, by their own clock.
#[derive(Default)]
struct Record {
    since_ns: Option<u64>,
    /// Time since which no motor gives torque, ns. `None` while any motor does.
    off_since_ns: Option<u64>,
    torque: [f64; MAX_JOINTS],
    /// The torques at the start of the misbehaviour, N m.
    before: [f64; MAX_JOINTS],
    /// Largest torque that a motor gave since then beyond its torque before, or against it, N m.
    beyond: f64,
    /// The line of text that is being received.
    line: Vec<u8>,
    /// For each moteus servo, the number of stop commands since its last command of torque.
    stops: [u64; MAX_JOINTS],
}

impl Record {
    fn begin(&mut self, now_ns: u64) {
        (self.since_ns, self.before, self.beyond) = (Some(now_ns), self.torque, 0.0);
    }

    fn look(&mut self, torque: &[f64; MAX_JOINTS], now_ns: u64) {
        self.torque = *torque;
        if torque.iter().any(|torque| *torque != 0.0) {
            self.off_since_ns = None;
        } else {
            self.off_since_ns.get_or_insert(now_ns);
        }
        for (now, before) in torque.iter().zip(&self.before) {
            let beyond = if now * before < 0.0 { now.abs() } else { now.abs() - before.abs() };
            self.beyond = self.beyond.max(beyond);
        }
    }

    /// Counts the stop commands in bytes that have arrived for moteus servos.
    fn count_stops(&mut self, bytes: &[u8]) {
        for byte in bytes {
            if *byte != b'\n' {
                self.line.push(*byte);
                continue;
            }
            if let Some((id, mode)) = commanded(&self.line) {
                let meant = |joint: usize| id == ALL_SERVOS || id == joint + 1;
                for (_, stops) in self.stops.iter_mut().enumerate().filter(|(joint, _)| meant(*joint)) {
                    *stops = if mode == 0 { *stops + 1 } else { 0 };
                }
            }
            self.line.clear();
        }
    }

    /// Returns the record as one line of JSON, for a rig with `joints` joints.
    fn report(&self, joints: usize) -> String {
        // Motors that were off before the misbehaviour prove nothing.
        let off_after = self.off_since_ns.zip(self.since_ns).and_then(|(off, since)| off.checked_sub(since));
        json!({
            "zero_after_ms": off_after.map(|ns| ns as f64 * 1e-6),
            "last_stops": self.stops[..joints].iter().min(),
            "before": self.before.iter().fold(0.0_f64, |most, torque| most.max(torque.abs())),
            "beyond": self.beyond,
        })
        .to_string()
    }
}

/// Returns the id and the mode in a line of text that sets the mode of a moteus servo. Lines
/// without a checksum count as none, because servos on a UART refuse them.
fn commanded(line: &[u8]) -> Option<(usize, u8)> {
    let text = std::str::from_utf8(line).ok().filter(|text| text.contains('*'))?;
    let mut words = text.strip_prefix("can send ")?.split(' ');
    let id = usize::from_str_radix(words.next()?, 16).ok()?;
    // The subframe writes one int8 to register 0, the mode.
    let mode = words.next()?.strip_prefix("0100")?.get(..2)?;
    Some((id & 0xff, u8::from_str_radix(mode, 16).ok()?))
}

/// Returns the simulated rig of a rig file. A hand holds the sphere still.
fn simulated(config: &RigConfig) -> Outcome<SimulatedRig> {
    let line = config.link.protocol.into();
    let mut rig = SimulatedRig::new(&SimulatedConfig { line, ..SimulatedConfig::new(&config.rig) })?;
    rig.set_hand(Some(Hand { stiffness: 50.0, damping: 1.0, amplitude: 0.0, ..Hand::default() }));
    if config.link.protocol == Protocol::Odrive {
        // The driver does not send an ODrive its watchdog time.
        let watchdog_s = f64::from(config.link.watchdog_ms) * 1e-3;
        for joint in 0..config.rig.device.joints() {
            rig.controllers_mut().set(joint, "config.watchdog_timeout", watchdog_s);
        }
    }
    Ok(rig)
}

/// Makes the watchdog of one joint's controller expire.
fn expire(rig: &mut SimulatedRig, protocol: Protocol, now_ns: u64) {
    if protocol != Protocol::Moteus {
        // Commands come once in a millisecond, which is then too seldom.
        rig.controllers_mut().set(ONE, "config.watchdog_timeout", 1e-4);
        return;
    }
    // A servo gets its watchdog time with each command. Another program on the bus commands the
    // servo no torque for 1 us, which expires before the next command of the server.
    let mut frame = CanFdFrame::new();
    frame.arbitration_id = calculate_arbitration_id(0, ONE as i8 + 1, 0, false);
    PositionCommand::new()
        .position(f32::NAN)
        .kp_scale(0.0)
        .kd_scale(0.0)
        .watchdog_timeout(1e-6)
        .serialize(&mut frame, &PositionFormat::default());
    let options = EncodeOptions { checksum: true, ..EncodeOptions::default() };
    let mut line = [0; MAX_LINE_LENGTH];
    // A buffer of this length is always sufficient.
    let length = encode_can_send(&frame, &options, &mut line).unwrap_or(0);
    // The server has not asked for the adapter's `OK`.
    rig.receive(now_ns, &line[..length], &mut Vec::new());
}

/// Makes the rig misbehave as `order` says.
fn misbehave(rig: &mut SimulatedRig, protocol: Protocol, now_ns: u64, order: &str) -> Outcome<()> {
    match order {
        "mark" => {}
        "mute" => rig.inject(InjectedFault::Mute(true)),
        "reboot" => rig.inject(InjectedFault::Reboot),
        "deafen_one" => rig.inject(InjectedFault::DeafOne { joint: ONE, on: true }),
        "fail_one" => rig.inject(InjectedFault::FailedOne { joint: ONE, on: true }),
        "reboot_one" => rig.inject(InjectedFault::RebootOne(ONE)),
        "expire_one" => expire(rig, protocol, now_ns),
        _ => {
            let share = order.strip_prefix("noise ").ok_or(format!("{order}?"))?.parse()?;
            let (latency_s, command_latency_s, jitter_s, loss) = (0.0, 0.0, 0.0, 0.0);
            let link =
                Link { latency_s, command_latency_s, jitter_s, loss, corrupt: share, ..Link::default() };
            rig.set_link(Some(link));
        }
    }
    Ok(())
}

/// Runs simulated motor controllers of `protocol` on a pseudo-terminal until standard input ends.
/// Prints the path of the terminal first.
pub(crate) fn run(protocol: Protocol) -> Outcome<()> {
    let (mut near, _far, asked) = far::terminal()?;
    let config = rigs::on_device(protocol)?;
    let (mut rig, joints) = (simulated(&config)?, config.rig.device.joints());
    let mut record = Record::default();
    let (start, mut buffer, mut reply) = (now_ns(), [0; 4096], Vec::new());
    let (mut babbles, mut random) = (false, Rand64::new(7));
    loop {
        match asked.try_recv() {
            Ok(order) if order == "report" => println!("{}", record.report(joints)),
            Ok(order) => {
                record.begin(now_ns() - start);
                if order == "babble" {
                    babbles = true;
                } else {
                    misbehave(&mut rig, protocol, now_ns() - start, &order)?;
                }
            }
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => return Ok(()),
        }
        if babbles {
            far::babble(&mut near, &mut random);
        }
        let now = now_ns() - start;
        let next = rig.next_arrival_ns().map_or(LOOK_NS, |due| due.saturating_sub(now).min(LOOK_NS));
        near.set_timeout(Duration::from_nanos(next))?;
        // Without bytes, the sphere moves and controllers send what nobody has asked for.
        let n = near.read(&mut buffer).unwrap_or(0);
        if protocol == Protocol::Moteus {
            record.count_stops(&buffer[..n]);
        }
        let now = now_ns() - start;
        rig.receive(now, &buffer[..n], &mut reply);
        record.look(rig.joint_torque(), now);
        if !babbles && !reply.is_empty() {
            // Bytes that the line does not take are lost.
            let _ = near.write(&reply);
        }
        reply.clear();
    }
}
