//! The program on the rig PC of an Hbot: parse the command line, do what it says, tell by the exit code whether all went
//! well.

mod cli;

use std::process::ExitCode;

use clap::Parser as _;

fn main() -> ExitCode {
    let cli = cli::Cli::parse();
    match cli.run() {
        Ok(code) => code,
        Err(error) => {
            anstream::eprintln!("{}error:{} {error:#}", cli::style::BAD, cli::style::OFF);
            ExitCode::FAILURE
        }
    }
}
