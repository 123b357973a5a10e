//! The output of commands, and what happens if it cannot be written.
//!
//! Standard output: if the reader has gone away (`| head`), it has read what it needed. The rest of
//! the output is dropped silently. The command continues to its end, so that its exit code shows
//! whether it succeeded. Only `hbot watch`, which does nothing but write, ends with exit code 0.
//! Any other problem, such as a full device, is an ordinary error: one line, exit code 1.
//!
//! Standard error: text that cannot be written there is lost, because there is no other place to
//! report it.
//!
//! `hbot server` never waits for a reader and does not end without one. It writes through
//! `console.rs`.

use std::ffi::OsString;
use std::fmt::{Arguments, Display};
use std::fs::File;
use std::io::{ErrorKind, Result, Write as _};
use std::net::SocketAddr;
use std::os::unix::fs::FileTypeExt as _;
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context as _, anyhow, ensure};
use hbot_api::Plain;

use super::{command, habits, orders, style, terminal};

/// Writes a line to standard output like `println!`, but returns an error instead of panicking.
macro_rules! say {
    ($($text:tt)*) => { $crate::cli::out::line(format_args!($($text)*)) };
}
pub(crate) use say;

/// Writes text for people to standard output like `say!`, with its lines broken at the width of the
/// terminal, if it is one.
macro_rules! tell {
    ($($text:tt)*) => { $crate::cli::out::prose(format_args!($($text)*)) };
}
pub(crate) use tell;

/// Writes a line to standard error. Failures are ignored.
macro_rules! note {
    ($($text:tt)*) => { $crate::cli::out::aside(format_args!($($text)*)) };
}
pub(crate) use note;

/// Whether the output still has a reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reader {
    There,
    Gone,
}

/// Converts the result of writing to standard output. A closed pipe is not an error: it means that
/// the reader is gone.
pub(crate) fn written(result: Result<()>) -> anyhow::Result<Reader> {
    match result {
        Ok(()) => Ok(Reader::There),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(Reader::Gone),
        Err(error) => Err(error).context("standard output cannot be written"),
    }
}

/// Writes a line to standard output, for `say!`.
pub(crate) fn line(text: Arguments<'_>) -> anyhow::Result<()> {
    let mut out = anstream::stdout().lock();
    written(writeln!(out, "{text}").and_then(|()| out.flush())).map(|_| ())
}

/// Writes text to standard output, for `tell!`.
pub(crate) fn prose(text: Arguments<'_>) -> anyhow::Result<()> {
    line(format_args!("{}", fitted(text, std::io::stdout())))
}

/// Writes text to standard error, for `note!`.
pub(crate) fn aside(text: Arguments<'_>) {
    // A failure cannot be reported anywhere.
    let _ = writeln!(anstream::stderr(), "{}", fitted(text, std::io::stderr()));
}

/// Returns a text whose lines fit the terminal that `output` writes to, if it is one.
pub(crate) fn fitted(text: Arguments<'_>, output: impl std::os::fd::AsFd) -> String {
    let variable = std::env::var("HBOT_SERVER").ok();
    let text = addressed(&text.to_string(), typed_server().as_deref(), variable.as_deref());
    let text = pasteable(&text, &program());
    terminal::columns(output).map_or_else(|| text.clone(), |columns| terminal::wrapped(&text, columns))
}

/// Returns how this program was called: `cargo run`, the path that was typed, or `hbot` if it was
/// found without one.
fn program() -> String {
    let called = std::env::args_os().next().unwrap_or_default().to_string_lossy().into_owned();
    let release = if cfg!(debug_assertions) { "" } else { " --release" };
    match std::env::var_os("CARGO_MANIFEST_DIR") {
        _ if !called.contains('/') => "hbot".to_owned(),
        Some(_) => format!("cargo run{release}"),
        None => called,
    }
}

/// Returns the server that the command line names.
fn typed_server() -> Option<String> {
    let arguments: Vec<OsString> = std::env::args_os().collect();
    let line = if habits::is_stop(&arguments) { habits::stop_line(&arguments).0 } else { arguments };
    let mut words = line.into_iter().map(|word| word.to_string_lossy().into_owned());
    while let Some(word) = words.next() {
        match word.strip_prefix("--server") {
            Some("") => return words.next(),
            Some(rest) if rest.starts_with('=') => return Some(rest[1..].to_owned()),
            _ => {}
        }
    }
    None
}

