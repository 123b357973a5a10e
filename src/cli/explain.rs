//! `hbot explain`: says in a few lines what happened before a fault in a recording.

mod findings;
mod picture;

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context as _, bail, ensure};
use clap::Args;
use hbot_api::{Event, FaultEvent, LimitsInfo};
use hbot_config::advice::Abilities;
use hbot_config::{Override, RigConfig, SceneFile};
use hbot_core::design::rig::Limits;
use hbot_identify::recording::rate;
use hbot_record::Reader;
use hbot_record::flight::Name;
use hbot_record::messages::hbot::State;
use hbot_record::reader::Item;
use hbot_record::ticks::Ticks;
use hbot_record::told::{Told, told};

use super::numbers::whole;
use super::out::{foreign, note, tell};
use super::record::open_recording;
use super::recover::missing_parts;
use super::scene::plot::{svg, write};
use super::style;

/// What the exit codes mean, for the help.
const EXIT_CODES: &str = "\
Exit codes:
  0  the fault or stop is explained, or nothing went wrong
  1  a part of the recording is missing or unreadable, or nothing can be explained
  2  the command line is wrong";

/// How long before the fault is looked at, s.
const BEFORE_S: f64 = 2.0;

/// Options of `hbot explain`.
#[derive(Debug, Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct ExplainArgs {
    /// Recording or flight log (MCAP) [default: the newest flight log of this user that begins
    /// before the rig stops]
    file: Option<PathBuf>,
    /// Which fault or emergency stop of the recording to explain, from 1 [default: the last]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole(1..=u32::MAX))]
    number: Option<u32>,
    /// Draw the time before the fault into this file; its name ends in .svg
    #[arg(long, value_name = "FILE.svg", value_parser = svg)]
    plot: Option<PathBuf>,
    /// Rig file (TOML), if the recording does not hold it [default: the recorded one, or the
    /// prototype]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
}

/// The states before a fault, and what else the recording tells of that time.
struct History {
    /// The states from [`BEFORE_S`] before the fault on. The last is the first of the fault.
    states: Vec<State>,
    /// The event of the fault, if the recording has it.
    event: Option<FaultEvent>,
    /// The scene that was rendered, with the time at which it was loaded or changed last, s. `None`
    /// as the time: before the recording begins.
    scene: Option<(SceneFile, Option<f64>)>,
    /// The newest client that took the lease, if anybody holds it.
    holder: Option<String>,
    /// Metadata of the recording.
    about: BTreeMap<String, String>,
    /// Number of this fault or stop, from 1, and of all faults and stops in the recording.
    number: u32,
    faults: u32,
}

/// What a recording tells.
enum Read {
    /// The time before the wanted fault or stop.
    Stopped(Box<History>),
    /// A run without a fault or stop.
    Healthy(Whole),
}

/// A whole run: its length, and the largest of what has a limit.
#[derive(Default)]
struct Whole {
    ticks: Ticks,
    /// Speed of the sphere, rad/s.
    speed: f64,
    /// Torque on it, N m.
    torque: f64,
    /// Part of what friction holds at a contact.
    traction: f64,
    /// Lateness of a tick, us.
    late_us: f64,
    about: BTreeMap<String, String>,
    /// Why parts cannot be read, and whether the end is missing.
    damaged: Vec<String>,
    cut: bool,
}

impl Whole {
    fn add(&mut self, state: &State) {
        self.ticks.state(state);
        self.speed = self.speed.max(findings::length(state.omega.as_ref()));
        self.torque = self.torque.max(findings::length(state.torque.as_ref()));
        self.traction = self.traction.max(state.traction);
        self.late_us = self.late_us.max(state.timing.as_ref().map_or(0.0, |timing| timing.lateness_us));
    }

    fn damage(&mut self, why: String) {
        self.ticks.damaged();
        self.damaged.push(why);
    }

    /// Says which parts are missing.
    fn missing(&self) -> Vec<String> {
        let parts = missing_parts(&self.ticks, self.cut);
        let unknown = |part| format!("{part}: what happened in them is not known");
        match self.damaged.first() {
            Some(why) if parts.is_empty() => vec![format!("damaged: {why}")],
            _ => parts.into_iter().map(unknown).collect(),
        }
    }
}

