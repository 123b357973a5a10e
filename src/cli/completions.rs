//! `hbot completions`: prints a script that completes commands and options in a shell.

use std::process::ExitCode;

use clap::{Args, CommandFactory as _};
use clap_complete::{Shell, generate};

use super::{Cli, out};

/// Options of `hbot completions`.
#[derive(Debug, Args)]
pub(crate) struct CompletionsArgs {
    /// Shell for which the script is
    #[arg(value_enum)]
    shell: Shell,
}

pub(crate) fn run(args: &CompletionsArgs) -> anyhow::Result<ExitCode> {
    // It is written to memory first, because `generate` panics if it cannot write.
    let mut script = Vec::new();
    generate(args.shell, &mut Cli::command(), "hbot", &mut script);
    out::line(format_args!("{}", String::from_utf8_lossy(&script)))?;
    Ok(ExitCode::SUCCESS)
}
