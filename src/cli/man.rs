//! `hbot man`: writes the man pages of all commands, for the Debian package.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use clap::{Args, CommandFactory as _};

use super::Cli;

/// Options of `hbot man`.
#[derive(Debug, Args)]
pub(crate) struct ManArgs {
    /// Existing folder for the pages; pages with the same names are replaced
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

pub(crate) fn run(args: &ManArgs) -> anyhow::Result<ExitCode> {
    clap_mangen::generate_to(Cli::command(), &args.folder)
        .with_context(|| format!("man pages in {}", args.folder.display()))?;
    Ok(ExitCode::SUCCESS)
}