pub(crate) fn run(args: &ExplainArgs) -> anyhow::Result<ExitCode> {
    let (path, gathered) = read(args)?;
    let missing = gathered.whole.missing();
    missing.iter().try_for_each(|part| tell!("{}{part}{}", style::BAD, style::OFF))?;
    let code = if missing.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE };
    let history = match gathered.history(&path, args.number)? {
        Read::Stopped(history) => history,
        Read::Healthy(whole) => return healthy(args, &whole, !missing.is_empty()).map(|()| code),
    };
    let rig = rig(args, &history.about)?;
    let Some(last) = history.states.last() else { bail!("the recording has no state") };
    if history.faults > 1 {
        let (number, all) = (history.number, history.faults);
        note!("fault or stop {number} of {all} in the recording; --number N explains another one");
    }
    let name = if last.fault.is_empty() { last.mode.as_str() } else { last.fault.as_str() };
    let (bad, bold, off) = (style::BAD, style::NAME, style::OFF);
    tell!(
        "{bad}{}{off} at {:.3} s of the run (tick {}), {bold}{}{off}",
        foreign(name),
        last.t,
        last.tick,
        foreign(&rig.name)
    )?;
    if let Some(event) = &history.event {
        tell!("  cause      {}", foreign(&event.message))?;
    }
    let lines = findings::of(&history.states, &rig);
    for findings::Finding { label, text } in &lines {
        tell!("  {label:<10} {text}")?;
    }
    if let Some((scene, since)) = &history.scene {
        let since = since
            .map_or("before the recording".to_owned(), |since| format!("{:.1} s before", last.t - since));
        tell!("  {:<10} {}, since {since}", "scene", foreign(scene.name()))?;
        // Of the rig of a client's recording, only the limits are known.
        let most = if args.rig.is_none() && history.about.contains_key("rig") { 0 } else { 2 };
        for warning in Abilities::of(&rig).warnings(scene).iter().take(most) {
            tell!("  {:<10} {}", "", foreign(&warning.to_string()))?;
        }
    }
    if let Some(holder) = &history.holder {
        tell!("  {:<10} {}", "lease", foreign(holder))?;
    }
    match &args.plot {
        Some(out) => {
            write(out, &picture::draw(&history.states, &rig, name))?;
            tell!("  {:<10} {}", "plot", out.display())?;
        }
        None => {
            let span = history.states.first().map_or(0.0, |first| last.t - first.t);
            tell!("  {:<10} --plot FILE.svg draws these {span:.1} s", "plot")?;
        }
    }
    Ok(code)
}

/// Says that nothing went wrong, and how near the run came to its limits.
fn healthy(args: &ExplainArgs, whole: &Whole, flawed: bool) -> anyhow::Result<()> {
    let rig = rig(args, &whole.about)?;
    let (good, bold, off) = (style::GOOD, style::NAME, style::OFF);
    let what = if flawed { "nothing went wrong in what can be read" } else { "nothing went wrong" };
    tell!(
        "{good}{what}{off}: no fault and no emergency stop in {:.3} s ({} states), {bold}{}{off}",
        whole.ticks.range.map_or(0.0, |(first, last)| last - first),
        whole.ticks.states,
        foreign(&rig.name)
    )?;
    let limits = &rig.rig.limits;
    tell!("  {:<10} up to {:.2} rad/s (limit {} rad/s)", "speed", whole.speed, limits.speed)?;
    tell!("  {:<10} up to {:.3} N m (limit {} N m)", "torque", whole.torque, limits.torque)?;
    tell!("  {:<10} up to {:.0} % of what friction holds", "grip", 100.0 * whole.traction)?;
    tell!("  {:<10} the latest tick began {:.1} ms late", "loop", 1.0e-3 * whole.late_us)?;
    if args.plot.is_some() {
        note!("--plot draws the time before a fault, and there is none");
    }
    Ok(())
}

/// Returns the rig of a recording.
fn rig(args: &ExplainArgs, about: &BTreeMap<String, String>) -> anyhow::Result<RigConfig> {
    let rate = rate(about);
    let rig = match (&args.rig, about.get("rig_file"), about.get("rig")) {
        (None, Some(text), _) => RigConfig::from_toml_with(text, "the recorded rig file", rate.as_slice())?,
        (None, None, Some(told)) => return of_client(told, rate.as_slice()),
        (path, ..) => super::rig_file::load(path.as_deref(), rate.as_slice())?,
    };
    let ours = rig.rig.device.joints();
    let joints = about.get("joints").map_or(ours, |names| names.split(' ').count());
    ensure!(
        joints == ours,
        "the recording is of another rig: it has {joints} joints, and {} {ours}; name its rig file by --rig",
        args.rig.as_deref().map_or("the prototype".into(), Path::to_string_lossy)
    );
    Ok(rig)
}

