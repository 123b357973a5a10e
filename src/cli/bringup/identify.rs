//! `hbot rig identify`: finds the true geometry of a rig in recordings, or, by its motors, torque
//! constants, friction and more.

pub(super) mod motors;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser as _};
use hbot_config::RigConfig;
use hbot_core::rotation::wrap_angle;
use hbot_identify::identify::{Identified, Name, Value};
use hbot_identify::{Recorded, What, identify};

use super::super::numbers::positive;
use super::super::out::{WrongLine, note, tell};
use super::super::progress::Progress;
use super::super::record::open_recording;
use super::super::style;
use super::{COGGING, Which, edit, has_cogging, joint_name};

/// Options of `hbot rig identify`.
#[derive(Debug, Args)]
pub(crate) struct IdentifyArgs {
    #[command(flatten)]
    which: Which,
    /// Recordings (MCAP) by `hbot server --record`: motors off, a hand turns the sphere about all
    /// axes, a minute in all
    #[arg(value_name = "RUN.mcap", required_unless_present = "motors", value_parser = PathBufValueParser::new().try_map(recording))]
    runs: Vec<PathBuf>,
    /// Find the steering zeros alone and believe the rest of the rig file: two seconds of motion
    /// are enough
    #[arg(long)]
    zeros: bool,
    /// Let the motors move the free sphere, and find torque constants, inertias, friction,
    /// imbalance and cogging. No server may hold the rig. The geometry counts as right: find it
    /// first
    #[arg(long, conflicts_with_all = ["runs", "zeros"])]
    motors: bool,
    #[command(flatten)]
    motion: motors::Motion,
    /// Inertia that has been added to the sphere since the rig file was written by `--motors`, the
    /// same about all axes, kg m². It shows the scale of all values, which otherwise is that of a
    /// hollow sphere of sphere.mass
    #[arg(long, value_name = "INERTIA", requires = "motors", value_parser = positive("kg m²"), allow_negative_numbers = true)]
    added: Option<f64>,
    /// Write the rig file with the values found to this file; it can be the rig file itself
    #[arg(long, visible_alias = "write", value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Refuses a rig file where a recording is wanted.
fn recording(path: PathBuf) -> Result<PathBuf, String> {
    if path.extension().is_some_and(|end| end == "toml") {
        return Err(format!("no recording (MCAP); the rig file is named by `--rig {}`", path.display()));
    }
    Ok(path)
}

pub(crate) fn run_identify(args: &IdentifyArgs) -> anyhow::Result<ExitCode> {
    if args.motors {
        return motors::run(args);
    }
    if args.which.port.is_some() {
        bail!(WrongLine("--port needs `--motors`: recordings come from files".to_owned()));
    }
    let rig = args.which.load()?;
    if let Some(file) = &args.out {
        edit::refuse_another(file)?;
    }
    let mut progress = Progress::new();
    let mut recordings = Vec::new();
    for run in &args.runs {
        recordings.push(read(run, &rig, &mut progress)?);
    }
    let what = if args.zeros { What::Zeros } else { What::Geometry };
    let mut fitting = |step, most| progress.show(|_| format!("fitting: step {step} of at most {most}"));
    let found = identify(&rig.rig, &recordings, what, &mut fitting)?;
    progress.clear();
    report(&rig, &recordings, &found)?;
    if what != found.what {
        let (warn, off) = (style::WARN, style::OFF);
        tell!(
            "\n{warn}only the zeros are seen{off}: {:.1} s of motion are too short for the geometry. Turn for at least 10 s, better a \
             minute, about n1, n2 and n3",
            found.moving_s
        )?;
    }
    if let Some(file) = &args.out {
        write(args.which.rig.as_deref(), &rig, &found, file)?;
        tell!("{}: written", file.display())?;
        let moved = |wheel: &usize| found.zeros[*wheel].abs() > MOVED && has_cogging(&rig, 2 * wheel);
        for wheel in (0..rig.wheels.len()).filter(moved) {
            tell!("{}: {COGGING}", joint_name(&rig, 2 * wheel))?;
        }
    } else {
        tell!("\nnothing is written; `--out FILE.toml` writes a rig file with what was found")?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Reads the counts of one recording.
pub(super) fn read(run: &Path, rig: &RigConfig, progress: &mut Progress) -> anyhow::Result<Recorded> {
    let mut reading = |ticks| progress.show(|_| format!("{}: {ticks} ticks read", run.display()));
    let recorded = Recorded::read(open_recording(run)?, rig, &mut reading);
    progress.clear();
    let recorded = recorded.with_context(|| run.display().to_string())?;
    let (warn, off) = (style::WARN, style::OFF);
    if recorded.simulated {
        note!(
            "{warn}note{off}: {}: recorded on the simulated rig, so it says nothing about a real one",
            run.display()
        );
    }
    if recorded.pushed_s > 0.0 {
        let pushed_s = recorded.pushed_s;
        note!("{warn}note{off}: {}: motors push in {pushed_s:.1} s of it, which are left out", run.display());
    }
    Ok(recorded)
}

/// Change of a zero by which the phases of cogging with some hundred periods in a turn change by a
/// tenth of a radian and more, rad.
const MOVED: f64 = 1.0e-3;

/// Prints what was found.
fn report(rig: &RigConfig, recordings: &[Recorded], found: &Identified) -> anyhow::Result<()> {
    let all_s: f64 = recordings.iter().map(Recorded::seconds).sum();
    let turns = found.turned / std::f64::consts::TAU;
    tell!(
        "{all_s:.1} s without torque, the sphere moves in {:.1} s: {:.1}, {:.1} and {:.1} turns in all about n1, n2 and n3",
        found.moving_s,
        turns.x,
        turns.y,
        turns.z
    )?;
    tell!(
        "slip over rolling, root mean square: {:.3} % as drawn, {:.3} % as found; {:.1} % of the motion fits to no geometry and is left out",
        100.0 * found.share[0],
        100.0 * found.share[1],
        100.0 * found.left_out
    )?;
    tell!("\n{:<24} {:>12} {:>12} {:>12}  seen", "parameter", "drawn", "found", "95 %, +-")?;
    for value in &found.values {
        tell!("{}", row(rig, value))?;
    }
    let missing = found.missing();
    if !missing.is_empty() {
        tell!("\n{}", more(&missing, found))?;
    }
    let centre = |value: &&Value| matches!(value.name, Name::Centre(_)) && value.found.abs() > value.interval;
    if found.values.iter().any(|value| centre(&value)) {
        tell!("the sphere's centre is not where the steering axes meet; a rig file cannot say it")?;
    }
    Ok(())
}

/// Returns a row of the table.
fn row(rig: &RigConfig, value: &Value) -> String {
    let of = value.wheel.map_or_else(|| "sphere".to_owned(), |wheel| format!("wheel {}", rig.wheels[wheel]));
    let more = filed(rig, value);
    let (factor, unit, digits) = match value.name {
        Name::Axis(_) => (1.0, "", 6),
        Name::Cone | Name::Toe | Name::Zero => (1.0, " rad", 6),
        Name::Radius | Name::Centre(_) => (1.0e3, " mm", 4),
    };
    let number = |x: f64| format!("{:.digits$}", factor * x);
    let (colour, seen) = if value.seen { (style::GOOD, "yes") } else { (style::WARN, "no") };
    format!(
        "{:<24} {:>12} {:>12} {:>12}  {colour}{seen}{}",
        format!("{of} {}{unit}", value.name),
        number(value.drawn + more),
        number(value.found + more),
        number(value.interval),
        style::OFF
    )
}

/// Returns what to add to a value to tell it as the rig file has it: zeros are found relative to
/// those of the file.
pub(super) fn filed(rig: &RigConfig, value: &Value) -> f64 {
    match (value.name, value.wheel) {
        (Name::Zero, Some(wheel)) => rig.zero_offsets[2 * wheel],
        _ => 0.0,
    }
}

/// Returns what to record in addition.
fn more(missing: &[usize], found: &Identified) -> String {
    let (warn, off) = (style::WARN, style::OFF);
    if missing.len() == 3 {
        return format!(
            "{warn}not everything is seen{off}: turn longer about all axes, with large turns both ways"
        );
    }
    let axes =
        |of: &dyn Fn(usize) -> String| missing.iter().map(|k| of(*k)).collect::<Vec<_>>().join(" and ");
    format!(
        "{warn}not everything is seen{off}: turn about {} as well (so far {} turns). What is not seen stays near the drawing; \
         give all recordings together",
        axes(&|k| format!("n{}", k + 1)),
        axes(&|k| format!("{:.1}", found.turned[k] / std::f64::consts::TAU))
    )
}

/// Writes the rig file with the values found. Comments and the order of the keys stay.
fn write(drawing: Option<&Path>, rig: &RigConfig, found: &Identified, file: &Path) -> anyhow::Result<()> {
    let mut document = edit::open(drawing)?;
    for (i, wheel) in found.wheels.iter().enumerate() {
        let table = &mut document["wheel"][i];
        let zero = wrap_angle(rig.zero_offsets[2 * i] + found.zeros[i]);
        if found.what == What::Geometry {
            let length = axis_length(&table["axis"]);
            let axis: toml_edit::Array =
                wheel.axis.to_array().iter().map(|x| rounded(length * x, 9)).collect();
            edit::put(table, "axis", axis.into());
            edit::put(table, "cone", rounded(wheel.cone, 7).into());
            edit::put(table, "toe", rounded(wheel.toe, 7).into());
            edit::put(table, "radius", rounded(wheel.radius, 9).into());
        }
        edit::put(&mut table["steer"], "zero_offset", rounded(zero, 7).into());
    }
    if let Some(drift) = found.drift() {
        edit::put(&mut document["sphere"], "drift", drift.into());
    }
    edit::save(&document, file)
}

/// Returns the length of the steering axis as the drawing has it, so that the new one looks alike.
fn axis_length(axis: &toml_edit::Item) -> f64 {
    let number = |x: &toml_edit::Value| x.as_float().or_else(|| x.as_integer().map(|x| x as f64));
    let numbers = axis.as_array().into_iter().flatten().filter_map(number);
    numbers.map(|x| x * x).sum::<f64>().sqrt()
}

fn rounded(x: f64, digits: i32) -> f64 {
    let unit = 10.0_f64.powi(digits);
    (x * unit).round() / unit
}
