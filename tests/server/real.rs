//! A server whose motor controllers are behind a pseudo-terminal: to the server, a real rig.

use std::path::PathBuf;

use hbot_config::RigConfig;
use hbot_config::rig::Protocol;
use hbot_sim::pty::{PtyOptions, PtyRig, spawn_pty};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};

use crate::process::*;

/// A server with a scene that pushes, and its simulated motor controllers.
pub(crate) struct RealRig {
    pub(crate) config: RigConfig,
    pub(crate) controllers: PtyRig,
    pub(crate) server: Process,
    /// A symbolic link to the pseudo-terminal: the port of the server.
    pub(crate) port: PathBuf,
    _folder: tempfile::TempDir,
}

impl RealRig {
    /// Starts a server for the rig file `text`, whose controllers speak `protocol`. Before that,
    /// `change` can change the simulated controllers.
    pub(crate) fn start(text: &str, protocol: Protocol, change: impl FnOnce(&mut SimulatedRig)) -> Self {
        // A busy machine must not cause a fault.
        let patient = text.replace("timeout_ticks = 20", "timeout_ticks = 1000\nwatchdog_ms = 1000");
        assert_ne!(patient, text, "the time-out is written otherwise");
        // All joints are on one line, because the simulated rig has only one.
        let patient = patient.replace("port = 1", "port = 0");
        let config = RigConfig::from_toml(&patient, "patient.toml").expect("legal");
        let simulated = SimulatedConfig { line: protocol.into(), ..SimulatedConfig::new(&config.rig) };
        let mut simulated = SimulatedRig::new(&simulated).expect("it can be simulated");
        if protocol == Protocol::Odrive {
            // Close to the longest watchdog time that the driver accepts.
            for joint in 0..4 {
                assert!(simulated.controllers_mut().set(joint, "config.watchdog_timeout", 0.1));
            }
        }
        change(&mut simulated);
        let folder = tempfile::tempdir().expect("a folder");
        let [rig, port] = ["rig.toml", "line"].map(|name| folder.path().join(name));
        std::fs::write(&rig, patient).expect("written");
        let controllers = plugged(simulated, &port);
        let [rig, line] = [&rig, &port].map(|path| path.to_str().expect("UTF-8"));
        let args = ["--rig", rig, "--port", line, "--scene", &push_scene(folder.path())];
        let server = Process::start(&args, folder.path());
        Self { config, controllers, server, port, _folder: folder }
    }

    /// Pulls the plug of the controllers, calls `meanwhile`, and connects them again.
    pub(crate) fn replugged(self, meanwhile: impl FnOnce(&mut SimulatedRig)) -> Self {
        std::fs::remove_file(&self.port).expect("it was there");
        let mut rig = self.controllers.stop().expect("it ran");
        meanwhile(&mut rig);
        Self { controllers: plugged(rig, &self.port), ..self }
    }

    /// Returns whether any motor gives torque.
    pub(crate) fn pushes(&self) -> bool {
        let torque = self.controllers.call(|rig| *rig.joint_torque()).expect("they are there");
        torque.iter().any(|torque| *torque != 0.0)
    }

    /// Returns the answer of the controllers to `bytes`. They go directly to the simulated rig, so
    /// they do not disturb the server's line.
    pub(crate) fn answer(&self, bytes: Vec<u8>) -> String {
        let reply = self.controllers.call(move |rig| {
            let mut reply = Vec::new();
            rig.receive(0, &bytes, &mut reply);
            String::from_utf8(reply).expect("text")
        });
        reply.expect("they are there")
    }
}

fn plugged(rig: SimulatedRig, port: &std::path::Path) -> PtyRig {
    let pty = spawn_pty(rig, PtyOptions::default()).expect("this test needs pseudo-terminals (/dev/ptmx)");
    std::os::unix::fs::symlink(pty.path(), port).expect("a link");
    pty
}