/// Returns the rig of a recording of a client, which has its name and limits. The rest is that of
/// the prototype.
fn of_client(told: &str, rate: &[Override]) -> anyhow::Result<RigConfig> {
    let unreadable = "the recording's entry `rig` cannot be read; name the rig file by --rig";
    let mut told: serde_json::Value = serde_json::from_str(told).context(unreadable)?;
    let info: LimitsInfo = serde_json::from_value(told["limits"].take()).context(unreadable)?;
    let LimitsInfo { torque, speed, slip, .. } = info;
    let mut rig = super::rig_file::load(None, rate)?;
    rig.rig = rig.rig.with(|parts| parts.limits = Limits { torque, speed, slip, ..parts.limits })?;
    rig.name = told["rig"]["name"].as_str().context(unreadable)?.to_owned();
    Ok(rig)
}

/// Time after a stop in which its flight log begins to be written.
const BEGUN: Duration = Duration::from_millis(300);
/// Longest time in which the second file of a flight log is written after the first.
const WRITTEN: Duration = Duration::from_secs(3);

/// Reads the wanted recording. Where nobody names one, a flight log that begins after the rig has
/// stopped gives way to the one before it.
fn read(args: &ExplainArgs) -> anyhow::Result<(PathBuf, Gathered)> {
    let file = match &args.file {
        Some(file) => file.clone(),
        None => newest().context("there is no flight log of this user: name a recording or a flight log")?,
    };
    let (path, gathered) = patiently(&file, args.number)?;
    let earlier = gathered.is_late().then(|| earlier(&file)).flatten();
    let (file, read) = match earlier {
        Some(log) if args.file.is_none() => {
            let read = patiently(&log, args.number)?;
            (log, read)
        }
        _ if gathered.is_late() => {
            let before = earlier.map(|log| format!("; `hbot explain {}` shows it", log.display()));
            bail!(
                "{}: the rig is stopped from the first state on, so what happened before is not in this recording{}",
                path.display(),
                before.unwrap_or_default()
            )
        }
        _ => (file, (path, gathered)),
    };
    if args.file.is_none() {
        note!("{}", file.display());
    }
    Ok(read)
}

/// Returns the newest flight log of this user whose recording is there or still being written.
fn newest() -> Option<PathBuf> {
    std::thread::sleep(BEGUN);
    let whole = |log: &PathBuf| log.with_extension("mcap").exists() || is_young(log);
    super::server::flight_logs().into_iter().rfind(whole)
}

/// Returns the newest flight log of the same server before `log` that shows how the rig stopped.
fn earlier(log: &Path) -> Option<PathBuf> {
    let log = log.with_extension("csv");
    let name = |path: &Path| Name::parse(path.file_name()?.to_str()?);
    let this = name(&log)?;
    let folder = log.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let names = std::fs::read_dir(folder).ok()?.filter_map(|entry| name(&entry.ok()?.path()));
    let mut before: Vec<Name> =
        names.filter(|name| !name.part && name.process == this.process && *name < this).collect();
    before.sort();
    let logs = before.into_iter().rev().map(|name| log.with_file_name(name.to_string()));
    logs.into_iter()
        .find(|log| gather(&log.with_extension("mcap"), None).is_ok_and(|read| read.found.is_some()))
}

/// Returns whether `log` is a flight log that ended a moment ago, so that its recording may still
/// be written.
fn is_young(log: &Path) -> bool {
    let named = log.with_extension("csv").file_name().and_then(|name| Name::parse(name.to_str()?)).is_some();
    let changed = std::fs::metadata(log).and_then(|about| about.modified());
    named && changed.is_ok_and(|at| at.elapsed().is_ok_and(|age| age < WRITTEN))
}

/// Reads a recording. Waits until a flight log is written.
fn patiently(file: &Path, number: Option<u32>) -> anyhow::Result<(PathBuf, Gathered)> {
    loop {
        let path = hbot_record::recording_of(file);
        let read = gather(&path, number);
        if is_young(file) && read.as_ref().map_or(true, |gathered| gathered.whole.cut) {
            std::thread::sleep(Duration::from_millis(100));
            continue;
        }
        return Ok((path, read?));
    }
}

