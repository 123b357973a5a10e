//! `hbot man`: writes the man pages of all commands, for the Debian package.

use std::path::{Path, PathBuf};
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
    write(&args.folder)?;
    Ok(ExitCode::SUCCESS)
}

/// Writes the man pages of all commands into a folder that exists.
pub(super) fn write(folder: &Path) -> anyhow::Result<()> {
    clap_mangen::generate_to(Cli::command(), folder)
        .with_context(|| format!("man pages in {}", folder.display()))
}
