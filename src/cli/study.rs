//! `hbot study`: measurements on this machine, as a report, plots and figures in a folder.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};
use hbot_config::scene::Simulate;
use hbot_server::phenomena::phenomena;
use hbot_sim::rig::SimulatedRig;
use hbot_study::{Counter, Interrupt, Options, Study, StudyError};
use tokio::signal::unix::{SignalKind, signal};

use super::out::{note, say};
use super::style;

/// Which study.
#[derive(Debug, Subcommand)]
pub(crate) enum StudyCommand {
    /// Error against time of every stage that has a choice, and of the whole tick
    Accuracy(StudyArgs),
    /// What each effect and each phenomenon of the simulated rig costs a tick, alone and in pairs
    Effects(StudyArgs),
    /// How stiff a virtual wall may be, beside theory, and what holds over a day of simulated time
    Stability(StudyArgs),
    /// Every analysis and experiment of the paper, beside what it reports
    Paper(StudyArgs),
    /// Which dimensions a better Hbot would have: a Pareto front, and rig files of the best
    Design(StudyArgs),
    /// Runs ticks to be counted; `hbot study effects` runs it under valgrind
    #[command(name = "effects-worker", hide = true)]
    EffectsWorker {
        /// The setups, as JSON
        setups: String,
    },
}

/// How to run a study.
#[derive(Debug, Args)]
pub(crate) struct StudyArgs {
    /// Folder for report.md, report.html, summary.json and plots [default: target/study/NAME]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Fewer samples: about 30 s (paper, design: a minute) instead of up to 5 minutes
    #[arg(long)]
    quick: bool,
}

/// The exit code of a program that Ctrl-C ended, as shells have it.
const INTERRUPTED: u8 = 130;

pub(crate) fn run(command: StudyCommand) -> anyhow::Result<ExitCode> {
    let (study, args) = match command {
        StudyCommand::Accuracy(args) => (Study::Accuracy, args),
        StudyCommand::Effects(args) => (Study::Effects, args),
        StudyCommand::Stability(args) => (Study::Stability, args),
        StudyCommand::Paper(args) => (Study::Paper, args),
        StudyCommand::Design(args) => (Study::Design, args),
        StudyCommand::EffectsWorker { setups } => {
            hbot_study::count_worker(&setups, show).map_err(anyhow::Error::msg)?;
            return Ok(ExitCode::SUCCESS);
        }
    };
    let interrupt = Interrupt::default();
    raise_on_signal(&interrupt)?;
    let counter = Counter {
        program: std::env::current_exe()?,
        arguments: ["study", "effects-worker"].map(str::to_owned).to_vec(),
    };
    let options = Options { out: args.out, quick: args.quick, show, counter: Some(counter) };
    let (report, out) = match hbot_study::run(study, &options, &interrupt) {
        Ok(done) => done,
        Err(StudyError::Interrupted) => {
            note!("{}", StudyError::Interrupted);
            return Ok(ExitCode::from(INTERRUPTED));
        }
        Err(error) => return Err(error.into()),
    };
    for check in report.checks() {
        let (colour, verdict) =
            if check.holds { (style::GOOD, "holds") } else { (style::BAD, "does not hold") };
        say!("{colour}{verdict}{}  {}: {}", style::OFF, check.what, check.found)?;
    }
    say!("{} figures in {}", report.figures().len(), out.join("summary.json").display())?;
    say!("read {}", out.join("report.html").display())?;
    Ok(if report.holds() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Has a simulated rig show the phenomena of a scene.
fn show(rig: &mut SimulatedRig, simulate: Option<&Simulate>) {
    rig.set_phenomena(simulate.map(phenomena).unwrap_or_default());
}

/// Has SIGINT and SIGTERM stop the study between two steps, with nothing half written.
fn raise_on_signal(interrupt: &Interrupt) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build()?;
    let (mut stop, mut end) = {
        let _guard = runtime.enter();
        (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?)
    };
    let interrupt = interrupt.clone();
    std::thread::Builder::new().name("hbot-signals".to_owned()).spawn(move || {
        runtime.block_on(async {
            tokio::select! { _ = stop.recv() => {}, _ = end.recv() => {} }
        });
        interrupt.raise();
    })?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_config::{RigConfig, SceneFile, scene};
    use hbot_sim::phenomena::Phenomena;
    use hbot_sim::rig::RigConfig as SimulatedConfig;
    use serde_json::json;

    /// What a study is to measure is there while a scene names it, and gone with the next that does not.
    #[test]
    fn every_phenomenon_of_a_scene_is_shown_and_taken_away() {
        let config = SimulatedConfig::new(&RigConfig::prototype().rig);
        let mut rig = SimulatedRig::new(&config).expect("the prototype");
        let mut seen = Vec::new();
        for listed in scene::phenomena() {
            let file = SceneFile::from_json(json!({"simulate": { listed.name: {} }})).expect("a legal scene");
            show(&mut rig, file.simulate());
            let shown = *rig.phenomena();
            assert_ne!(shown, Phenomena::default(), "{}", listed.name);
            assert!(!seen.contains(&shown), "{}", listed.name);
            seen.push(shown);
            show(&mut rig, None);
            assert_eq!(*rig.phenomena(), Phenomena::default(), "{}", listed.name);
        }
        assert_eq!(seen.len(), 11);
    }
}
