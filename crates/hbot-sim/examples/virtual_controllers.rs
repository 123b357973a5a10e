//! Runs simulated motor controllers of the prototype behind a pseudo-terminal, so that another
//! program, such as a vendor's client, can control them. It prints the path of the pseudo-terminal
//! and runs until its standard input ends.
//!
//! ```text cargo run -p hbot-sim --example virtual_controllers -- moteus ```

use std::io::{Write as _, stdin, stdout};

use hbot_config::RigConfig;
use hbot_config::rig::Protocol;
use hbot_sim::pty::{PtyOptions, spawn_pty};
use hbot_sim::rig::{SimulatedConfig as Simulated, SimulatedRig};

/// The protocols that the command line argument can name.
const PROTOCOLS: [Protocol; 3] = [Protocol::Hbot, Protocol::Moteus, Protocol::Odrive];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = std::env::args().nth(1).ok_or("name a protocol, such as moteus")?;
    let protocol =
        PROTOCOLS.into_iter().find(|it| it.name() == name).ok_or(format!("{name} is no protocol"))?;
    let mut rig = RigConfig::prototype().rig;
    if let Some(counts) = protocol.counts_per_turn() {
        rig = rig
            .with(|parts| parts.joints.iter_mut().for_each(|joint| joint.counts_per_turn = counts))
            .map_err(|error| error.to_string())?;
    }
    let mut config = Simulated::new(&rig);
    config.line = protocol.into();
    let pty =
        spawn_pty(SimulatedRig::new(&config).map_err(|error| error.to_string())?, PtyOptions::default())
            .map_err(|error| error.to_string())?;
    println!("{}", pty.path().display());
    stdout().flush()?;
    // Wait until the other program is done and closes the standard input.
    std::io::copy(&mut stdin(), &mut std::io::sink())?;
    Ok(())
}
