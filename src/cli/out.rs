//! What commands write, and what becomes of it where it cannot be written.
//!
//! Standard output: a reader who has gone away (`| head`) has read what he wanted. What is left to say is dropped, quietly,
//! and the command goes on to its end, so that its exit code says how that went; `hbot watch`, which does nothing but
//! write, ends with 0. Anything else that hinders, such as a full device, is an error as any other: one line, exit code 1.
//!
//! Standard error is the last place to complain: what cannot be written there is lost.
//!
//! `hbot server` never waits for a reader and never ends for the want of one: it writes through `console.rs`.

use std::fmt::{Arguments, Display};
use std::io::{ErrorKind, Result, Write as _};
use std::process::ExitCode;

use anyhow::Context as _;
use hbot_api::Plain;

use super::style;

/// Writes a line to standard output, as `println!` does, but hands back an error instead of ending in a panic.
macro_rules! say {
    ($($text:tt)*) => { $crate::cli::out::line(format_args!($($text)*)) };
}
pub(crate) use say;

/// Writes a line to standard error.
macro_rules! note {
    ($($text:tt)*) => { $crate::cli::out::aside(format_args!($($text)*)) };
}
pub(crate) use note;

/// Whether anybody reads what is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reader {
    There,
    Gone,
}

/// What writing to standard output came to.
pub(crate) fn written(result: Result<()>) -> anyhow::Result<Reader> {
    match result {
        Ok(()) => Ok(Reader::There),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(Reader::Gone),
        Err(error) => Err(error).context("standard output cannot be written"),
    }
}

/// What `say!` does.
pub(crate) fn line(text: Arguments<'_>) -> anyhow::Result<()> {
    let mut out = anstream::stdout().lock();
    written(writeln!(out, "{text}").and_then(|()| out.flush())).map(|_| ())
}

/// What `note!` does.
pub(crate) fn aside(text: Arguments<'_>) {
    // Nowhere is left to say that it failed.
    let _ = writeln!(anstream::stderr(), "{text}");
}

/// Says why a command failed. Part of it may be a server's words.
pub(crate) fn error(error: &impl Display) {
    note!("{}error:{} {}", style::BAD, style::OFF, foreign_lines(&format!("{error:#}")));
}

/// Text of a server, which may be anybody's, for a line of a terminal: nothing in it moves the cursor, ends the line, turns its
/// direction or hides.
pub(crate) fn foreign(text: &str) -> Plain<'_> {
    Plain(text)
}

/// The same of several lines. All but the first are set in, so that none passes for a line of the program's own.
fn foreign_lines(text: &str) -> String {
    text.lines().map(|line| foreign(line).to_string()).collect::<Vec<_>>().join("\n  ")
}

/// Says what the command line itself has to say: what was wrong with it, the help or the version that was asked for.
pub(crate) fn answer(answer: &clap::Error) -> anyhow::Result<ExitCode> {
    let printed = answer.print();
    if !answer.use_stderr() {
        written(printed)?;
    }
    // 2 for a wrong command line, as clap has it.
    Ok(u8::try_from(answer.exit_code()).map_or(ExitCode::FAILURE, ExitCode::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_s_words_stay_on_their_line_and_do_nothing_to_the_terminal() {
        let evil = "x\u{1b}[2J\u{1b}]0;PWN\u{7}\r\u{202e}y\u{9b}";
        let shown = foreign(evil).to_string();
        assert_eq!(shown, "x\\u{1b}[2J\\u{1b}]0;PWN\\u{7}\\r\\u{202e}y\\u{9b}");
        assert_eq!(foreign_lines("a\nerror: \u{1b}[2J"), "a\n  error: \\u{1b}[2J");
    }
}
