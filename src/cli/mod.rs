//! The command line.

mod bringup;
mod console;
mod doctor;
mod orders;
pub(crate) mod out;
mod rig;
mod scene;
mod secrets;
mod server;
mod status;
mod style;
mod watch;

use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};

/// The server address that commands use where none is given.
const SERVER: &str = "127.0.0.1:4268";
/// The command with which this program starts itself as the helper that switches motors off (see `hbot_host::last_word`).
const LAST_WORD: &str = "last-word";

/// Drives an Hbot, a haptic sphere turned by steered and driven wheels.
///
/// `hbot server` runs the rig, a simulated one where there is none. The other commands are its clients, or check files.
#[derive(Debug, Parser)]
#[command(name = "hbot", version, propagate_version = true, max_term_width = 110)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run the control loop and offer haptics over TCP
    Server(server::ServerArgs),
    /// Show the state of a running server, live
    Watch(watch::WatchArgs),
    /// Check, load and draw scene files; list what they can be made of
    #[command(subcommand)]
    Scene(scene::SceneCommand),
    /// Check rig files
    #[command(subcommand)]
    Rig(rig::RigCommand),
    /// Check this machine for real-time use and serial access, measure, and say how to mend what is wanting
    Doctor(doctor::DoctorArgs),
    /// Stop a running server's motors at once (until `hbot reset`)
    Estop(ServerAddress),
    /// Let a running server's torque ramp down
    Disable(ServerAddress),
    /// Let a running server render: soft start over half a second
    Enable(ServerAddress),
    /// Leave a fault or an emergency stop, once its cause is gone
    Reset(ServerAddress),
    /// Started by `hbot server` and `hbot rig`: switches motors off where they cannot
    #[command(name = LAST_WORD, hide = true)]
    LastWord,
    /// Says which program runs the studies
    #[command(hide = true, disable_help_flag = true, disable_version_flag = true)]
    Study {
        /// What the study was asked for.
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        words: Vec<String>,
    },
}

/// Which server.
#[derive(Debug, Clone, Args)]
pub(crate) struct ServerAddress {
    /// Address and port of the server
    #[arg(long, value_name = "ADDR", default_value = SERVER)]
    server: String,
    /// File with the token that the server asks for
    #[arg(long, value_name = "FILE")]
    token_file: Option<std::path::PathBuf>,
    /// File with the certificate of a server that encrypts, or of the authority that signed it (PEM)
    #[arg(long, value_name = "FILE")]
    ca: Option<std::path::PathBuf>,
}

impl Cli {
    /// Does what the command line says. An exit code other than 0 without an error: what was asked was done, and
    /// its result is bad.
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::Server(args) => server::run(args),
            Command::Watch(args) => watch::run(&args),
            Command::Scene(command) => scene::run(command),
            Command::Rig(command) => rig::run(command),
            Command::Doctor(args) => doctor::run(args),
            Command::Estop(address) => orders::run(&address, orders::Order::Estop),
            Command::Disable(address) => orders::run(&address, orders::Order::Disable),
            Command::Enable(address) => orders::run(&address, orders::Order::Enable),
            Command::Reset(address) => orders::run(&address, orders::Order::Reset),
            Command::LastWord => {
                // Nobody is left to read of an error.
                let _ = hbot_host::last_word::run(std::io::stdin(), std::io::stdout(), std::io::stderr());
                Ok(ExitCode::SUCCESS)
            }
            Command::Study { words } => Ok(studies_are_elsewhere(&words)),
        }
    }
}

/// Says with which command the study runs that `words` ask for. The exit code is that of a wrong command line.
fn studies_are_elsewhere(words: &[String]) -> ExitCode {
    let words = if words.is_empty() { "--help".to_owned() } else { words.join(" ") };
    out::error(&format!(
        "studies are a program by themselves; run `cargo run --release -p hbot-study -- {words}`"
    ));
    ExitCode::from(2)
}
