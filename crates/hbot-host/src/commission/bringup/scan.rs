//! Lists the controllers on the lines of a rig. A scan changes nothing.

use std::sync::mpsc;

use hbot_config::RigConfig;
use hbot_config::rig::Port;

use crate::bus::{Expected, Found, MeetError, Protocol, driver};
use crate::line::serial::Serial;
use crate::line::{Line, Memory};
use crate::rig::attach::{AttachError, simulated_rig};
use crate::rig::layout::Layout;

/// The controllers found on one line, compared with the rig file.
#[derive(Debug)]
pub struct Scanned {
    /// Name of the serial port.
    pub port: String,
    /// All controllers that answered, in the order of their ids.
    pub found: Vec<Found>,
    /// Ids that more than one controller has.
    pub twice: Vec<u8>,
    /// Ids in the rig file for which no controller answered.
    pub missing: Vec<u8>,
    /// Ids of controllers that answered but are not in the rig file.
    pub others: Vec<u8>,
}

impl Scanned {
    /// Returns whether every controller of the rig file answered exactly once, no other controller
    /// answered, and all settings are right.
    #[must_use]
    pub fn is_good(&self) -> bool {
        let crowd = [&self.twice, &self.missing, &self.others];
        crowd.iter().all(|ids| ids.is_empty()) && self.found.iter().all(|it| it.remedies.is_empty())
    }
}

/// Lists the controllers that answer on each line of `rig`.
///
/// # Errors
/// Fails if a port cannot be opened, or if no controller answers on it.
pub fn scan(rig: &RigConfig) -> Result<Vec<Scanned>, AttachError> {
    let (layout, protocol) = (Layout::of(rig), driver(rig.link.protocol));
    let ports = match &rig.link.port {
        Port::Sim | Port::SimPty => vec![rig.link.port.to_string()],
        Port::Devices(devices) => devices.clone(),
    };
    let one = |(bus, port): (usize, &String)| {
        let expected = Expected::new(port, &rig.rig, &layout, bus);
        let mut line: Box<dyn Line> = match &rig.link.port {
            Port::Sim | Port::SimPty => {
                // No other thread changes this simulated rig, so its channel has no sender.
                let (_, calls) = mpsc::channel();
                Box::new(Memory::new(simulated_rig(rig, Default::default())?, calls))
            }
            Port::Devices(_) => Box::new(Serial::open(port, rig.link.baud)?),
        };
        Ok(scan_line(protocol, line.as_mut(), &expected)?)
    };
    ports.iter().enumerate().map(one).collect()
}

/// Lists the controllers that answer on one line.
///
/// # Errors
/// Fails if no controller answers.
pub fn scan_line(
    protocol: &dyn Protocol,
    line: &mut dyn Line,
    expected: &Expected,
) -> Result<Scanned, MeetError> {
    let found = protocol.scan(line, expected)?;
    let there: Vec<u8> = found.iter().map(|it| it.id).collect();
    let ours: Vec<u8> = (0..expected.joints()).filter_map(|at| Some(expected.joint(at)?.id)).collect();
    let mut twice: Vec<u8> =
        there.iter().copied().filter(|id| there.iter().filter(|other| *other == id).count() > 1).collect();
    twice.dedup();
    Ok(Scanned {
        port: expected.port().to_owned(),
        missing: ours.iter().copied().filter(|id| !there.contains(id)).collect(),
        others: there.iter().copied().filter(|id| !ours.contains(id)).collect(),
        twice,
        found,
    })
}

#[cfg(test)]
mod tests {
    use hbot_sim::controller::InjectedFault;
    use hbot_sim::rig::SimulatedRig;

    use super::*;
    use crate::bus::drivers::moteus::Moteus;

    /// Scans a line of simulated moteus servos after `change` was applied to them. Checks that the
    /// driver accepts the servos exactly if the scan finds nothing wrong.
    fn looked(change: impl FnOnce(&mut SimulatedRig)) -> Result<Scanned, MeetError> {
        let text = include_str!("../../../../../rigs/prototype-moteus.toml");
        let rig = RigConfig::from_toml(text, "rigs/prototype-moteus.toml").expect("legal");
        let mut simulated = simulated_rig(&rig, Default::default()).expect("it can be simulated");
        change(&mut simulated);
        let expected = Expected::new("a line", &rig.rig, &Layout::of(&rig), 0);
        let (_, calls) = mpsc::channel();
        let mut line = Memory::new(simulated, calls);
        let scanned = scan_line(&Moteus, &mut line, &expected);
        // A server refuses the same servos at its start, for the same reason.
        let met = Moteus.meet(&mut line, &expected);
        assert_eq!(met.is_ok(), scanned.as_ref().is_ok_and(Scanned::is_good), "{met:?} {scanned:?}");
        scanned
    }

    #[test]
    fn servos_as_they_must_be_are_found() {
        let scanned = looked(|_| ()).expect("they answer");
        assert!(scanned.is_good(), "{scanned:?}");
        let ids: Vec<_> = scanned.found.iter().map(|it| (it.id, it.supply_v, it.zero)).collect();
        let rotor = Some("known within a turn of the rotor");
        assert_eq!(ids, [1, 2, 3, 4].map(|id| (id, Some(24.0), rotor)));
        assert!(scanned.found[0].firmware.contains("register map 5"), "{scanned:?}");
    }

