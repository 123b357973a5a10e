//! The command line of `hbot`.

mod ask;
mod bringup;
pub(crate) mod completions;
mod console;
mod controllers;
mod doctor;
mod explain;
pub(crate) mod habits;
mod hand;
mod man;
mod numbers;
pub(crate) mod orders;
pub(crate) mod out;
mod progress;
mod record;
mod recover;
mod rehearse;
mod replay;
mod rig;
mod rig_drawing;
mod rig_file;
mod rig_new;
mod scene;
mod secrets;
mod server;
mod set;
mod show;
mod sockets;
mod status;
mod style;
mod terminal;
mod watch;

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::builder::{OsStringValueParser, TypedValueParser as _};
use clap::{Args, Command, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

/// The server address that commands use by default.
const SERVER: &str = "127.0.0.1:4268";
/// The hidden command with which this program starts itself as the helper that switches motors off
/// (see `hbot_host::rig::last_word`).
const LAST_WORD: &str = "last-word";

/// The commands with which a person begins, for the help.
const FIRST_STEPS: &str = "\
First steps:
  hbot server                  run a simulated rig (a real one: `--rig FILE`)
  hbot watch                   see the torque, in a second terminal
  hbot set spring stiffness=2  make the spring stiffer
  hbot estop                   stop at once";

/// Drives an Hbot, a haptic sphere turned by steered and driven wheels.
///
/// `hbot server` runs the rig, or a simulated one if there is no rig. The other commands are its
/// clients, or check files.
#[derive(Debug, Parser)]
#[command(name = "hbot", version, propagate_version = true, max_term_width = 110, after_help = FIRST_STEPS)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Chosen,
}

/// Who may stop the rig, and what the exit codes of `hbot estop` mean.
const ESTOP_CODES: &str = "\
Anybody may stop the rig, without the lease. `hbot stop` does the same.

Exit codes:
  0  the server has confirmed that the rig is stopped
  1  it has not: NOT STOPPED. Cut the motors' power
  2  it has, but something on the line was not understood";

#[derive(Debug, Subcommand)]
enum Chosen {
    /// Run the control loop and offer haptics over TCP
    Server(server::ServerArgs),
    /// Stop a running server's motors at once (until `hbot reset`)
    #[command(after_help = ESTOP_CODES, aliases = habits::STOPS)]
    Estop(ServerAddress),
    /// Show the state of a running server, live
    Watch(watch::WatchArgs),
    /// Show the rig, its limits, its motor controllers and the scene of a running server
    Info(show::ShowArgs),
    /// Show the times and the counters of a running server's loop
    #[command(after_help = show::ROWS)]
    Stats(show::ShowArgs),
    /// Change parameters of an effect while a server renders it
    Set(set::SetArgs),
    /// Let the hand of a simulated rig turn the sphere, and show the torque that it feels
    #[command(subcommand)]
    Hand(hand::HandCommands),
    /// Record a running server: what every viewer understands, without the exact inputs
    Record(record::RecordArgs),
    /// Run a recording through the control law again and compare every bit
    Replay(replay::ReplayArgs),
    /// Say what happened before a fault in a recording or flight log
    Explain(explain::ExplainArgs),
    /// Make a readable file of a recording that was cut off or damaged
    Recover(recover::RecoverArgs),
    /// List, check, load and draw scenes
    #[command(subcommand)]
    Scene(scene::SceneCommand),
    /// Write and check rig files, and bring a rig up
    #[command(subcommand)]
    Rig(rig::RigCommand),
    /// Run simulated motor controllers behind a pseudo-terminal, for vendors' tools and rehearsals
    Controllers(rehearse::ControllersArgs),
    /// Check this machine for real-time use and serial access, and say how to correct what is
    /// missing
    Doctor(doctor::DoctorArgs),
    /// Ramp down the torque of a running server
    Disable(Anybody),
    /// Enable the torque of a running server, and wait until it has risen: half a second
    Enable(Commanding),
    /// Leave a fault or an emergency stop after its cause is gone
    Reset(Commanding),
    /// Print a script that completes commands in a shell, or install it and the man pages
    Completions(completions::CompletionsArgs),
    /// Write the man pages of all commands into a folder
    #[command(hide = true)]
    Man(man::ManArgs),
    /// Switch motors off if `hbot server` or `hbot rig` dies (started by them)
    #[command(name = LAST_WORD, hide = true)]
    LastWord,
}

/// What the exit codes of a command mean whose help says nothing else.
const EXIT_CODES: &str = "\
Exit codes:
  0  done, and nothing is wrong
  1  refused, failed, or something is wrong; it is printed
  2  the command line is wrong";

