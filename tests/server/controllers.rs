//! Tests that what the motor controllers report about themselves reaches clients, with each
//! protocol that a rig file can name.

use hbot_api::{Client, ControllerInfo};
use hbot_config::RigConfig;
use hbot_config::rig::Protocol;
use hbot_sim::controller::InjectedFault;
use hbot_sim::phenomena::Hand;
use hbot_sim::pty::{PtyOptions, PtyRig, spawn_pty};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use predicates::str::contains;

use crate::process::{Process, hbot};
use hbot_testing::patience::eventually;

/// A scene with a constant torque, in which every motor has a part.
const PUSH: &str =
    "name = \"Push\"\n[[effect]]\nid = \"push\"\nkind = \"constant\"\ntorque = [0.05, 0.1, 0.1]\n";

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

/// A server whose motor controllers are behind a pseudo-terminal. To the server, this is a real
/// rig.
struct Bench {
    rig: RigConfig,
    simulated: PtyRig,
    server: Process,
    client: Client,
    port: String,
    _folder: tempfile::TempDir,
}

impl Bench {
    fn new(case: &Case) -> Self {
        // A busy machine must not cause a fault.
        let patient = case.rig.replace("timeout_ticks = 20", "timeout_ticks = 1000\nwatchdog_ms = 1000");
        assert_ne!(patient, case.rig, "the time-out is written otherwise");
        // All joints are on one line, because the simulated rig has only one.
        let patient = patient.replace("port = 1", "port = 0");
        let rig = RigConfig::from_toml(&patient, "patient.toml").expect("legal");
        let config = SimulatedConfig { line: case.protocol.into(), ..SimulatedConfig::new(&rig.rig) };
        let mut simulated = SimulatedRig::new(&config).expect("it can be simulated");
        // A hand that holds the sphere still, so that the joint torques stay as they are.
        simulated.set_hand(Some(Hand { stiffness: 50.0, damping: 1.0, amplitude: 0.0, ..Hand::default() }));
        if case.protocol == Protocol::Odrive {
            for joint in 0..4 {
                assert!(simulated.controllers_mut().set(joint, "config.watchdog_timeout", 0.1));
            }
        }
        let simulated = spawn_pty(simulated, PtyOptions::default());
        let simulated = simulated.expect("this test needs pseudo-terminals (/dev/ptmx)");
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
        std::fs::write(path("rig.toml"), &patient).expect("written");
        std::fs::write(path("push.toml"), PUSH).expect("written");
        let port = simulated.path().to_str().expect("UTF-8").to_owned();
        let args = ["--rig", &path("rig.toml"), "--port", &port, "--scene", &path("push.toml")];
        let server = Process::start(&args, folder.path());
        let mut client = Client::connect(&server.address, "a test").expect("the server listens");
        client.acquire(false).expect("the lease is free");
        Self { rig, simulated, server, client, port, _folder: folder }
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
        self.simulated.call(move |rig| rig.inject(fault)).expect("they are there");
    }

    /// Returns the current that each motor must have for the torque that it gives now, A, with
    /// motors that give `torque_per_ampere`, N m/A.
    fn currents(&self, torque_per_ampere: f64) -> Vec<f64> {
        let torque = self.simulated.call(|rig| *rig.joint_torque()).expect("they are there");
        let joints = self.rig.rig.joints.iter().zip(torque).take(4);
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
            assert_eq!(it.port.as_ref(), Some(&bench.port), "{name}");
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
        bench.server.signal(rustix::process::Signal::TERM);
        bench.server.end();
    }
}

#[test]
fn a_hot_motor_of_hbot_s_own_firmware_is_flagged_and_info_says_so() {
    let mut bench = Bench::new(&CASES[0]);
    let info = |bench: &Bench| {
        let mut command = assert_cmd::Command::from_std(hbot());
        command.arg("info").env("HBOT_SERVER", &bench.server.address).assert().success()
    };
    let firmware = hbot_sim::controller::FIRMWARE;
    let line =
        format!("    wheel A steer    current not reported, 25.0 \u{b0}C, {firmware} on {}", bench.port);
    bench.until("temperatures", |told| temperatures(told) == [Some(25.0); 4]);
    info(&bench).stdout(contains(format!("{line}\n")));
    bench.inject(InjectedFault::Hot { joint: 0, on: true });
    let told = bench.until("a hot motor", |told| !told[0].flags.is_empty());
    assert_eq!((told[0].flags.as_slice(), told[1].flags.len()), (&["overtemperature".to_owned()][..], 0));
    info(&bench).stdout(contains(format!("{line}; complains of overtemperature\n")));
    bench.server.signal(rustix::process::Signal::TERM);
    bench.server.end();
}