    #[test]
    fn other_counts_than_the_rig_file_says_are_named_with_the_key() {
        let simulated = simulated_rig(&RigConfig::prototype(), Default::default()).expect("simulated");
        let text = include_str!("../../../../../rigs/prototype.toml");
        let other = text.replace("counts_per_turn = 16384", "counts_per_turn = 4096");
        let other = RigConfig::from_toml(&other, "rigs/prototype.toml").expect("legal");
        let expected = Expected::new("a line", &other.rig, &Layout::of(&other), 0);
        let (_, calls) = mpsc::channel();
        let mut line = Memory::new(simulated, calls);
        let scanned = scan_line(driver(other.link.protocol), &mut line, &expected).expect("they answer");
        assert!(!scanned.is_good());
        let said = &scanned.found[1].remedies[0];
        assert_eq!(said.what, "the rig file says 4096 counts a turn");
        assert_eq!(said.command, "counts_per_turn = 16384 in wheel[0].drive of the rig file");
    }

    #[test]
    fn each_wrong_setting_is_named_with_the_command_that_mends_it() {
        let scanned = looked(|rig| {
            let servos = rig.controllers_mut();
            assert!(servos.set(0, "servo.timeout_mode", 12.0));
            assert!(servos.set(2, "servopos.position_min", -0.01));
            assert!(servos.set(2, "servopos.position_max", 0.01));
        });
        let scanned = scanned.expect("they answer");
        let said: Vec<(u8, &str, &str)> = scanned
            .found
            .iter()
            .flat_map(|it| it.remedies.iter().map(|r| (it.id, r.what.as_str(), r.command.as_str())))
            .collect();
        assert_eq!(said.len(), 3, "{said:?}");
        for ((id, what, command), (joint, name, is, must)) in said.iter().zip([
            (1, "servo.timeout_mode", "12", "0"),
            (3, "servopos.position_min", "-0.01", "nan"),
            (3, "servopos.position_max", "0.01", "nan"),
        ]) {
            assert_eq!(*id, joint);
            assert!(what.starts_with(&format!("{name} is {is}, must be {must}: ")), "{what}");
            assert!(command.contains(&format!("conf set {name} {must}\\nconf write")), "{command}");
            assert!(command.contains(&format!("--fdcanusb 'a line' -t {id} --write-config")), "{command}");
        }
    }

    /// The filters are not wrong settings: servos with any of them are accepted. They are read with
    /// the names and numbers that they have, and those that are later than the rig file says are
    /// warned of.
    #[test]
    fn the_filters_of_each_servo_are_read_and_compared_with_the_rig_file() {
        let scanned = looked(|rig| {
            let servos = rig.controllers_mut();
            assert!(servos.set(1, "motor_position.sources.0.pll_filter_hz", 100.0));
            assert!(servos.set(2, "servo.pid_dq_hz", 50.0));
            assert!(servos.set(3, "motor_position.sources.0.pll_filter_hz", 1000.0));
        });
        let scanned = scanned.expect("they answer");
        assert!(scanned.is_good(), "{scanned:?}");
        let text = include_str!("../../../../../rigs/prototype-moteus.toml");
        let rig = RigConfig::from_toml(text, "rigs/prototype-moteus.toml").expect("legal");
        let told = |at: usize| {
            let it = &scanned.found[at].filtering;
            let [torque, rate] = [&it.torque, &it.rate].map(|lag| lag.as_ref().expect("reported"));
            assert_eq!(torque.setting, "servo.pid_dq_hz");
            assert_eq!(rate.setting, "motor_position.sources.0.pll_filter_hz");
            [torque.hz, rate.hz, 1e3 * torque.seconds, 1e3 * rate.seconds]
        };
        // The simulated servos begin with the bandwidths of the rig file: 0.8 ms and 3.9 ms.
        for (at, expected) in [
            (0, [198.94, 202.41, 0.8, 3.9]),
            (1, [198.94, 100.0, 0.8, 7.894]),
            (2, [50.0, 202.41, 3.183, 3.9]),
            (3, [198.94, 1000.0, 0.8, 0.789]),
        ] {
            for (told, expected) in told(at).into_iter().zip(expected) {
                assert!((told / expected - 1.0).abs() < 1e-3, "{at}: {told} for {expected}");
            }
        }
        let warnings: Vec<Vec<String>> = scanned.found.iter().map(|it| it.filtering.warnings(&rig)).collect();
        assert!(warnings[0].is_empty() && warnings[3].is_empty(), "{warnings:?}");
        assert!(warnings[1][0].contains("write rate_lag = 0.0079"), "{warnings:?}");
        assert!(warnings[2][0].contains("write torque_lag = 0.0032"), "{warnings:?}");
    }

    #[test]
    fn a_servo_that_is_missing_and_two_of_one_id_are_said_to_be() {
        let missing =
            looked(|rig| rig.inject(InjectedFault::DeafOne { joint: 1, on: true })).expect("others answer");
        assert_eq!((missing.missing, missing.twice), (vec![2], vec![]));
        let twice = looked(|rig| rig.controllers_mut().set_id(3, 1)).expect("they answer");
        assert_eq!((twice.missing, twice.twice), (vec![4], vec![1]));
        let other = looked(|rig| rig.controllers_mut().set_id(3, 9)).expect("they answer");
        assert_eq!((other.missing, other.others), (vec![4], vec![9]));
        let silent = looked(|rig| rig.inject(InjectedFault::Deaf(true))).expect_err("nobody answers");
        assert!(matches!(silent, MeetError::Silent { .. }), "{silent}");
    }
}
