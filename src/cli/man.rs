//! `hbot man`: writes the man pages of all commands, for the Debian package.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use clap::{Args, Command, CommandFactory as _};

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
    let mut all = Cli::command().disable_help_subcommand(true);
    all.build();
    write_with_subcommands(&all, folder).with_context(|| format!("man pages in {}", folder.display()))
}

/// Writes the page of a command, which is built, and those of its subcommands. Exit codes have the
/// heading that people look for in man pages.
fn write_with_subcommands(command: &Command, folder: &Path) -> std::io::Result<()> {
    for sub in command.get_subcommands().filter(|sub| !sub.is_hide_set()) {
        write_with_subcommands(sub, folder)?;
    }
    let page = clap_mangen::Man::new(command.clone());
    let mut text = Vec::new();
    page.render(&mut text)?;
    let text = String::from_utf8_lossy(&text);
    let text = text.replace(".SH EXTRA\nExit codes:\n", ".SH \"EXIT STATUS\"\n");
    std::fs::write(folder.join(page.get_filename()), text)
}
