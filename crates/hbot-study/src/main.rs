//! The command-line program `hbot-study`. It runs a study on this machine and writes a report,
//! plots and figures into a folder.

use std::io::{ErrorKind, IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anstyle::{AnsiColor, Reset, Style};
use anyhow::Context as _;
use clap::{Args, Parser, Subcommand};
use hbot_study::{Counter, Report, Study, StudyOptions};
use rustix::process::{Signal, set_parent_process_death_signal};
use tokio::signal::unix::{SignalKind, signal};

/// Measures on this machine what accuracy and effects cost and where stability ends, repeats the
/// paper's experiments, and searches for better designs.
///
/// Build it with `--release`. Otherwise the measured times mean nothing.
#[derive(Debug, Parser)]
#[command(name = "hbot-study", version, propagate_version = true, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// The study to run.
#[derive(Debug, Subcommand)]
enum Command {
    /// Error against time for every stage with a choice of methods, and for the whole tick
    Accuracy(StudyArgs),
    /// Cost per tick of each effect and each phenomenon of the simulated rig, alone and in pairs
    Effects(StudyArgs),
    /// What the passivity stage changes for the hand, and which scenes shake with it
    Feel(StudyArgs),
    /// How well `hbot rig identify` finds the geometry of random rigs that are not as drawn
    Identify(StudyArgs),
    /// How stiff a virtual wall can be, compared with theory, and a day of simulated time
    Stability(StudyArgs),
    /// What the lead changes: borders, walls, and readings that come late
    Lead(StudyArgs),
    /// Every analysis and experiment of the paper, compared with the values that it reports
    Paper(StudyArgs),
    /// Search for the dimensions of a better Hbot: a Pareto front, and rig files of the best
    /// designs
    Design(StudyArgs),
    /// Runs the ticks whose instructions are counted. The studies `accuracy` and `effects` start
    /// this command under valgrind
    #[command(hide = true)]
    CountWorker {
        /// The jobs, as JSON
        jobs: String,
    },
}

/// Options of every study.
#[derive(Debug, Args)]
struct StudyArgs {
    /// Folder for report.md, report.html, summary.json and plots [default: target/study/NAME]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Use fewer samples: about 30 s (paper, design: a minute) instead of up to 5 minutes
    #[arg(long)]
    quick: bool,
}

/// Name of the hidden command that runs a few ticks. Studies start it under valgrind to count
/// instructions.
const WORKER: &str = "count-worker";
/// Exit code after Ctrl-C, by the convention of shells: 128 plus the number of SIGINT.
const INTERRUPTED: i32 = 130;

const GOOD: Style = AnsiColor::Green.on_default().bold();
const BOLD: Style = Style::new().bold();
const BAD: Style = AnsiColor::Red.on_default().bold();

fn main() -> ExitCode {
    run(Cli::parse().command).unwrap_or_else(|error| {
        note(&format!("{BAD}error:{Reset} {error:#}"));
        ExitCode::FAILURE
    })
}

fn run(command: Command) -> anyhow::Result<ExitCode> {
    let (study, args) = match command {
        Command::Accuracy(args) => (Study::Accuracy, args),
        Command::Effects(args) => (Study::Effects, args),
        Command::Feel(args) => (Study::Feel, args),
        Command::Identify(args) => (Study::Identify, args),
        Command::Stability(args) => (Study::Stability, args),
        Command::Lead(args) => (Study::Lead, args),
        Command::Paper(args) => (Study::Paper, args),
        Command::Design(args) => (Study::Design, args),
        Command::CountWorker { jobs } => {
            // A study that is stopped leaves no worker behind.
            set_parent_process_death_signal(Some(Signal::KILL))?;
            hbot_study::count_worker(&jobs).map_err(anyhow::Error::msg)?;
            return Ok(ExitCode::SUCCESS);
        }
    };
    end_on_signal()?;
    let counter = Counter { program: std::env::current_exe()?, arguments: vec![WORKER.to_owned()] };
    let options = StudyOptions { out: args.out, quick: args.quick, counter: Some(counter) };
    let (report, out) = hbot_study::run(study, &options)?;
    say(&told(&report, &out))?;
    Ok(if report.holds() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Returns what the terminal shows of a report in the folder `out`: warnings, conclusions, how many
/// checks hold and which do not, and where the rest is.
fn told(report: &Report, out: &Path) -> String {
    let mut text = String::new();
    for warning in report.warnings() {
        text.push_str(&format!("{BAD}warning:{Reset} {warning}\n\n"));
    }
    text.push_str(&format!("{BOLD}In short{Reset}\n"));
    for sentence in report.conclusions() {
        // The report marks names as code, which a terminal does not show.
        text.push_str(&format!("- {}\n", sentence.replace('`', "")));
    }
    let colour = if report.holds() { GOOD } else { BAD };
    text.push_str(&format!("\n{colour}{}{Reset}\n", report.verdict()));
    for check in report.checks().iter().filter(|check| !check.holds) {
        text.push_str(&format!("{BAD}does not hold{Reset}  {}: {}\n", check.what, check.found));
    }
    let path = |name: &str| out.join(name).display().to_string();
    let (html, plot, figures) = (path("report.html"), path(&report.chief_plot()), path("summary.json"));
    text.push_str(&format!("report   {html}\nplot     {plot}\n"));
    text.push_str(&format!("figures  {figures} ({})\n", report.figures().len()));
    text
}

/// Writes `text` to standard output. It is not an error if the reader has closed the pipe (`|
/// head`).
fn say(text: &str) -> anyhow::Result<()> {
    let mut out = anstream::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(error).context("standard output cannot be written")
        }
        _ => Ok(()),
    }
}

/// Writes a line to standard error. A failure is ignored, as there is nowhere to report it.
fn note(line: &str) {
    let _ = writeln!(anstream::stderr(), "{line}");
}

/// Ends the process when it receives SIGINT or SIGTERM. While files are written, and after that, it
/// is left to end by itself.
fn end_on_signal() -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build()?;
    let (mut stop, mut end) = {
        let _guard = runtime.enter();
        (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?)
    };
    std::thread::Builder::new().name("hbot-signals".to_owned()).spawn(move || {
        runtime.block_on(async {
            tokio::select! { _ = stop.recv() => {}, _ = end.recv() => {} }
        });
        hbot_study::if_unwritten(|| {
            // Over the bar of progress, if there is one.
            let erased = if std::io::stderr().is_terminal() { "\r\x1b[K" } else { "" };
            note(&format!("{erased}stopped; nothing was written"));
            std::process::exit(INTERRUPTED);
        });
    })?;
    Ok(())
}