/// Commands that ask a server and that texts name without its address.
const ASKS: [&str; 10] =
    ["disable", "enable", "estop", "hand turn", "info", "reset", "scene load", "scene show", "set", "watch"];

/// Returns a text for people whose commands of hbot name the server that the user has `typed`, and
/// whose `hbot server` listens where the user's commands ask: there, or where the `variable`
/// HBOT_SERVER says.
fn addressed(text: &str, typed: Option<&str>, variable: Option<&str>) -> String {
    let is_here = |server: &&str| server.parse().is_ok_and(|at: SocketAddr| at.ip().is_loopback());
    let listen = typed.or(variable).filter(is_here);
    let asks = |command: &str| {
        let mut rests = ASKS.iter().filter_map(|name| command.strip_prefix(name));
        rests.any(|rest| rest.is_empty() || rest.starts_with(' ')) && !command.contains(" --server")
    };
    let whole = |(k, part): (usize, &str)| {
        let command = part.strip_prefix("hbot ").filter(|_| k % 2 == 1);
        match (command, typed, listen) {
            (Some("server"), _, Some(server)) => format!("{part} --listen {server}"),
            (Some(command), Some(server), _) if asks(command) => format!("{part} --server {server}"),
            _ => part.to_owned(),
        }
    };
    text.split('`').enumerate().map(whole).collect::<Vec<_>>().join("`")
}

/// Returns a text for people whose commands of hbot begin with `program`.
fn pasteable(text: &str, program: &str) -> String {
    if program == "hbot" {
        return text.to_owned();
    }
    // cargo takes an option for its own that is not after a command or after two dashes.
    let dashes = if program.starts_with("cargo") { " --" } else { "" };
    let text = text.replace(" (`cargo run server` in the project's folder)", "");
    let text = text
        .replace("`hbot --", &format!("`{program}{dashes} --"))
        .replace("`hbot ", &format!("`{program} "));
    let line = |line: &str| {
        line.strip_prefix("  hbot ").map_or_else(|| line.to_owned(), |rest| format!("  {program} {rest}"))
    };
    text.split('\n').map(line).collect::<Vec<_>>().join("\n")
}

/// Returns the start message of a server, like [`fitted`] but without broken lines.
pub(crate) fn banner(text: &str) -> String {
    pasteable(text, &program())
}

/// Prints the error that ended a command. Its text can contain text from a server.
pub(crate) fn error(error: &impl Display) {
    note!("{}error:{} {}", style::BAD, style::OFF, foreign_lines(&format!("{error:#}")));
}

/// A wrong command line of which clap cannot know that it is wrong. Its exit code is that of the
/// others: 2.
#[derive(Debug)]
pub(crate) struct WrongLine(pub(crate) String);

impl Display for WrongLine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for WrongLine {}

/// Returns the exit code of the error that ended a command.
pub(crate) fn code(error: &anyhow::Error) -> ExitCode {
    if error.is::<WrongLine>() { ExitCode::from(2) } else { ExitCode::FAILURE }
}

/// Makes text from a server safe to print on one line of a terminal, because anybody could have
/// written it. The result cannot move the cursor, end the line, change the writing direction or
/// hide anything.
pub(crate) fn foreign(text: &str) -> Plain<'_> {
    Plain(text)
}

/// Makes text of several lines from a server safe to print. All lines except the first are
/// indented, so that none looks like a line of this program.
fn foreign_lines(text: &str) -> String {
    text.lines().map(|line| foreign(line).to_string()).collect::<Vec<_>>().join("\n  ")
}

/// Fails if `path` is a folder or a pipe, or its folder is missing. `wanted` says which file to
/// name instead.
pub(crate) fn refuse_folder_or_pipe(path: &Path, wanted: &str) -> anyhow::Result<()> {
    refuse_missing_folder(path)?;
    let is_pipe = path.metadata().is_ok_and(|found| found.file_type().is_fifo());
    ensure!(!path.is_dir(), "{}: this is a folder. Name {wanted}", path.display());
    // Opening a pipe would wait for its other end.
    ensure!(!is_pipe, "{}: this is a pipe. Name {wanted}", path.display());
    Ok(())
}