/// Returns the command line. The help of every command says what its exit codes mean.
pub(crate) fn command() -> Command {
    told_codes(Cli::command())
}

fn told_codes(mut command: Command) -> Command {
    let subcommands: Vec<String> = command.get_subcommands().map(|sub| sub.get_name().to_owned()).collect();
    for name in &subcommands {
        command = command.mut_subcommand(name, told_codes);
    }
    let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    if !subcommands.is_empty() || help.contains("Exit codes:") {
        return command;
    }
    let gap = if help.is_empty() { "" } else { "\n\n" };
    command.after_help(format!("{help}{gap}{EXIT_CODES}"))
}

/// Returns the folder of this user that an environment variable names, or else the one below the
/// home (XDG base directories). Returns `None` if neither is an absolute path.
fn own_folder(variable: &str, below_home: &str) -> Option<PathBuf> {
    let absolute = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    absolute(variable).or_else(|| absolute("HOME").map(|home| home.join(below_home)))
}

/// The server to connect to, with the files that authenticate both sides.
#[derive(Debug, Clone, Args)]
pub(crate) struct ServerAddress {
    /// Address and port of the server
    #[arg(long, value_name = "ADDR", env = "HBOT_SERVER", hide_env_values = true, default_value = SERVER, value_parser = server_or_default)]
    server: String,
    /// File with the token that the server asks for
    #[arg(long, value_name = "FILE", env = "HBOT_TOKEN_FILE", hide_env_values = true, value_parser = OsStringValueParser::new().map(PathBuf::from))]
    token_file: Option<PathBuf>,
    /// File with the server's TLS certificate, or that of the authority that signed it (PEM)
    #[arg(long, value_name = "FILE")]
    ca: Option<PathBuf>,
}

impl ServerAddress {
    /// Returns the file with the token, if one is named. An empty variable names none.
    fn token_file(&self) -> Option<&Path> {
        self.token_file.as_deref().filter(|file| !file.as_os_str().is_empty())
    }
}

/// Returns the address that a text names. An empty variable is as if it was not set.
fn server_or_default(text: &str) -> Result<String, &'static str> {
    match text {
        "" => Ok(SERVER.to_owned()),
        url if url.contains("://") => {
            Err("an address and a port without http://, as the server prints after `listen`")
        }
        address => Ok(address.to_owned()),
    }
}

/// The server to command. A command takes the lease for as long as it runs.
#[derive(Debug, Clone, Args)]
pub(crate) struct Commanding {
    #[command(flatten)]
    address: ServerAddress,
    /// Take the lease even if another client holds it; that client is told
    #[arg(long)]
    steal: bool,
}

/// The server of an order that needs no lease.
#[derive(Debug, Clone, Args)]
pub(crate) struct Anybody {
    #[command(flatten)]
    address: ServerAddress,
    /// Has no effect: people add it because other commands need it
    #[arg(long, hide = true)]
    steal: bool,
}

impl Cli {
    /// Parses the command line.
    pub(crate) fn of(arguments: &[OsString]) -> Result<Self, clap::Error> {
        let mut command = command();
        let matches = command.try_get_matches_from_mut(arguments)?;
        Self::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
    }

    /// Runs the command. If the command was carried out but its result is bad, returns an exit code
    /// other than 0.
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Chosen::Server(args) => server::run(args),
            Chosen::Watch(args) => watch::run(&args),
            Chosen::Record(args) => record::run(&args),
            Chosen::Replay(args) => replay::run(&args),
            Chosen::Explain(args) => explain::run(&args),
            Chosen::Recover(args) => recover::run(&args),
            Chosen::Controllers(args) => rehearse::run(&args),
            Chosen::Scene(command) => scene::run(command),
            Chosen::Rig(command) => rig::run(command),
            Chosen::Doctor(args) => doctor::run(args),
            Chosen::Info(args) => show::info(&args),
            Chosen::Stats(args) => show::stats(&args),
            Chosen::Set(args) => set::run(&args),
            Chosen::Hand(command) => hand::run(&command),
            Chosen::Estop(address) => orders::estop(&address),
            Chosen::Disable(to) => orders::disable(&to.address),
            Chosen::Enable(to) => orders::enable(&to),
            Chosen::Reset(to) => orders::reset(&to),
            Chosen::Completions(args) => completions::run(&args),
            Chosen::Man(args) => man::run(&args),
            Chosen::LastWord => {
                // An error cannot be reported: the program that started this one is gone.
                let _ =
                    hbot_host::rig::last_word::run(std::io::stdin(), std::io::stdout(), std::io::stderr());
                Ok(ExitCode::SUCCESS)
            }
        }
    }
}
