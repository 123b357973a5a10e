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

/// Says why a command failed.
pub(crate) fn error(error: &impl Display) {
    note!("{}error:{} {error:#}", style::BAD, style::OFF);
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
