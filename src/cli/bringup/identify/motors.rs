//! `hbot rig identify --motors`: the motors move the free sphere, and torque constants, inertias,
//! friction, imbalance and cogging show in how it moves.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use clap::Args;
use hbot_config::RigConfig;
use hbot_core::Quat;
use hbot_core::design::rig::{Friction, Zero};
use hbot_host::bus::field;
use hbot_host::commission::bringup::excite::{Ended, Exchange, Excitation, brake, excite};
use hbot_host::commission::bringup::joint::{Verdict, ramp};
use hbot_host::commission::bringup::{Bench, Interrupted, Truth};
use hbot_identify::motors::{Measured, MotorName, MotorValue, Sample, SphereInertia, measure};
use toml_edit::{Array, InlineTable, Item};

use super::super::{edit, joint_name, on_the_lines};
use super::IdentifyArgs;
use crate::cli::numbers::{positive, whole_seconds};
use crate::cli::out::{note, say};
use crate::cli::style;

/// Joint rate below which a joint rests, rad/s.
const REST: f64 = 0.02;
/// Time for which all joints must rest, and the longest time to wait for it, s.
const REST_S: f64 = 0.2;
const LONGEST_S: f64 = 20.0;

/// Slip divided by rolling distance from which on the geometry is not exact.
const INEXACT: f64 = 3.0e-3;

/// What the motion by the motors has given.
enum Moved {
    /// A joint does not do what it is told.
    Bad(usize, Verdict),
    /// The motion, and how it ended.
    Log(Vec<Sample>, Quat, Ended),
}

/// Time for taking the hands off before the motors move, s.
const BEFORE_S: f64 = 3.0;

/// How the motors move the sphere.
#[derive(Debug, Args)]
pub(crate) struct Motion {
    /// Time of the motion by the motors, 20 to 600 s
    #[arg(long, value_name = "SECONDS", default_value_t = 60, requires = "motors",
        allow_negative_numbers = true, value_parser = whole_seconds(20..=600))]
    seconds: u32,
    /// Speed of the motion by the motors about each axis, root mean square, rad/s
    #[arg(long, value_name = "RATE", default_value_t = 0.8, requires = "motors", value_parser = positive("rad/s"), allow_negative_numbers = true)]
    wander: f64,
    /// Switch the motors off if the sphere, or a joint that is tested alone, turns faster than
    /// this, rad/s
    #[arg(long, value_name = "RATE", default_value_t = 6.0, requires = "motors", value_parser = positive("rad/s"), allow_negative_numbers = true)]
    speed: f64,
    /// Build the simulated rig from this rig file, which says its true friction, torque constants
    /// and so on
    #[arg(long, value_name = "FILE", requires = "motors")]
    built: Option<PathBuf>,
}

