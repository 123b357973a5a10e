//! `hbot recover`: makes a whole file of a recording that was cut off or damaged.

use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser as _};
use hbot_record::recover::recover;

use super::out::{create_new, refuse_folder_or_pipe, tell};
use super::record::new_recording;
use super::style;

/// What the exit codes mean, for the help.
const EXIT_CODES: &str = "\
Exit codes:
  0  everything that was written until the end or the cut is in the new recording
  1  parts are damaged, or nothing can be recovered
  2  the command line is wrong";

/// Options of `hbot recover`.
#[derive(Debug, Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct RecoverArgs {
    /// Recording (MCAP) without an end, because the program was killed, or with damaged parts
    file: PathBuf,
    /// New recording (MCAP) with everything that can be read, an index and an end
    #[arg(value_parser = PathBufValueParser::new().try_map(new_recording))]
    out: PathBuf,
}

/// Copies what can be read. Returns success if the recording was only cut off, not damaged.
pub(crate) fn run(args: &RecoverArgs) -> anyhow::Result<ExitCode> {
    let name = || args.file.display().to_string();
    refuse_folder_or_pipe(&args.file, "the file of a recording (MCAP)")?;
    let from = BufReader::new(File::open(&args.file).with_context(name)?);
    let into = BufWriter::new(create_new(&args.out)?);
    let found = match recover(from, into) {
        Ok(found) => found,
        Err(error) => {
            // An empty file would look like a recording.
            let _ = std::fs::remove_file(&args.out);
            return Err(error).with_context(name);
        }
    };
    for why in &found.damaged {
        tell!("{}damaged{}: {why}", style::BAD, style::OFF)?;
    }
    if found.messages == 0 {
        let _ = std::fs::remove_file(&args.out);
        let why = match (found.damaged.is_empty(), found.cut) {
            (false, _) => "no message of it can be read",
            (true, true) => "it was cut off before its first part (about a second) was written",
            (true, false) => "it has no message",
        };
        bail!("{}: nothing can be recovered: {why}", name());
    }
    let seconds = found.range.map_or(0.0, |(first, last)| (last - first) as f64 * 1.0e-9);
    let state = if found.cut { "had no end" } else { "has an end" };
    tell!(
        "{} {state}: {} messages of {seconds:.1} s are in {}, which is whole",
        args.file.display(),
        found.messages,
        args.out.display()
    )?;
    Ok(if found.damaged.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
