//! `hbot rig calibrate`: finds wrong signs, zeros and radii while a hand turns the sphere.

#[cfg(test)]
mod tests;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, ensure};
use clap::Args;
use hbot_config::RigConfig;
use hbot_core::design::rig::Zero;
use hbot_core::inputs::Complaints;
use hbot_core::rotation::wrap_angle;
use hbot_host::commission::bringup::joint::Verdict;
use hbot_host::commission::bringup::{Bench, Truth};
use hbot_identify::calibrate::{Calibration, calibrate, exchanged, explains, still};
use hbot_identify::motion::Counts;

use super::super::numbers::whole_seconds;
use super::super::out::tell;
use super::super::style;
use super::{COGGING, Rig, edit, has_cogging, joint_name, on_the_lines, wheel_name};

/// Error of a zero that is as small as it can be made by hand, rad.
const TRIFLE: f64 = 0.01;
/// Relative difference of two wheels' radii that is too large for a misread caliper.
const CALIPER: f64 = 0.03;
/// Difference of a cone angle from the rig file that is no tolerance of manufacture, rad.
const MISBUILT: f64 = 0.02;
/// Slip divided by rolling distance from which on the rig file counts as wrong: as it is, or
/// although signs, zeros, radii and cones were fitted.
const DOUBTFUL: f64 = 0.03;

/// Options of `hbot rig calibrate`.
#[derive(Debug, Args)]
pub(crate) struct CalibrateArgs {
    #[command(flatten)]
    rig: Rig,
    /// How long to watch the joints, 5 to 600 s
    #[arg(long, value_name = "SECONDS", default_value_t = 20, allow_negative_numbers = true, value_parser = whole_seconds(5..=600))]
    seconds: u32,
    /// Write the rig file with the corrections to this file; it can be the rig file itself
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
}

/// A value of the rig file that a calibration corrects.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Correction {
    /// Number of the joint, from 0.
    joint: usize,
    key: &'static str,
    value: f64,
}

impl Correction {
    /// Returns the value as the rig file has it: a sign is a whole number.
    fn written(&self) -> String {
        if self.key == "sign" { format!("{:.0}", self.value) } else { format!("{:.4}", self.value) }
    }
}

/// The result of a calibration.
struct Told {
    /// The message for the user.
    words: String,
    /// True if the rig is as its file states.
    as_filed: bool,
    /// The values to correct. Empty if nothing is wrong, or if nothing can be concluded.
    corrections: Vec<Correction>,
}