pub(super) fn run(args: &IdentifyArgs) -> anyhow::Result<ExitCode> {
    let rig = args.which.load()?;
    if let Some(file) = &args.out {
        edit::refuse_another(file)?;
    }
    let found = match measured(&rig, &args.motion)? {
        Ok(found) => found,
        Err(why) => {
            say!("{}{why}{}", style::BAD, style::OFF)?;
            return Ok(ExitCode::FAILURE);
        }
    };
    let (found, inertia) = match args.added.map(|added| found.clone().with_added(&rig.rig, added)) {
        None => (found, None),
        Some(Ok((found, inertia))) => (found, Some(inertia)),
        Some(Err(why)) => {
            say!("{}{why}{}", style::BAD, style::OFF)?;
            return Ok(ExitCode::FAILURE);
        }
    };
    report(&rig, &found, inertia)?;
    if let Some(file) = &args.out {
        write(args.which.rig.as_deref(), &rig, &found, inertia, file)?;
        say!("{}: written", file.display())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Lets the motors of `rig` move the sphere, and measures what shows. Returns why there is no
/// result if a motor does not do what it is told, or if something ended the motion.
pub(crate) fn measured(rig: &RigConfig, motion: &Motion) -> anyhow::Result<Result<Measured, String>> {
    let Motion { seconds, wander, speed, .. } = *motion;
    let built = motion.built.as_deref().map(RigConfig::from_path).transpose()?;
    let how = Excitation { seconds: f64::from(seconds), wander, fastest: speed };
    let truth = Truth { built: built.as_ref(), ..Truth::default() };
    let moved = on_the_lines(rig, truth, |bench| {
        say!(
            "in {BEFORE_S} s the motors move the sphere for {seconds} s, with at most half of what they can hold continuously: hands off, \
             and one at the switch. Ctrl-C stops it"
        )?;
        let came = bench.time_s();
        while bench.time_s() - came < BEFORE_S {
            bench.exchange(None)?;
        }
        if let Some((joint, verdict)) = signs(bench, rig, speed)? {
            return Ok(Moved::Bad(joint, verdict));
        }
        let mut log = Vec::new();
        let mut from = None;
        let mut keep = |now: &Exchange| {
            from.get_or_insert(now.orientation);
            log.push(Sample { time_s: now.time_s, counts: now.reading.counts, torque: now.torque });
        };
        let ended = excite(bench, &how, &mut keep)?;
        Ok(Moved::Log(log, from.unwrap_or(Quat::IDENTITY), ended))
    })?;
    let (log, from) = match moved {
        Moved::Bad(_, Verdict::TooFast(_)) => return Ok(Err(Ended::TooFast.to_string())),
        Moved::Bad(joint, verdict) => {
            return Ok(Err(format!("joint {}, {}: {verdict}", joint + 1, joint_name(rig, joint))));
        }
        Moved::Log(_, _, ended) if ended != Ended::Done => return Ok(Err(ended.to_string())),
        Moved::Log(log, from, _) => (log, from),
    };
    note!("{}computing from {} readings{}", style::DIM, log.len(), style::OFF);
    Ok(measure(&rig.rig, from, &log).map_err(|refusal| refusal.to_string()))
}

/// Tests that each motor turns its joint the right way, before the joints act together. Returns the
/// first joint that does not.
fn signs(bench: &mut Bench, rig: &RigConfig, speed: f64) -> Result<Option<(usize, Verdict)>, Interrupted> {
    for j in 0..rig.rig.device.joints() {
        let joint = rig.rig.joints[j];
        if !(joint.peak > 0.0) {
            continue;
        }
        rest(bench)?;
        let outcome = ramp(bench, j, joint.continuous, speed)?;
        // A simulated sphere without friction coasts for ever. A real one comes to rest.
        if outcome.verdict == Verdict::Turns && bench.is_simulated() {
            continue;
        }
        if outcome.verdict != Verdict::Good {
            return Ok(Some((j, outcome.verdict)));
        }
        brake(bench, j, outcome.torque)?;
    }
    rest(bench)?;
    Ok(None)
}

/// Waits with motors off until all joints rest, or for as long as makes sense.
fn rest(bench: &mut Bench) -> Result<(), Interrupted> {
    let joints = bench.rig().device.joints();
    let mut still_s = 0.0;
    for _ in 0..(LONGEST_S / bench.period_s()) as u32 {
        let reading = bench.exchange(None)?;
        let rests = reading.rates[..joints].iter().all(|rate| rate.abs() < REST);
        still_s = if rests { still_s + bench.period_s() } else { 0.0 };
        if still_s >= REST_S {
            break;
        }
    }
    Ok(())
}

/// Prints what was found.
fn report(rig: &RigConfig, found: &Measured, inertia: Option<SphereInertia>) -> anyhow::Result<()> {
    say!(
        "{:.1} s of motion count; the equation of motion leaves {:.2} mN m of {:.1} mN m (root mean square); the torques act {:.2} ms \
         after they are commanded",
        found.used_s,
        1e3 * found.left,
        1e3 * found.torque,
        1e3 * found.delay_s
    )?;
    say!("\n{:<34} {:>12} {:>12} {:>12}  seen", "value", "rig file", "found", "95 %, +-")?;
    for value in &found.values {
        say!("{}", row(rig, value))?;
    }
    match inertia {
        None => say!(
            "the inertia of the sphere counts as known: that of a hollow sphere of sphere.mass. If it is wrong by 1 %, so are all \
             values except torque_scale divided by another one. `--added` measures it"
        )?,
        Some(SphereInertia { factor, interval }) => say!(
            "the added inertia shows that of the sphere: {factor:.4} (+- {interval:.4}) times that of a hollow sphere of sphere.mass. \
             Take off what was added. Friction and imbalance of the sphere are those of the rig file in this scale"
        )?,
    }
    if found.slip > INEXACT {
        say!(
            "{}the joints contradict each other by {:.2} % of their motion{}: the geometry is not exact, and the values may be wrong by \
             several times that. Find it first: `hbot rig identify` with recordings",
            style::WARN,
            100.0 * found.slip,
            style::OFF
        )?;
    }
    Ok(())
}

fn row(rig: &RigConfig, value: &MotorValue) -> String {
    let of = value.joint.map_or_else(
        || "sphere".to_owned(),
        |j| format!("wheel {} {}", rig.wheels[j / 2], if j.is_multiple_of(2) { "steer" } else { "drive" }),
    );
    let (factor, unit, digits) = match value.name {
        MotorName::TorqueScale | MotorName::Loss => (1.0, "", 5),
        MotorName::Inertia => (1.0e6, " 1e-6 kg m²", 3),
        MotorName::Viscous => (1.0e3, " mN m s/rad", 5),
        MotorName::Coulomb | MotorName::Imbalance(_) | MotorName::Cogging(_) => (1.0e3, " mN m", 4),
    };
    let number = |x: f64| format!("{:.digits$}", factor * x);
    let (colour, seen) = if value.seen { (style::GOOD, "yes") } else { (style::WARN, "no") };
    format!(
        "{:<34} {:>12} {:>12} {:>12}  {colour}{seen}{}",
        format!("{of} {}{unit}", value.name),
        number(value.filed),
        number(value.found),
        number(value.interval),
        style::OFF
    )
}

/// Writes the rig file with the values found. Comments and the order of the keys stay.
fn write(
    drawing: Option<&Path>,
    rig: &RigConfig,
    found: &Measured,
    inertia: Option<SphereInertia>,
    file: &Path,
) -> anyhow::Result<()> {
    let mut document = edit::open(drawing)?;
    let seen = |joint: Option<usize>, name: MotorName| {
        found.values.iter().any(|value| value.joint == joint && value.name == name && value.seen)
    };
    for j in 0..rig.rig.device.joints() {
        let kind = if j.is_multiple_of(2) { "steer" } else { "drive" };
        let table = document["wheel"]
            .get_mut(j / 2)
            .and_then(|wheel| wheel.get_mut(kind))
            .with_context(|| format!("{} is no table", field(j)))?;
        let joint = &found.joints[j];
        if seen(Some(j), MotorName::TorqueScale) {
            edit::put(table, "torque_scale", digits(joint.torque_scale, 5).into());
        }
        if seen(Some(j), MotorName::Inertia) {
            edit::put(table, "inertia", digits(found.inertia[j], 5).into());
        }
        if seen(Some(j), MotorName::Loss) && (joint.gear_loss > 0.0 || table.get("gear_loss").is_some()) {
            edit::put(table, "gear_loss", digits(joint.gear_loss, 3).into());
        }
        if seen(Some(j), MotorName::Coulomb) {
            friction(table, joint.friction);
        }
        let mut cogging = Array::new();
        for harmonic in joint.cogging.iter().filter(|harmonic| harmonic.amplitude > 0.0) {
            let mut entry = InlineTable::new();
            entry.insert("per_turn", i64::from(harmonic.per_turn).into());
            entry.insert("amplitude", digits(harmonic.amplitude, 4).into());
            entry.insert("phase", digits(harmonic.phase, 4).into());
            cogging.push(entry);
        }
        if !cogging.is_empty() && keeps_its_zero(rig, j) {
            edit::put(table, "cogging", cogging.into());
        } else if !cogging.is_empty() {
            note!(
                "{}note{}: the cogging of {} is not written: its encoder does not have the same zero after each power-up",
                style::WARN,
                style::OFF,
                joint_name(rig, j)
            );
        }
    }
    let sphere = &mut document["sphere"];
    if let Some(inertia) = inertia {
        let mass = rig.rig.device.sphere_mass() * inertia.factor;
        edit::put(sphere, "mass", digits(mass, 5).into());
    }
    friction(sphere, found.sphere);
    if found.imbalance != hbot_core::Vec3::ZERO || sphere.get("imbalance").is_some() {
        let torque: Array = found.imbalance.to_array().iter().map(|x| digits(*x, 4)).collect();
        edit::put(sphere, "imbalance", torque.into());
    }
    edit::save(&document, file)
}

/// Returns whether the encoder of a joint has the same zero after each power-up.
fn keeps_its_zero(rig: &RigConfig, joint: usize) -> bool {
    matches!(rig.rig.joints[joint].zero, Zero::Absolute | Zero::Index)
}

/// Sets the friction in `table`, if there is any or was any.
fn friction(table: &mut Item, friction: Friction) {
    if friction.is_some() || table.get("friction").is_some() {
        let mut entry = InlineTable::new();
        entry.insert("coulomb", digits(friction.coulomb, 4).into());
        entry.insert("viscous", digits(friction.viscous, 4).into());
        edit::put(table, "friction", entry.into());
    }
}

/// Rounds `x` to so many digits that count.
fn digits(x: f64, digits: i32) -> f64 {
    if x == 0.0 {
        return 0.0;
    }
    // Through the decimal notation, so that the file shows no digits of rounding.
    format!("{x:.*e}", (digits - 1).max(0) as usize).parse().unwrap_or(x)
}
