//! `hbot completions`: prints a script that completes commands and options in a shell, or installs
//! such scripts and the man pages for one user.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use clap::{Args, Command, CommandFactory as _};
use clap_complete::{Shell, generate};

use super::out::say;
use super::{Cli, man, out, own_folder};

/// Options of `hbot completions`.
#[derive(Debug, Args)]
pub(crate) struct CompletionsArgs {
    /// Shell for which the script is
    #[arg(value_enum, required_unless_present = "install")]
    shell: Option<Shell>,
    /// Write the scripts for bash and fish, and the man pages, to where they are looked for
    #[arg(long, conflicts_with = "shell")]
    install: bool,
}

pub(crate) fn run(args: &CompletionsArgs) -> anyhow::Result<ExitCode> {
    match args.shell {
        Some(shell) => out::line(format_args!("{}", String::from_utf8_lossy(&script(shell))))?,
        None => install()?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the script. It is written to memory, because `generate` panics if it cannot write.
fn script(shell: Shell) -> Vec<u8> {
    let mut script = Vec::new();
    generate(shell, &mut without_hidden(&Cli::command()), "hbot", &mut script);
    script
}

/// Returns a command without its hidden subcommands, which the scripts would offer.
fn without_hidden(command: &Command) -> Command {
    if !command.get_subcommands().any(Command::is_hide_set) {
        return command.clone();
    }
    let shown = command.get_subcommands().filter(|sub| !sub.is_hide_set()).map(without_hidden);
    // clap keeps names that live as long as the program.
    let name: &'static str = command.get_name().to_owned().leak();
    let bare = Command::new(name).version(env!("CARGO_PKG_VERSION"));
    bare.about(command.get_about().cloned().unwrap_or_default())
        .propagate_version(true)
        .args(command.get_arguments().cloned())
        .subcommands(shown)
}

fn install() -> anyhow::Result<()> {
    let data = own_folder("XDG_DATA_HOME", ".local/share")
        .context("no folder of this user is known: neither XDG_DATA_HOME nor HOME is an absolute path")?;
    let program = std::env::current_exe().context("the path of this program")?;
    let pages = man_folder(&program).unwrap_or_else(|| data.join("man/man1"));
    made(&pages)?;
    man::write(&pages)?;
    say!("man pages  {}", pages.display())?;
    for (shell, file) in [
        (Shell::Bash, "bash-completion/completions/hbot"),
        (Shell::Fish, "fish/vendor_completions.d/hbot.fish"),
    ] {
        let file = data.join(file);
        made(file.parent().unwrap_or(&data))?;
        std::fs::write(&file, script(shell)).with_context(|| file.display().to_string())?;
        say!("{shell:9}  {}", file.display())?;
    }
    say!("zsh        hbot completions zsh > FOLDER/_hbot, with a folder of your $fpath")?;
    Ok(())
}

/// Returns the folder of man pages that belongs to a program in a folder `bin`. Man looks for it
/// beside each folder of `PATH`.
fn man_folder(program: &Path) -> Option<PathBuf> {
    let folder = program.parent().filter(|folder| folder.ends_with("bin"))?;
    Some(folder.parent()?.join("share/man/man1"))
}

fn made(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())
}
