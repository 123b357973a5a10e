//! `hbot record`: records a running server from any machine.

use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser as _};
use hbot_api::{ClientError, Event};
use hbot_host::run_loop::signals;
use hbot_record::ClientRecording;
use hbot_server::recording::is_folder;

use super::numbers::{seconds, whole};
use super::out::{create_new, make_folder, note, refuse_folder_or_pipe, say};
use super::progress::Progress;
use super::{ServerAddress, orders};

/// Longest time for which states wait before they are in the file.
const FLUSH_EVERY: Duration = Duration::from_millis(500);
/// Longest time until a signal is noticed if the server sends nothing.
const LISTEN: Duration = Duration::from_millis(100);

/// What the exit codes mean, for the help.
const EXIT_CODES: &str = "\
Exit codes:
  0  everything was recorded until Ctrl-C, the end of --duration, or, without
     --duration, the end of the server
  1  states were lost, the connection broke, or the server ended before
     --duration
  2  the command line is wrong";

/// Options of `hbot record`.
#[derive(Debug, Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct RecordArgs {
    /// File to write (MCAP), which must not exist yet; its name ends in .mcap or has no ending
    #[arg(value_parser = PathBufValueParser::new().try_map(new_recording))]
    file: PathBuf,
    #[command(flatten)]
    address: ServerAddress,
    /// Record every N-th tick, 1 to 1000000
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = whole(1..=1_000_000_u64))]
    every: u64,
    /// Stop after this time, above 0 and at most 1e9 s, by the clock of this computer
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    duration: Option<f64>,
}

/// Opens a recording to read it.
pub(crate) fn open_recording(path: &Path) -> anyhow::Result<BufReader<File>> {
    refuse_folder_or_pipe(path, "the file of a recording (MCAP)")?;
    Ok(BufReader::new(File::open(path).with_context(|| path.display().to_string())?))
}

/// Parses the name of a new recording. An ending of another format is refused, because the file
/// would still be MCAP.
pub(crate) fn new_recording(path: PathBuf) -> Result<PathBuf, String> {
    if path.as_os_str() == "-" {
        Err("a recording cannot go to standard output: name a file".to_owned())
    } else if path.extension().is_none_or(|ending| ending == "mcap") {
        Ok(path)
    } else {
        Err("a recording is MCAP: a name that ends in .mcap. The Python client makes a CSV file of it: docs/recordings.md"
            .to_owned())
    }
}

/// Parses where `hbot server` records: into a new file, or into a folder. A folder that does not
/// exist yet has a name without an ending, or `/` after its name.
pub(crate) fn file_or_folder(path: PathBuf) -> Result<PathBuf, String> {
    if is_folder(&path) {
        return Ok(path);
    }
    new_recording(path)
        .map_err(|why| format!("{why}. A new folder has a name without an ending, or `/` after it"))
}

/// Longest time for what has arrived when a recording ends, and for the server's last answer.
const LONGEST_END: Duration = Duration::from_secs(1);

