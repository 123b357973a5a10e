//! `hbot controllers`: simulated motor controllers behind a pseudo-terminal, so that a vendor's
//! tool, a driver or a server can be tried on them.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::anyhow;
use clap::{Args, ValueEnum};
use hbot_config::RigConfig;
use hbot_config::rig::Protocol;
use hbot_sim::pty::{PtyOptions, spawn_pty};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};

use super::out::{note, say};

/// Options of `hbot controllers`.
#[derive(Debug, Args)]
pub(crate) struct ControllersArgs {
    /// What the controllers speak [default: the rig file's protocol]
    #[arg(long, value_enum)]
    protocol: Option<Spoken>,
    /// Rig file (TOML) [default: the prototype, built in]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
}

/// A protocol that simulated controllers speak.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Spoken {
    /// hbot's own serial link
    Hbot,
    /// moteus servos behind an fdcanusb
    Moteus,
    /// ODrives behind a CAN adapter that speaks slcan
    Odrive,
}

impl From<Spoken> for Protocol {
    fn from(spoken: Spoken) -> Self {
        match spoken {
            Spoken::Hbot => Self::Hbot,
            Spoken::Moteus => Self::Moteus,
            Spoken::Odrive => Self::Odrive,
        }
    }
}

/// Runs the controllers until standard input ends or the program is interrupted.
pub(crate) fn run(args: &ControllersArgs) -> anyhow::Result<ExitCode> {
    let config = RigConfig::load(args.rig.as_deref(), &[])?;
    let protocol = args.protocol.map_or(config.link.protocol, Protocol::from);
    let mut rig = config.rig;
    if let Some(counts) = protocol.counts_per_turn() {
        rig = rig
            .with(|parts| parts.joints.iter_mut().for_each(|joint| joint.counts_per_turn = counts))
            .map_err(|error| anyhow!("{error}"))?;
    }
    let mut simulated = SimulatedConfig::new(&rig);
    simulated.line = protocol.into();
    let rig = SimulatedRig::new(&simulated).map_err(|error| anyhow!("{error}"))?;
    let pty = spawn_pty(rig, PtyOptions::default()).map_err(|error| anyhow!("{error}"))?;
    let path = pty.path().display();
    say!("{path}")?;
    note!(
        "Simulated {} controllers of {} answer there; Ctrl-C, or the end of standard input, ends them. A server whose rig file has this protocol moves them: \
         `hbot server --rig FILE --port {path}`",
        protocol.name(),
        config.name
    );
    // A script ends them by closing standard input.
    std::io::copy(&mut std::io::stdin(), &mut std::io::sink())?;
    note!("standard input has ended, and the controllers with it");
    Ok(ExitCode::SUCCESS)
}