fn gather(path: &Path, number: Option<u32>) -> anyhow::Result<Gathered> {
    if path.extension().is_some_and(|ending| ending == "csv") && path.exists() {
        let recording = path.with_extension("mcap");
        bail!("a flight log is two files: beside {} there is no {}", path.display(), recording.display());
    }
    let name = || path.display().to_string();
    let mut reader = Reader::new(open_recording(path)?).with_context(name)?;
    let mut gathered = Gathered::default();
    loop {
        match reader.next().with_context(name)? {
            None => return Ok(gathered),
            Some(Item::About(about)) => gathered.about = about,
            Some(Item::Message { topic, data, .. }) => {
                if let Some(told) = told(&topic, &data) {
                    gathered.take(told, number);
                }
            }
            // What can be read counts.
            Some(Item::Damaged(why)) => gathered.whole.damage(why),
            Some(Item::Cut) => gathered.whole.cut = true,
        }
    }
}

/// What has been read of a recording until now.
#[derive(Default)]
struct Gathered {
    about: BTreeMap<String, String>,
    recent: VecDeque<State>,
    whole: Whole,
    /// Whether a state is one of a fault or an emergency stop.
    stopped: bool,
    scene: Option<(SceneFile, Option<f64>)>,
    holder: Option<String>,
    faults: u32,
    /// The newest event of a fault. It can stand before or after the state of its tick.
    event: Option<FaultEvent>,
    found: Option<History>,
}

impl Gathered {
    fn take(&mut self, told: Told, wanted: Option<u32>) {
        match told {
            Told::State(state) => self.state(*state, wanted),
            Told::Scene(scene) => {
                let at = self.recent.back().map(|state| state.t);
                let file =
                    serde_json::from_str(&scene.json).ok().and_then(|json| SceneFile::from_json(json).ok());
                self.scene = file.map(|file| (file, at));
            }
            Told::Event(event) => self.event(*event),
        }
    }

    fn state(&mut self, state: State, wanted: Option<u32>) {
        let stopped = |state: &State| ["fault", "estop"].contains(&state.mode.as_str());
        self.whole.add(&state);
        self.stopped |= stopped(&state);
        let begins = stopped(&state) && self.recent.back().is_some_and(|before| !stopped(before));
        self.recent.push_back(state);
        let newest = self.recent.back().map_or(0.0, |state| state.t);
        while self.recent.front().is_some_and(|first| first.t < newest - BEFORE_S) {
            self.recent.pop_front();
        }
        if begins {
            self.faults += 1;
            if wanted.is_none_or(|wanted| self.faults == wanted) {
                self.found = Some(History {
                    states: self.recent.iter().cloned().collect(),
                    event: None,
                    scene: self.scene.clone(),
                    holder: self.holder.clone(),
                    about: self.about.clone(),
                    number: self.faults,
                    faults: 0,
                });
                self.attach();
            }
        }
    }

    fn event(&mut self, event: Event) {
        match event {
            Event::Lease(lease) => self.holder = lease.holder,
            Event::Fault(fault) => {
                self.event = Some(fault);
                self.attach();
            }
            _ => {}
        }
    }

    /// Adds the newest event of a fault to the fault that was found, if it is that one's.
    fn attach(&mut self) {
        let Some(found) = &mut self.found else { return };
        let tick = found.states.last().map(|last| last.tick);
        if found.event.is_none() && self.event.as_ref().map(|event| event.tick) == tick {
            found.event.clone_from(&self.event);
        }
    }

    /// Returns whether the rig is stopped from the first state on.
    fn is_late(&self) -> bool {
        self.stopped && self.faults == 0
    }

    fn history(self, path: &Path, wanted: Option<u32>) -> anyhow::Result<Read> {
        match self.found {
            Some(found) => Ok(Read::Stopped(Box::new(History { faults: self.faults, ..found }))),
            None if self.whole.ticks.states == 0 => bail!("{}: the recording has no state", path.display()),
            None => match wanted {
                Some(wanted) if self.faults > 0 => {
                    bail!("{}: fault {wanted} is not in it; legal: 1 to {}", path.display(), self.faults)
                }
                Some(wanted) if wanted > 1 => {
                    bail!("{}: fault {wanted} is not in it; it has none", path.display())
                }
                _ => Ok(Read::Healthy(Whole { about: self.about, ..self.whole })),
            },
        }
    }
}