/// Fails if the folder of a new file is missing. Before questions, so that no answer is lost.
pub(crate) fn refuse_missing_folder(file: &Path) -> anyhow::Result<()> {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir());
    match folder {
        None => Ok(()),
        Some(folder) => Err(anyhow!("{}: there is no folder {}", file.display(), folder.display())),
    }
}

/// Creates a folder, unless it exists, and says so.
pub(crate) fn make_folder(folder: &Path) -> Result<()> {
    if !folder.as_os_str().is_empty() && !folder.is_dir() {
        std::fs::create_dir_all(folder)?;
        note!("{}: this folder is new", folder.display());
    }
    Ok(())
}

/// Returns the error of a new file whose name another file has.
pub(crate) fn taken(path: &Path) -> anyhow::Error {
    anyhow!("{}: the file exists already. Name another one, or remove it first", path.display())
}

/// Creates a file that must not exist yet.
pub(crate) fn create_new(path: &Path) -> anyhow::Result<File> {
    refuse_folder_or_pipe(path, "a new file")?;
    File::create_new(path).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => taken(path),
        _ => anyhow::Error::from(error).context(format!("{}: cannot be made", path.display())),
    })
}

/// Prints clap's answer to the command line `arguments`: an error, the help or the version. A
/// command that hbot calls by another name is named.
pub(crate) fn answer(mut answer: clap::Error, arguments: &[OsString]) -> anyhow::Result<ExitCode> {
    if answer.use_stderr() && habits::is_stop(arguments) {
        return orders::estop_first(&answer, arguments);
    }
    habits::keep_the_most_similar(&mut answer);
    habits::usual_usage(&mut answer, arguments, command());
    let printed = match habits::meant(&answer, arguments) {
        Some(meant) => {
            error(&meant);
            Ok(())
        }
        // clap breaks the lines of its help, but not those of its errors.
        None if answer.use_stderr() => {
            note!("{}", answer.render().ansi().to_string().trim_end());
            Ok(())
        }
        None => answer.print(),
    };
    if !answer.use_stderr() {
        written(printed)?;
    }
    // clap uses exit code 2 for a wrong command line.
    Ok(u8::try_from(answer.exit_code()).map_or(ExitCode::FAILURE, ExitCode::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_can_be_pasted_as_the_program_was_called() {
        let text = "`hbot reset`, `hbot --version`\n  hbot rig check x\n  hbot-gui";
        assert_eq!(pasteable(text, "hbot"), text);
        let cargo = "`cargo run reset`, `cargo run -- --version`\n  cargo run rig check x\n  hbot-gui";
        assert_eq!(pasteable(text, "cargo run"), cargo);
        assert_eq!(pasteable("`hbot --help`", "./hbot"), "`./hbot --help`");
        let none = "with `hbot server` (`cargo run server` in the project's folder), or";
        assert_eq!(pasteable(none, "cargo run"), "with `cargo run server`, or");
    }

    #[test]
    fn a_command_names_the_server_that_the_user_has_named() {
        let text = "`hbot reset`, then `hbot enable`, `hbot rig check`, `hbot server`";
        assert_eq!(addressed(text, None, Some("lab:1")), text);
        let named =
            "`hbot reset --server lab:1`, then `hbot enable --server lab:1`, `hbot rig check`, `hbot server`";
        assert_eq!(addressed(text, Some("lab:1"), None), named);
        let listening = "`hbot server --listen 127.0.0.1:1`";
        assert_eq!(addressed("`hbot server`", None, Some("127.0.0.1:1")), listening);
    }

    #[test]
    fn a_server_s_words_stay_on_their_line_and_do_nothing_to_the_terminal() {
        let evil = "x\u{1b}[2J\u{1b}]0;PWN\u{7}\r\u{202e}y\u{9b}";
        let shown = foreign(evil).to_string();
        assert_eq!(shown, "x\\u{1b}[2J\\u{1b}]0;PWN\\u{7}\\r\\u{202e}y\\u{9b}");
        assert_eq!(foreign_lines("a\nerror: \u{1b}[2J"), "a\n  error: \\u{1b}[2J");
    }
}
