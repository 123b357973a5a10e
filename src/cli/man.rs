//! `hbot man`: writes the man pages of all commands, for the Debian package.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use clap::{Arg, Args, Command};

use super::command;
use super::out::say;

/// Options of `hbot man`.
#[derive(Debug, Args)]
pub(crate) struct ManArgs {
    /// Folder for the pages; pages with the same names are replaced
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

pub(crate) fn run(args: &ManArgs) -> anyhow::Result<ExitCode> {
    let name = args.folder.to_string_lossy();
    if !args.folder.exists() && command().find_subcommand(&*name).is_some() {
        bail!(
            "this writes all man pages into a folder; `hbot help {name}` shows the help of `hbot {name}`. For a folder \
             with this name write ./{name}"
        );
    }
    write(&args.folder)?;
    say!("man pages  {}", args.folder.display())?;
    Ok(ExitCode::SUCCESS)
}

/// Writes the man pages of all commands into a folder, which is made if it does not exist.
pub(super) fn write(folder: &Path) -> anyhow::Result<()> {
    let mut all = command().disable_help_subcommand(true);
    all.build();
    std::fs::create_dir_all(folder)
        .and_then(|()| write_with_subcommands(&all, folder))
        .with_context(|| format!("man pages in {}", folder.display()))
}

/// Returns the usage of a command with the values of its options, which clap_mangen leaves out.
fn usage(command: &Command) -> String {
    let (positionals, options): (Vec<&Arg>, Vec<&Arg>) =
        command.get_arguments().filter(|argument| !argument.is_hide_set()).partition(|it| it.is_positional());
    let options = options
        .into_iter()
        .map(|option| if option.is_required_set() { option.to_string() } else { format!("[{option}]") });
    let name = command.get_bin_name().unwrap_or_else(|| command.get_name()).to_owned();
    let subcommand = command.has_subcommands().then(|| "<COMMAND>".to_owned());
    let words = std::iter::once(name).chain(options).chain(positionals.iter().map(ToString::to_string));
    words.chain(subcommand).collect::<Vec<_>>().join(" ")
}

/// Writes the page of a command, which is built, and those of its subcommands. Exit codes have the
/// heading that people look for in man pages.
fn write_with_subcommands(command: &Command, folder: &Path) -> std::io::Result<()> {
    for sub in command.get_subcommands().filter(|sub| !sub.is_hide_set()) {
        write_with_subcommands(sub, folder)?;
    }
    let page = clap_mangen::Man::new(command.clone().override_usage(usage(command)));
    let mut text = Vec::new();
    page.render(&mut text)?;
    let text = String::from_utf8_lossy(&text);
    let text = text.replace(".SH EXTRA\nExit codes:\n", ".SH \"EXIT STATUS\"\n");
    std::fs::write(folder.join(page.get_filename()), text)
}
