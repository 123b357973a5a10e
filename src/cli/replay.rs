//! `hbot replay`: runs a recording through the control law again and compares every bit.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context as _, bail};
use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser as _};
use hbot_api::StateEvent;
use hbot_config::{RunningScene, SceneFile};
use hbot_record::replay::{Flaw, Replay, ReplayError, Replayed, Report, renumbered};
use hbot_record::{About, Writer, public};

use super::numbers::real;
use super::out::{WrongLine, create_new, note, say, tell};
use super::record::{new_recording, open_recording};
use super::{scene, style};

/// What the exit codes mean, for the help.
const EXIT_CODES: &str = "\
Exit codes:
  0  every bit of the compared part agrees
  1  a tick differs, parts are missing, or nothing could be replayed
  2  the command line is wrong";

/// Options of `hbot replay`.
#[derive(Debug, Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct ReplayArgs {
    /// Recording that was made by `hbot server --record`, or a flight log (MCAP)
    file: PathBuf,
    /// Compare from this time of the run on, 0 to 1e9 s
    #[arg(long, value_name = "SECONDS", value_parser = time_of_run, allow_negative_numbers = true)]
    from: Option<f64>,
    /// Compare up to this time of the run, 0 to 1e9 s
    #[arg(long, value_name = "SECONDS", value_parser = time_of_run, allow_negative_numbers = true)]
    to: Option<f64>,
    /// Render this scene (a file, or the name of a ready-made scene) instead of the recorded one:
    /// what would the same hand have felt? Needs --out
    #[arg(long, value_name = "FILE|NAME", requires = "out")]
    scene: Option<PathBuf>,
    /// New recording (MCAP) with the recorded torque and that of --scene
    #[arg(long, value_name = "FILE", requires = "scene", value_parser = PathBufValueParser::new().try_map(new_recording))]
    out: Option<PathBuf>,
}

/// Parses a time of the run, s.
fn time_of_run(text: &str) -> Result<f64, String> {
    real("s", |s| (0.0..=1.0e9).contains(&s), "0 to 1e9")(text)
}

