//! The program on the rig PC of an Hbot: parse the command line, do what it says, tell by the exit code whether all went
//! well.

// Where they cannot write they end in a panic; `cli/out.rs` has what does not.
#![cfg_attr(not(test), warn(clippy::print_stdout, clippy::print_stderr))]

mod cli;

use std::process::ExitCode;

use clap::Parser as _;

fn main() -> ExitCode {
    let done = match cli::Cli::try_parse() {
        Ok(cli) => cli.run(),
        Err(answer) => cli::out::answer(&answer),
    };
    done.unwrap_or_else(|error| {
        cli::out::error(&error);
        ExitCode::FAILURE
    })
}
