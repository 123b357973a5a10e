//! `hbot recover`: makes a file with an end of a recording that was cut off or damaged.

use std::io::BufWriter;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser as _};
use hbot_record::recover::recover;
use hbot_record::ticks::{Gap, Ticks};

use super::out::{create_new, tell};
use super::record::{new_recording, open_recording};
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
    let from = open_recording(&args.file)?;
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
    let state = match (found.cut, found.ticks.damaged_after) {
        (true, _) => "had no end",
        (false, true) => "is damaged at its end",
        (false, false) => "has an end",
    };
    let (there, missing) = (found.ticks.states, found.ticks.missing());
    let (first, last) = found.ticks.range.unwrap_or_default();
    // How many ticks are missing before the first or after the last one is not known.
    let open = found.cut || found.ticks.damaged_before || found.ticks.damaged_after;
    let all = if open { String::new() } else { format!(" of {}", there + missing) };
    tell!(
        "{} {state}: {there}{all} {}s ({first:.3} to {last:.3} s) are in {}",
        args.file.display(),
        found.ticks.name(),
        args.out.display()
    )?;
    let lost = missing_parts(&found.ticks, found.cut);
    lost.iter().try_for_each(|part| tell!("  {}{part}{}", style::WARN, style::OFF))?;
    Ok(if found.damaged.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Largest number of gaps that are listed.
const MOST_GAPS: usize = 5;

/// Says which ticks of a recording are missing.
pub(super) fn missing_parts(ticks: &Ticks, cut: bool) -> Vec<String> {
    let mut parts: Vec<String> = ticks.gaps.iter().take(MOST_GAPS).map(Gap::to_string).collect();
    if let Some(more) = ticks.gaps.get(MOST_GAPS..).filter(|more| !more.is_empty()) {
        let states: u64 = more.iter().map(|gap| gap.states).sum();
        parts.push(format!("{states} {}s are missing in {} further gaps", ticks.name(), more.len()));
    }
    let Some((first, last)) = ticks.range else { return parts };
    if ticks.damaged_before {
        parts.push(format!("ticks before {first:.3} s may be missing, because a part is damaged"));
    }
    if cut {
        parts.push(format!("all ticks after {last:.3} s are missing, because the recording was cut off"));
    } else if ticks.damaged_after {
        parts.push(format!("ticks after {last:.3} s may be missing, because a part is damaged"));
    }
    parts
}