/// Replays a recording. Returns success only if every bit of it agrees.
pub(crate) fn run(args: &ReplayArgs) -> anyhow::Result<ExitCode> {
    let begun = Instant::now();
    if let (Some(from), Some(to)) = (args.from, args.to)
        && from > to
    {
        bail!(WrongLine(format!("--from {from} is behind --to {to}")));
    }
    let path = hbot_record::recording_of(&args.file);
    let name = || path.display().to_string();
    let other = args.scene.as_deref().map(scene::scene).transpose()?;
    let file = open_recording(&path)?;
    let compiled = other.clone().map(|other| Box::new(renumbered(&RunningScene::new().load(other))));
    let replay = Replay::new(file, compiled).with_context(name)?;
    let period_ns = period_ns(replay.about()).with_context(name)?;
    let tick = |s: f64| (s * 1.0e9 / period_ns as f64).round() as u64;
    let (from, to) = (args.from.map_or(0, tick), args.to.map_or(u64::MAX, tick));

    let report = match (&other, &args.out) {
        (Some(other), Some(out)) => {
            let mut output = Output::create(out, replay.about(), other, period_ns)?;
            let report = replay.run(from, to, |replayed| output.write(replayed));
            let report = report.and_then(|report| {
                output.writer.finish().with_context(|| out.display().to_string())?;
                Ok(report)
            });
            if !report.as_ref().is_ok_and(|report| report.range.is_some()) {
                // An empty file, or one without an end, would look like a recording.
                let _ = std::fs::remove_file(out);
            }
            report?
        }
        _ => replay.run(from, to, |_| Ok::<_, ReplayError>(())).with_context(name)?,
    };
    tell(&report, period_ns, begun, args.out.as_deref().filter(|out| out.exists()))?;
    if report.range.is_none() && report.difference.is_none() {
        let part = if args.from.or(args.to).is_some() { " of the wanted part" } else { "" };
        bail!("nothing could be replayed: no tick{part} is readable");
    }
    Ok(if report.is_exact() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Returns the period of the recorded loop, ns.
fn period_ns(about: &BTreeMap<String, String>) -> anyhow::Result<u64> {
    match about.get("period_ns").and_then(|text| text.parse().ok()) {
        Some(period_ns) if period_ns > 0 => Ok(period_ns),
        _ => bail!("its metadata do not have the period of the loop"),
    }
}

/// The new recording of a replay with another scene.
struct Output<'a> {
    writer: Writer<File>,
    scene: &'a SceneFile,
    begun: bool,
    period_ns: u64,
    recorded: StateEvent,
    computed: StateEvent,
}

impl<'a> Output<'a> {
    fn create(
        path: &Path,
        about: &BTreeMap<String, String>,
        scene: &'a SceneFile,
        period_ns: u64,
    ) -> anyhow::Result<Self> {
        let name = || path.display().to_string();
        let joints = about.get("joints").map(|names| names.split(' ').map(str::to_owned).collect());
        let mut entries = about.clone();
        entries.insert("other_scene".to_owned(), scene.to_json().to_string());
        let about = About { joints: joints.unwrap_or_default(), entries };
        let writer = Writer::new(create_new(path)?, &about).with_context(name)?;
        let (recorded, computed) = Default::default();
        Ok(Self { writer, scene, begun: false, period_ns, recorded, computed })
    }

    fn write(&mut self, replayed: &Replayed<'_>) -> anyhow::Result<()> {
        let (tick, at) = (replayed.inputs.tick, replayed.log_time);
        if !std::mem::replace(&mut self.begun, true) {
            self.writer.scene(tick, self.scene.name(), &self.scene.to_json().to_string(), at)?;
        }
        public::fill(&mut self.recorded, &replayed.recorded.state, tick.saturating_mul(self.period_ns));
        self.recorded.timing.lateness_us = replayed.inputs.lateness_ns as f64 * 1.0e-3;
        self.writer.state(&self.recorded, at)?;
        public::fill(&mut self.computed, &replayed.computed.state, tick.saturating_mul(self.period_ns));
        self.writer.other_torque(&self.computed, at)?;
        Ok(())
    }
}

/// Prints the outcome of a replay.
fn tell(report: &Report, period_ns: u64, begun: Instant, out: Option<&Path>) -> anyhow::Result<()> {
    let at = |tick: u64| tick.saturating_mul(period_ns) as f64 * 1.0e-9;
    for flaw in &report.flaws {
        note!("{}note{} {}", style::WARN, style::OFF, sentence(flaw));
    }
    if let Some((first, last)) = report.range {
        let elapsed = begun.elapsed().as_secs_f64();
        let speed = at(report.ticks) / elapsed;
        let what = match out {
            Some(out) => format!("computed with the other scene, written to {}", out.display()),
            None => "every bit agrees".to_owned(),
        };
        tell!(
            "{} ticks, {first} to {last} ({:.3} to {:.3} s of the run): {what}; {elapsed:.2} s, {speed:.0} times real time",
            report.ticks,
            at(first),
            at(last)
        )?;
    }
    if let Some(difference) = &report.difference {
        let [recorded, computed] = &difference.values;
        let (bad, off, tick) = (style::BAD, style::OFF, difference.tick);
        say!("{bad}differs{off} first at tick {tick} ({:.3} s of the run): {}", at(tick), difference.field)?;
        say!("  recorded {recorded}\n  computed {computed}")?;
    } else if report.range.is_some() && !report.flaws.is_empty() {
        let cut = report.flaws.iter().any(|flaw| matches!(flaw, Flaw::Cut));
        let lacks = if cut { "the rest is missing" } else { "not everything is in it or can be read" };
        tell!("{}the recording is not whole{}: {lacks} (exit code 1)", style::WARN, style::OFF)?;
    }
    Ok(())
}

fn sentence(flaw: &Flaw) -> String {
    match flaw {
        Flaw::Gap(ticks) => format!("gap: the recorder lost {ticks} ticks here"),
        Flaw::Missing(ticks) => format!("gap: {ticks} ticks are missing here"),
        Flaw::Damaged(why) => format!("damaged: {why}"),
        Flaw::Cut => {
            "cut: the file ends before the end of the recording, which was killed, is still written, or was copied too early"
                .to_owned()
        }
        Flaw::Unknown(ticks) => {
            format!("{ticks} ticks are not replayed: the state before them is not in the file")
        }
    }
}