pub(crate) fn run_calibrate(args: &CalibrateArgs) -> anyhow::Result<ExitCode> {
    let rig = args.rig.load()?;
    // A person turns the sphere for a while before the file is written.
    if let Some(file) = &args.write {
        edit::refuse_another(file)?;
    }
    let counts = on_the_lines(&rig, Truth::turned(), |bench| {
        if rig.link.port.is_simulated() {
            tell!(
                "the simulated hand turns the sphere about all axes for {} s, faster than real time",
                args.seconds
            )?;
        } else {
            bench.switch_off()?;
            tell!(
                "motors are off: turn the sphere about all axes, slowly and without letting it slip, for {} s",
                args.seconds
            )?;
        }
        watch(bench, &rig, args.seconds)
    })?;
    tell!("the sphere can rest: computing from {} readings", counts.len())?;
    ensure!(
        !counts.is_empty(),
        "no index has passed on some wheel, so its zero is not known: turn the sphere until each wheel has passed its index, and try again"
    );
    let told = told(&rig, &counts)?;
    tell!("{}\n{}", told.words.trim_end(), to_paste(&rig, &told))?;
    if let Some(file) = &args.write {
        write(args.rig.file(), &told.corrections, file)?;
        let what = match told.corrections.len() {
            0 if told.as_filed => "the values of the rig file: there was nothing to correct".to_owned(),
            0 => "the values of the rig file: correct first what stands above".to_owned(),
            1 => "1 correction".to_owned(),
            n => format!("{n} corrections"),
        };
        tell!("{} has {what}", file.display())?;
    }
    Ok(if told.as_filed { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Returns the end of the message: the lines to write into the rig file, or why there are none.
fn to_paste(rig: &RigConfig, told: &Told) -> String {
    let unset = zeros_to_choose(rig).filter(|_| told.as_filed || !told.corrections.is_empty());
    if told.corrections.is_empty() {
        return match unset {
            Some(unset) => format!("signs, zero_offset and radii are as the rig file says\n{unset}"),
            None if told.as_filed => {
                "nothing to write into the rig file: the rig is as its file says".to_owned()
            }
            None => "nothing to write into the rig file: correct first what stands above".to_owned(),
        };
    }
    let mut text = "to write into the rig file (`--write FILE` does it):".to_owned();
    let mut last = None;
    for correction in &told.corrections {
        if last != Some(correction.joint) {
            let table = if correction.joint.is_multiple_of(2) { "steer" } else { "drive" };
            text += &format!("\n  [wheel.{table}] of {}:", wheel_name(rig, correction.joint / 2));
            last = Some(correction.joint);
        }
        text += &format!("\n  {} = {}", correction.key, correction.written());
    }
    if let Some(unset) = unset {
        text += &format!("\n{unset}");
    }
    text
}

/// Returns what to do about the wheels of which the rig file does not say how their zeros become
/// known. Returns `None` if there are no such wheels.
fn zeros_to_choose(rig: &RigConfig) -> Option<String> {
    let joints = &rig.rig.joints;
    let unset = (0..rig.wheels.len()).filter(|wheel| joints[2 * wheel].zero == Zero::Calibrate);
    let unset: Vec<String> = unset.map(|wheel| wheel_name(rig, wheel)).collect();
    (!unset.is_empty()).then(|| {
        format!(
            "{}zero = \"calibrate\"{} of {}: the zero counts as not known, and a server stays unreferenced, without torque.\n  \
             zero_offset is measured now. Write how the zero becomes known at each start into [wheel.steer]: zero = \"assume\" if \
             the encoder counts from where it gets power, \"absolute\" if it knows its angle without power, or \"index\" if it \
             has an index (docs/files.md). Then start `hbot server`",
            style::WARN,
            style::OFF,
            unset.join(", ")
        )
    })
}

/// Writes the rig file `rig`, or the built-in one, with corrections to `file`. Comments and the
/// order of the keys stay.
fn write(rig: Option<&Path>, corrections: &[Correction], file: &Path) -> anyhow::Result<()> {
    let mut document = edit::open(rig)?;
    correct(&mut document, corrections)?;
    edit::save(&document, file)
}

fn correct(document: &mut toml_edit::DocumentMut, corrections: &[Correction]) -> anyhow::Result<()> {
    for correction in corrections {
        let table = if correction.joint.is_multiple_of(2) { "steer" } else { "drive" };
        let joint = &mut document["wheel"][correction.joint / 2][table];
        edit::put(joint, correction.key, correction.written().parse()?);
    }
    Ok(())
}

/// Records the counts of all joints for `seconds`, with motors off. Before an encoder with an index
/// has passed it, its counts have another zero, so nothing is recorded.
///
/// # Errors
/// Fails if a controller complains, or has restarted: its counts may have another zero.
fn watch(bench: &mut Bench, rig: &RigConfig, seconds: u32) -> anyhow::Result<Vec<Counts>> {
    let ticks = (f64::from(seconds) / bench.period_s()) as u32;
    let steers = (0..rig.rig.device.joints()).step_by(2);
    let indexed: u16 =
        steers.filter(|joint| rig.rig.joints[*joint].zero == Zero::Index).map(|joint| 1 << joint).sum();
    let mut counts = Vec::new();
    for _ in 0..ticks {
        let reading = bench.exchange(None)?;
        // With motors off, a watchdog that expires does no harm.
        let complaints = Complaints { watchdog: false, disobeyed: false, ..reading.complaints };
        ensure!(complaints == Complaints::default(), "{}", Verdict::Complains(complaints));
        if reading.index_seen & indexed == indexed {
            counts.push(reading.counts);
        }
    }
    Ok(counts)
}

/// Evaluates recorded counts.
fn told(rig: &RigConfig, counts: &[Counts]) -> anyhow::Result<Told> {
    let dead = still(&rig.rig, counts);
    if !dead.is_empty() && dead.len() < rig.rig.device.joints() {
        let mut words = String::new();
        for joint in dead {
            writeln!(
                words,
                "  {}joint {}, {}: its counts stood still while others moved{}: where it was turned too, its encoder is dead, or its cable",
                style::BAD,
                joint + 1,
                joint_name(rig, joint),
                style::OFF
            )?;
        }
        // Without this joint, nothing can be concluded about the others.
        return Ok(Told { words, as_filed: false, corrections: Vec::new() });
    }
    let found = calibrate(&rig.rig, counts).context("nothing has moved: turn the sphere while this runs")?;
    let mut told = report(rig, &found)?;
    let words = &mut told.words;
    if !explains(&rig.rig, &found) {
        match exchanged(&rig.rig, counts) {
            Some((a, b)) => writeln!(
                words,
                "  {}were joints {} and {} exchanged, it would be explained{}: the {} and the {} have each other's encoder, or each \
                 other's `controller` in the rig file",
                style::BAD,
                a + 1,
                b + 1,
                style::OFF,
                joint_name(rig, a),
                joint_name(rig, b)
            )?,
            None => writeln!(
                words,
                "  {}no signs, zeros, radii, cones or two exchanged joints explain it{}: look in the rig file for a wrong gear, a wrong axis, and the \
                 order of the controllers, then for slip and play",
                style::BAD,
                style::OFF
            )?,
        }
    }
    Ok(told)
}

/// Describes a calibration in words.
fn report(rig: &RigConfig, found: &Calibration) -> Result<Told, std::fmt::Error> {
    let mut words = String::new();
    let mut corrections = Vec::new();
    writeln!(
        words,
        "slip over rolling, root mean square: {:.2} % as the file has the rig, {:.2} % as found",
        100.0 * found.before,
        100.0 * found.after
    )?;
    let (bad, off) = (style::BAD, style::OFF);
    if !explains(&rig.rig, found) {
        // The zeros found are not valid then and must not be set.
        return Ok(Told { words, as_filed: false, corrections });
    }
    if !found.known {
        writeln!(
            words,
            "  {bad}not enough was turned to tell the zeros{off}: turn further, about all three axes, and longer"
        )?;
        return Ok(Told { words, as_filed: false, corrections });
    }
    if found.after > DOUBTFUL {
        writeln!(
            words,
            "  {bad}signs, zeros, radii and cones do not explain the motion{off}: an axis in the rig file is wrong, or a wheel slips. Correct \
             the axes, or record a minute of motion and run `hbot rig identify`"
        )?;
        return Ok(Told { words, as_filed: false, corrections });
    }
    let mut as_filed = true;
    for (i, wheel) in found.wheels.iter().enumerate() {
        let name = wheel_name(rig, i);
        for (wrong, joint, key) in
            [(wheel.wrong_sign[0], 2 * i, "steer"), (wheel.wrong_sign[1], 2 * i + 1, "drive")]
        {
            if wrong {
                as_filed = false;
                let sign = if rig.rig.joints[joint].reversed { 1 } else { -1 };
                corrections.push(Correction { joint, key: "sign", value: f64::from(sign) });
                writeln!(
                    words,
                    "  {bad}{name}: the sign of {key} is wrong{off}: set wheel[{i}].{key}.sign = {sign}"
                )?;
            }
        }
        let zero_wrong = wheel.zero.abs() > TRIFLE.max(3.0 * wheel.zero_deviation);
        as_filed &= !zero_wrong;
        writeln!(
            words,
            "  {name}: {}steering zero off by {:+.4} rad{off} (+- {:.4}); radius {:.3} mm, cone {:.4} rad",
            if zero_wrong { bad } else { style::GOOD },
            wheel.zero,
            wheel.zero_deviation,
            1000.0 * wheel.radius,
            wheel.cone
        )?;
        let cone = rig.rig.device.wheels()[i].spec().cone;
        if (wheel.cone - cone).abs() > MISBUILT {
            as_filed = false;
            writeln!(
                words,
                "  {bad}{name}: the cone is {:.4} rad, and {cone:.4} in the rig file{off}: measure it, or record a minute of motion and \
                 run `hbot rig identify`",
                wheel.cone
            )?;
        }
        // With another sign the same zero is another offset.
        let filed = rig.zero_offsets[2 * i];
        let value = wrap_angle(if wheel.wrong_sign[0] { wheel.zero - filed } else { wheel.zero + filed });
        let is_other = zero_wrong || wheel.wrong_sign[0] && wrap_angle(value - filed).abs() > TRIFLE;
        if is_other {
            let lasts = match rig.rig.joints[2 * i].zero {
                Zero::Absolute | Zero::Index => "for good",
                Zero::Assume | Zero::Calibrate => "with zero = \"assume\", until the controllers lose power",
            };
            corrections.push(Correction { joint: 2 * i, key: "zero_offset", value });
            writeln!(words, "    set wheel[{i}].steer.zero_offset = {value:.4}: it holds {lasts}")?;
        }
        if (is_other || wheel.wrong_sign[0]) && has_cogging(rig, 2 * i) {
            writeln!(words, "    {COGGING}")?;
        }
    }
    if let Some((most, least, apart)) = radii_apart(rig, found) {
        as_filed = false;
        let gear = |wheel: usize| rig.rig.joints[2 * wheel + 1].gear;
        let gears = [gear(most) / (1.0 + apart), gear(least) * (1.0 + apart)];
        let [most, least] = [most, least].map(|wheel| wheel_name(rig, wheel));
        writeln!(
            words,
            "  {bad}{most} rolls {:.0} % further than {least} for what the file says of both{off}: measure their radii. Where those are \
             right, a gear is wrong: that of the drive of {most} would be {:.2}, or that of {least} {:.2}",
            100.0 * apart,
            gears[0],
            gears[1]
        )?;
    }
    let is_far = shares(rig, found).iter().any(|share| (share - 1.0).abs() > CALIPER);
    if as_filed && (is_far || found.before > DOUBTFUL) {
        as_filed = false;
        writeln!(
            words,
            "  {bad}the radii and cones of the file do not explain the motion{off}, those found do: measure the radii of sphere and wheels, \
             check the gears, or record a minute of motion and run `hbot rig identify`"
        )?;
    }
    corrections.sort_by_key(|correction| correction.joint);
    Ok(Told { words, as_filed, corrections })
}

/// Returns each wheel's radius as found, divided by that of the file. The sphere's counts as right.
fn shares(rig: &RigConfig, found: &Calibration) -> Vec<f64> {
    let filed = rig.rig.device.wheels().iter().map(|wheel| wheel.spec().radius);
    found.wheels.iter().zip(filed).map(|(wheel, filed)| wheel.radius / filed).collect()
}

/// Compares the radii found with those of the file. Returns the two wheels whose ratios differ
/// most, and by how much, if the difference is too large for a caliper's error.
fn radii_apart(rig: &RigConfig, found: &Calibration) -> Option<(usize, usize, f64)> {
    let share = shares(rig, found);
    let by_share = |a: &usize, b: &usize| share[*a].total_cmp(&share[*b]);
    let (most, least) = ((0..share.len()).max_by(by_share)?, (0..share.len()).min_by(by_share)?);
    let apart = share[most] / share[least] - 1.0;
    (apart > CALIPER).then_some((most, least, apart))
}
