//! Tests that what the motor controllers report about themselves reaches clients, with each
//! protocol that a rig file can name.

use hbot_api::{Client, ControllerInfo};
use hbot_config::rig::Protocol;
use hbot_sim::controller::InjectedFault;
use hbot_sim::phenomena::Hand;

use crate::process::*;
use crate::real::RealRig;

/// The simulated controllers of one protocol, and what a client must be told of them.
struct Case {
    protocol: Protocol,
    rig: &'static str,
    firmware: &'static str,
    ids: [Option<u32>; 4],
    /// Torque constant of the simulated motors, N m/A. `None` if they measure no current.
    torque_per_ampere: Option<f64>,
    /// Temperature of a motor that a test has made hot, °C.
    hot: f64,
}

const CASES: [Case; 3] = [
    Case {
        protocol: Protocol::Hbot,
        rig: include_str!("../../rigs/prototype.toml"),
        firmware: hbot_sim::controller::FIRMWARE,
        ids: [None; 4],
        torque_per_ampere: None,
        // The firmware says that a motor is hot by a flag.
        hot: 25.0,
    },
    Case {
        protocol: Protocol::Moteus,
        rig: include_str!("../../rigs/prototype-moteus.toml"),
        firmware: "moteus 0x010f, register map 5",
        ids: [Some(1), Some(2), Some(3), Some(4)],
        torque_per_ampere: Some(0.1),
        hot: 80.0,
    },
    Case {
        protocol: Protocol::Odrive,
        rig: include_str!("../../rigs/prototype-odrive.toml"),
        firmware: "ODrive 0.6.10, watchdog seen to expire idle",
        ids: [Some(0), Some(1), Some(2), Some(3)],
        torque_per_ampere: Some(0.05),
        hot: 155.0,
    },
];

struct Bench {
    rig: RealRig,
    client: Client,
}

impl Bench {
    fn new(case: &Case) -> Self {
        // A hand that holds the sphere still, so that the joint torques stay as they are.
        let still = Hand { stiffness: 50.0, damping: 1.0, amplitude: 0.0, ..Hand::default() };
        let rig = RealRig::start(case.rig, case.protocol, |rig| rig.set_hand(Some(still)));
        let mut client = Client::connect(&rig.server.address, "a test").expect("the server listens");
        client.acquire(false).expect("the lease is free");
        Self { rig, client }
    }

    fn controllers(&mut self) -> Vec<ControllerInfo> {
        self.client.controllers().expect("an answer")
    }

    /// Waits until the answer about all controllers is as `right` says, and returns it.
    fn until(&mut self, what: &str, right: impl Fn(&[ControllerInfo]) -> bool) -> Vec<ControllerInfo> {
        let mut told = Vec::new();
        eventually(what, || {
            told = self.controllers();
            right(&told)
        });
        told
    }

    fn inject(&self, fault: InjectedFault) {
        self.rig.controllers.call(move |rig| rig.inject(fault)).expect("they are there");
    }

    /// Returns the current that each motor must have for the torque that it gives now, A, with
    /// motors that give `torque_per_ampere`, N m/A.
    fn currents(&self, torque_per_ampere: f64) -> Vec<f64> {
        let torque = self.rig.controllers.call(|rig| *rig.joint_torque()).expect("they are there");
        let joints = self.rig.config.rig.joints.iter().zip(torque).take(4);
        joints.map(|(joint, torque)| torque / joint.gear / torque_per_ampere).collect()
    }
}

fn temperatures(told: &[ControllerInfo]) -> Vec<Option<f64>> {
    told.iter().map(|it| it.temperature_c).collect()
}

#[test]
fn what_the_controllers_of_each_protocol_report_reaches_clients() {
    for case in &CASES {
        let name = case.protocol.name();
        let mut bench = Bench::new(case);
        let told = bench.until("temperatures", |told| temperatures(told) == [Some(25.0); 4]);
        for (joint, (it, id)) in told.iter().zip(case.ids).enumerate() {
            assert_eq!((it.joint as usize, it.id), (joint, id), "{name}");
            assert_eq!(it.firmware.as_deref(), Some(case.firmware), "{name}");
            assert_eq!(it.protocol.as_deref(), Some(name));
            assert_eq!(it.port.as_deref(), bench.rig.port.to_str(), "{name}");
        }

        if let Some(constant) = case.torque_per_ampere {
            eventually("the currents of motors that push", || {
                // A machine that stands still for long causes a fault, which must be reset.
                let _ = bench.client.reset().and_then(|_| bench.client.enable());
                let (true_currents, told) = (bench.currents(constant), bench.controllers());
                let pushes = true_currents.iter().any(|ampere| ampere.abs() > 0.02);
                pushes
                    && told.iter().zip(true_currents).all(|(it, ampere)| {
                        // The answer has steps of 0.001 A, and so has a moteus, which rounds
                        // towards zero.
                        it.current_a.is_some_and(|told| (told - ampere).abs() < 0.002)
                    })
            });
        } else {
            assert!(told.iter().all(|it| it.current_a.is_none()), "{name}: {told:?}");
        }

        bench.inject(InjectedFault::Hot { joint: 1, on: true });
        let told = bench.until("a hot motor", |told| {
            told[1].temperature_c == Some(case.hot)
                && (case.hot < 150.0 || told[1].flags == ["overtemperature"])
        });
        assert_eq!(told[0].temperature_c, Some(25.0), "{name}");
        assert!(!told[0].flags.contains(&"overtemperature".to_owned()), "{name}: {:?}", told[0]);

        bench.inject(InjectedFault::DeafOne { joint: 2, on: true });
        let silent = |it: &ControllerInfo| it.flags.contains(&"silent".to_owned());
        // hbot's own firmware controls all joints of a line.
        let all = case.protocol == Protocol::Hbot;
        let told = bench.until("a silent controller", |told| {
            silent(&told[2]) && told.iter().filter(|it| silent(it)).count() == if all { 4 } else { 1 }
        });
        assert_eq!((told[2].current_a, told[2].temperature_c), (None, None), "{name}");
        assert_eq!(told[2].firmware.as_deref(), Some(case.firmware), "{name}: what it was");
        bench.rig.server.end_by(rustix::process::Signal::TERM);
    }
}

#[test]
fn a_hot_motor_of_hbot_s_own_firmware_is_flagged_and_info_says_so() {
    let mut bench = Bench::new(&CASES[0]);
    let info = |bench: &Bench| {
        let mut command = assert_cmd::Command::from_std(hbot());
        command.arg("info").env("HBOT_SERVER", &bench.rig.server.address).assert().success()
    };
    let firmware = hbot_sim::controller::FIRMWARE;
    let line = format!(
        "    wheel A steer    current not reported, 25.0 \u{b0}C, {firmware} on {}",
        bench.rig.port.display()
    );
    bench.until("temperatures", |told| temperatures(told) == [Some(25.0); 4]);
    info(&bench).stdout(contains(format!("{line}\n")));
    bench.inject(InjectedFault::Hot { joint: 0, on: true });
    let told = bench.until("a hot motor", |told| !told[0].flags.is_empty());
    assert_eq!((told[0].flags.as_slice(), told[1].flags.len()), (&["overtemperature".to_owned()][..], 0));
    info(&bench).stdout(contains(format!("{line}; complains of overtemperature\n")));
}