pub(crate) fn run(args: &RecordArgs) -> anyhow::Result<ExitCode> {
    let stop = signals::stop_flag()?;
    let mut client = orders::connect(&args.address, "hbot record")?;
    let info = client.info()?;
    let name = || args.file.display().to_string();
    let into = BufWriter::new(create(&args.file)?);
    let mut recording = ClientRecording::new(into, &info, &client.hello().server).with_context(name)?;
    let cut = || format!("{0}: `hbot recover {0} NEW.mcap` saves what it holds. It cannot go on", name());
    client.subscribe(args.every)?;
    let mut progress = Progress::new();

    // The time of the run is not that of the clock: on a busy machine the simulated rig waits.
    let begun = Instant::now();
    let duration = args.duration.map_or(Duration::MAX, Duration::from_secs_f64);
    let mut span = Span::default();
    let mut flushed = Instant::now();
    // What ended the recording before its time: the server's word that it stops, or an error.
    let mut ended = None;
    while !stop.is_set() {
        let left = duration.saturating_sub(begun.elapsed());
        if left.is_zero() {
            break;
        }
        match client.next_event(left.min(LISTEN)) {
            Ok(Some(event)) => {
                span.extend(&event);
                recording.take(&event).with_context(cut)?;
                if matches!(event, Event::Stopping(_)) {
                    ended = Some(None);
                    break;
                }
            }
            Ok(None) => {}
            Err(error) => {
                ended = Some(Some(error));
                break;
            }
        }
        if flushed.elapsed() >= FLUSH_EVERY {
            recording.flush().with_context(cut)?;
            flushed = Instant::now();
        }
        let (states, lost) = (recording.states(), recording.dropped() + client.events_lost());
        progress.show(|since| format!("{since:.0} s: {}", counts(states, lost)));
    }
    progress.clear();
    // What has arrived is taken, the subscription ends, and what came until then is taken, except
    // states of a later time than now. A busy machine gets new ones as fast as it takes them.
    let ending = Instant::now();
    span.duration = Some((ending - begun).as_secs_f64());
    while ending.elapsed() < LONGEST_END
        && let Ok(Some(event)) = client.next_event(Duration::ZERO)
        && span.extend(&event)
    {
        recording.take(&event).with_context(cut)?;
    }
    client.set_timeout(LONGEST_END);
    client.unsubscribe().ok();
    while let Ok(Some(event)) = client.next_event(Duration::ZERO)
        && span.extend(&event)
    {
        recording.take(&event).with_context(cut)?;
    }
    let (states, lost) = (recording.states(), recording.dropped() + client.events_lost());
    recording.finish().with_context(cut)?;
    let size = std::fs::metadata(&args.file).map_or(0, |file| file.len());
    let megabytes = size as f64 / 1.0e6;
    say!("{}{}: {}, {megabytes:.1} MB", counts(states, lost), span.in_words(), args.file.display())?;
    if lost > 0 {
        note!("{ADVICE}");
    }
    let after = format!("after {:.1} s", (ending - begun).as_secs_f64());
    match (ended, args.duration) {
        (None, _) => {}
        (Some(None), None) => note!("the server stopped {after}"),
        (Some(None), Some(wanted)) => {
            bail!("the recording is shorter than wanted: the server stopped {after} of {wanted} s")
        }
        (Some(Some(error)), wanted) => {
            let of = wanted.map_or_else(String::new, |wanted| format!(" of {wanted} s"));
            let why = match error {
                ClientError::Closed => String::new(),
                error => format!(" ({error})"),
            };
            bail!("the recording is shorter than wanted: the connection broke {after}{of}{why}")
        }
    }
    Ok(if lost == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The part of the run that is recorded.
#[derive(Default)]
struct Span {
    /// Its longest time, s, once that is known.
    duration: Option<f64>,
    /// Times of the run of its first and last state, s.
    taken: Option<[f64; 2]>,
}

impl Span {
    /// Extends the part by an event's state. Returns false if that is after the end.
    fn extend(&mut self, event: &Event) -> bool {
        let Event::State(state) = event else { return true };
        let first = self.taken.map_or(state.t, |[first, _]| first);
        if self.duration.is_some_and(|duration| state.t >= first + duration) {
            return false;
        }
        self.taken = Some([first, state.t]);
        true
    }

    fn in_words(&self) -> String {
        self.taken.map_or_else(String::new, |[first, last]| format!(", {first:.3} to {last:.3} s of the run"))
    }
}

/// Creates the file, which must not exist yet, and its folder if that is missing, as `hbot server
/// --record` does.
fn create(file: &Path) -> anyhow::Result<File> {
    if let Some(folder) = file.parent() {
        make_folder(folder).with_context(|| format!("{}: cannot be made", folder.display()))?;
    }
    create_new(file)
}

/// Why states are lost, and what to do about it.
const ADVICE: &str = "\
The server keeps about 128 states for a client, 0.13 s at 1 kHz, and drops the next ones: this computer or the network \
was busy for longer. Record fewer states by `--every N`, or \
record on the rig's computer by `hbot server --record FILE`, which does not send them over the network.";

/// Says how many states are recorded, and how many are lost.
fn counts(states: u64, lost: u64) -> String {
    if lost == 0 {
        return format!("{states} states recorded, 0 lost");
    }
    let percent = 100.0 * lost as f64 / (states + lost) as f64;
    format!("{states} states recorded, {lost} lost ({percent:.2} %)")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_folder_is_made_and_a_file_is_not_overwritten() {
        let state = tempfile::tempdir().expect("a folder");
        let path = state.path().join("a/b/run.mcap");
        create(&path).expect("it is made");
        let again = create(&path).expect_err("it is there").to_string();
        assert!(again.contains("exists already"), "{again}");
        let below = create(&path.join("run.mcap")).expect_err("a file is in the way");
        assert!(format!("{below:#}").contains("run.mcap: cannot be made: "), "{below:#}");
        let folder = create(state.path()).expect_err("a folder is there").to_string();
        assert!(folder.ends_with("this is a folder. Name a new file"), "{folder}");
        let slash = create(&state.path().join("x.mcap/")).expect_err("the name of a folder");
        assert!(format!("{slash:#}").contains("x.mcap/: cannot be made: "), "{slash:#}");
        assert!(!state.path().join("x.mcap").exists());
    }

    #[test]
    fn a_recording_has_no_ending_of_another_format() {
        for name in ["live.mcap", "live", "a.b/live", "../live", ".live"] {
            assert_eq!(new_recording(name.into()), Ok(name.into()));
        }
        for name in ["live.csv", "live.MCAP", "live.mcap.gz", "live."] {
            let why = new_recording(name.into()).expect_err(name);
            assert!(why.contains("ends in .mcap") && why.contains("docs/recordings.md"), "{why}");
        }
    }

    #[test]
    fn a_folder_for_recordings_has_no_ending_or_a_slash_or_is_there() {
        let folder = tempfile::Builder::new().suffix(".d").tempdir().expect("a folder");
        let there = folder.path().to_path_buf();
        for path in [
            "run.mcap".into(),
            "runs".into(),
            "runs.d/".into(),
            "runs.mcap/".into(),
            there.clone(),
            there.join("runs"),
        ] {
            assert_eq!(file_or_folder(path.clone()), Ok(path));
        }
        for path in ["runs.d".into(), there.join("run.csv")] {
            let why = file_or_folder(path).expect_err("another ending");
            assert!(why.contains("ends in .mcap") && why.contains("`/` after it"), "{why}");
        }
    }

    #[test]
    fn states_that_come_after_the_end_are_not_taken() {
        let at = |t| Event::State(hbot_api::StateEvent { t, ..Default::default() });
        let mut span = Span { duration: Some(1.0), taken: None };
        assert_eq!(span.in_words(), "");
        assert_eq!([3.0, 3.5, 3.999, 4.0].map(|t| span.extend(&at(t))), [true, true, true, false]);
        assert_eq!(span.in_words(), ", 3.000 to 3.999 s of the run");
    }

    #[test]
    fn losses_are_told_as_a_number_and_a_share() {
        assert_eq!(counts(7947, 0), "7947 states recorded, 0 lost");
        assert_eq!(counts(990, 10), "990 states recorded, 10 lost (1.00 %)");
        assert_eq!(counts(0, 0), "0 states recorded, 0 lost");
    }
}
