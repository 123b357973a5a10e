//! `hbot completions`: prints a script by which a shell asks this program for completions, or
//! installs such scripts and the man pages for one user. Also the answers to the shell.

mod bash;
mod values;

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use clap::{Args, Command};
use clap_complete::env::{Elvish, Fish, Powershell, Shells, Zsh};
use clap_complete::{CompleteEnv, Shell};

use super::out::say;
use super::{command, man, out, own_folder};

/// The variable by which a script asks. The usual one, `COMPLETE`, could be set for another reason.
const VARIABLE: &str = "HBOT_COMPLETE";

/// The shells that are known.
const SHELLS: Shells<'static> = Shells(&[&bash::Bash, &Elvish, &Fish, &Powershell, &Zsh]);

/// Options of `hbot completions`.
#[derive(Debug, Args)]
pub(crate) struct CompletionsArgs {
    /// Shell for which the script is
    #[arg(value_enum, required_unless_present = "install")]
    shell: Option<Shell>,
    /// Write the scripts for bash and fish, and the man pages, below the user's data folder:
    /// XDG_DATA_HOME, or ~/.local/share
    #[arg(long, conflicts_with = "shell")]
    install: bool,
}

/// Answers a shell that asks for completions, and ends the program. Returns if no shell asks.
pub(crate) fn answer() {
    CompleteEnv::with_factory(|| {
        let mut all = command();
        all.build();
        offered(&all)
    })
    .var(VARIABLE)
    .shells(SHELLS)
    .complete();
}

pub(crate) fn run(args: &CompletionsArgs) -> anyhow::Result<ExitCode> {
    match args.shell {
        Some(shell) => out::line(format_args!("{}", String::from_utf8_lossy(&script(shell)?).trim_end()))?,
        None => install()?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the script. It calls this program as it was called: by its name, or by its whole path.
fn script(shell: Shell) -> anyhow::Result<Vec<u8>> {
    let called = PathBuf::from(std::env::args_os().next().unwrap_or_else(|| "hbot".into()));
    let program = if called.components().count() > 1 { std::path::absolute(called)? } else { called };
    let writer = SHELLS.completer(&shell.to_string()).context("no script is known for this shell")?;
    let mut script = Vec::new();
    writer.write_registration(VARIABLE, "hbot", "hbot", &program.to_string_lossy(), &mut script)?;
    if shell == Shell::Zsh {
        // Found in a folder of $fpath, the file is the function that has to complete at once.
        writeln!(script, "if [ \"$funcstack[1]\" = _hbot ]; then _clap_dynamic_completer_hbot \"$@\"; fi")?;
    }
    Ok(script)
}

/// Returns a command, which is built, as it is offered: without hidden subcommands, with the values
/// of its arguments, and with options only where a dash was typed or nothing else is possible.
fn offered(command: &Command) -> Command {
    // clap keeps names that live as long as the program.
    let name: &'static str = command.get_name().to_owned().leak();
    let arguments = command.get_arguments().map(|argument| {
        let argument = argument.clone().hide(!argument.is_positional());
        match values::of(name, argument.get_id().as_str()) {
            Some(values) => argument.add(values),
            None => argument,
        }
    });
    Command::new(name)
        .about(command.get_about().cloned().unwrap_or_default())
        .version(env!("CARGO_PKG_VERSION"))
        .disable_version_flag(true)
        .disable_help_flag(true)
        .disable_help_subcommand(true)
        .args(arguments)
        .subcommands(command.get_subcommands().filter(|sub| !sub.is_hide_set()).map(offered))
}

fn install() -> anyhow::Result<()> {
    let data = own_folder("XDG_DATA_HOME", ".local/share")
        .context("no folder of this user is known: neither XDG_DATA_HOME nor HOME is an absolute path")?;
    let pages = data.join("man/man1");
    man::write(&pages)?;
    say!("man pages  {}", pages.display())?;
    if !man_looks_in(&data) {
        say!("           man finds them after: export MANPATH={}:", data.join("man").display())?;
    }
    for (shell, file) in [
        (Shell::Bash, "bash-completion/completions/hbot"),
        (Shell::Fish, "fish/vendor_completions.d/hbot.fish"),
    ] {
        let file = data.join(file);
        let script = script(shell)?;
        std::fs::create_dir_all(file.parent().unwrap_or(&data))
            .and_then(|()| std::fs::write(&file, script))
            .with_context(|| file.display().to_string())?;
        say!("{shell:9}  {}", file.display())?;
    }
    say!("zsh        hbot completions zsh > FOLDER/_hbot, with a folder of your $fpath")?;
    Ok(())
}

/// Returns whether man looks for pages in this data folder: it looks in `share` beside each `bin`
/// of `PATH`.
fn man_looks_in(data: &Path) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|folder| {
        folder.parent().is_some_and(|parent| folder.ends_with("bin") && parent.join("share") == data)
    })
}
