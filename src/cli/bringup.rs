//! `hbot rig scan`, `hbot rig test` and `hbot rig calibrate`: a rig before any loop is closed over
//! it. No server may hold its port meanwhile. `hbot rig identify` evaluates recordings or moves the
//! sphere by its motors, and `hbot rig certify` writes a page about both.

mod calibrate;
mod certify;
mod edit;
mod identify;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use hbot_config::{Override, RigConfig};
use hbot_host::bus::{Filtering, Lag, each_once, field};
use hbot_host::commission::bringup::joint::{self, DISAGREEMENT, Outcome, Verdict};
use hbot_host::commission::bringup::scan::scan;
use hbot_host::commission::bringup::{Bench, Interrupted, Truth, open};
use hbot_host::rig::last_word::Program;
use hbot_host::run_loop::signals;
use serde_json::json;

use super::numbers::{positive, real, whole};
use super::out::{note, tell};
use super::style;
pub(crate) use calibrate::{CalibrateArgs, run_calibrate};
pub(crate) use certify::{CertifyArgs, run_certify};
pub(crate) use identify::{IdentifyArgs, run_identify};

/// The rig to work on.
#[derive(Debug, Args)]
pub(crate) struct Which {
    /// Rig file (TOML) [default: the prototype, built in]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// `sim` for the simulated rig, or a serial device, in place of the rig file's port
    #[arg(long, value_name = "sim|DEVICE")]
    port: Option<String>,
}

impl Which {
    fn load(&self) -> anyhow::Result<RigConfig> {
        load(self.rig.as_deref(), self.port.as_deref())
    }
}

/// Reads the rig file, or takes the prototype, and says so.
fn load(file: Option<&Path>, port: Option<&str>) -> anyhow::Result<RigConfig> {
    let over = port.map(|port| Override { path: "link.port", value: json!(port), from: "--port" });
    let rig = super::rig_file::load(file, over.as_slice())?;
    if file.is_none() {
        note!(
            "{}note{}: without --rig this takes the built-in prototype, not a rig of yours",
            style::WARN,
            style::OFF
        );
    }
    Ok(rig)
}

/// The rig to work on, whose file can also be given without `--rig`.
#[derive(Debug, Args)]
pub(crate) struct Rig {
    /// The same as --rig
    #[arg(value_name = "RIG.toml", conflicts_with = "rig")]
    rig_file: Option<PathBuf>,
    #[command(flatten)]
    which: Which,
}

impl Rig {
    fn file(&self) -> Option<&Path> {
        self.rig_file.as_deref().or(self.which.rig.as_deref())
    }

    fn load(&self) -> anyhow::Result<RigConfig> {
        load(self.file(), self.which.port.as_deref())
    }
}

/// Options of `hbot rig scan`.
#[derive(Debug, Args)]
pub(crate) struct ScanArgs {
    #[command(flatten)]
    rig: Rig,
}

/// Options of `hbot rig test`.
#[derive(Debug, Args)]
pub(crate) struct TestArgs {
    #[command(flatten)]
    rig: Rig,
    /// Number of the joint, from 1, in the order steer, drive of each wheel
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole(1..=16_usize))]
    joint: usize,
    /// Torque at the joint with its controller's own sign, N m, up to its peak and not 0. `auto`:
    /// rises slowly to the joint's continuous torque at most, and ends when the joint has turned by
    /// 0.05 rad
    #[arg(long, value_name = "T|auto", default_value = "auto", allow_negative_numbers = true)]
    torque: TestTorque,
    /// How long `--torque T` is held, 0.1 to 30 s; above 0.5 s up to the joint's continuous torque
    /// [default: 0.5]
    #[arg(long, value_name = "SECONDS", value_parser = real("s", |s| (0.1..=30.0).contains(&s), "0.1 to 30"), allow_negative_numbers = true)]
    hold: Option<f64>,
    /// Stop if any joint turns faster than this, rad/s, above 0
    #[arg(long, value_name = "RATE", default_value_t = 5.0, value_parser = positive("rad/s"), allow_negative_numbers = true)]
    speed: f64,
}

/// The torque of a test.
#[derive(Debug, Clone, Copy, PartialEq)]
enum TestTorque {
    /// It rises until the joint moves.
    Auto,
    /// This torque, N m.
    Fixed(f64),
}

impl std::str::FromStr for TestTorque {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            text => text.parse().map(Self::Fixed).map_err(|_| "a number or `auto`".to_owned()),
        }
    }
}

fn joint_name(rig: &RigConfig, joint: usize) -> String {
    let name = if joint.is_multiple_of(2) { "steer" } else { "drive" };
    format!("{name} of {}", wheel_name(rig, joint / 2))
}

/// Returns the name of a wheel with its index in the rig file, such as `wheel A (wheel[0])`.
pub(super) fn wheel_name(rig: &RigConfig, wheel: usize) -> String {
    format!("wheel {} (wheel[{wheel}])", rig.wheels[wheel])
}

/// What follows from another zero of a joint whose cogging the rig file has.
const COGGING: &str =
    "its cogging was measured with the zero of before: `hbot rig identify --motors` measures it again";

/// Returns whether the rig file has cogging of `joint`. Its phases belong to the zero of the file.
fn has_cogging(rig: &RigConfig, joint: usize) -> bool {
    let measured = rig.rig.compensation.as_ref();
    measured.is_some_and(|it| it.joints[joint].cogging.iter().any(|harmonic| harmonic.amplitude != 0.0))
}

/// Opens the lines of a rig, which is truly as `truth` says if it is simulated, runs `what` on
/// them, and closes them. If a signal ends it, the motors are switched off first. The process then
/// ends as with Ctrl-C, so that a loop in a shell does not continue with the next joint.
fn on_the_lines<T>(
    rig: &RigConfig,
    truth: Truth<'_>,
    what: impl FnOnce(&mut Bench) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    note_if_simulated(rig);
    let stop = signals::stop_flag()?;
    let mut bench = open(rig, truth, stop.clone(), &Program::this(super::LAST_WORD))?;
    for notice in bench.notices() {
        note!("{}note{}: {notice}", style::WARN, style::OFF);
    }
    let done = what(&mut bench);
    drop(bench);
    // The motors are off. What follows only computes, and a signal ends it at once.
    let again = signals::default_again();
    if stop.is_set() {
        match &done {
            Ok(_) => super::out::error(&Interrupted::Stopped),
            Err(error) => super::out::error(error),
        }
        signals::end_as_interrupted()?;
    }
    let done = done?;
    again?;
    Ok(done)
}

/// Says that a rig is simulated, because a rig file that `rig new` writes is.
fn note_if_simulated(rig: &RigConfig) {
    if rig.link.port.is_simulated() {
        note!(
            "{}SIMULATED{}: no real motor is asked or moved; `--port DEVICE` takes a real line",
            style::WARN,
            style::OFF
        );
    }
}

/// Lists the controllers that answer on each line of the rig. The exit code shows whether they
/// match the rig file.
pub(crate) fn run_scan(args: &ScanArgs) -> anyhow::Result<ExitCode> {
    let rig = args.rig.load()?;
    note_if_simulated(&rig);
    let (mut good, mut noted) = (true, false);
    for line in scan(&rig)? {
        good &= line.is_good();
        tell!("{}{}{}: {} answer", style::NAME, line.port, style::OFF, line.found.len())?;
        for it in &line.found {
            let supply = it.supply_v.map_or(String::new(), |volts| format!(", {volts:.1} V"));
            let zero = it.zero.map_or(String::new(), |zero| format!(", zero {zero}"));
            tell!("  {}: {}, firmware {}{supply}{zero}", it.id, it.model, it.firmware)?;
            let lag = |lag: &Lag, what| {
                format!("{what} {:.1} ms late ({} {:.0} Hz)", 1e3 * lag.seconds, lag.setting, lag.hz)
            };
            let lags = [
                it.filtering.torque.as_ref().map(|it| lag(it, "torque")),
                it.filtering.rate.as_ref().map(|it| lag(it, "rate")),
            ];
            if lags.iter().any(Option::is_some) {
                tell!("     {}", lags.into_iter().flatten().collect::<Vec<_>>().join(", "))?;
            }
            for remedy in &it.remedies {
                tell!("     {}{}{}\n       {}", style::BAD, remedy.what, style::OFF, remedy.command)?;
            }
        }
        let notes = |it: &Filtering| [it.warnings(&rig), it.advice(&rig)].concat();
        for warning in each_once(line.found.iter().map(|it| (it.id.to_string(), notes(&it.filtering)))) {
            tell!("  {}note:{} {warning}", style::WARN, style::OFF)?;
            noted = true;
        }
        for (ids, what) in [
            (&line.twice, "more than one controller has the id: connect one at a time and give each its own"),
            (&line.missing, "in the rig file and nobody answers: check power, wiring and `controller`"),
            (&line.others, "answers and is not in the rig file: disconnect it, or name it there"),
        ] {
            for id in ids {
                tell!("  {}{id}: {what}{}", style::BAD, style::OFF)?;
            }
        }
    }
    if good && !noted {
        tell!("{}every controller answers, and no setting was found wrong{}", style::GOOD, style::OFF)?;
    }
    Ok(if good { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

pub(crate) fn test(args: &TestArgs) -> anyhow::Result<ExitCode> {
    let rig = args.rig.load()?;
    let joints = rig.rig.device.joints();
    if !(1..=joints).contains(&args.joint) {
        bail!("--joint {} is not there; legal: 1 to {joints}", args.joint);
    }
    let number = args.joint - 1;
    let (peak, continuous) = (rig.rig.joints[number].peak, rig.rig.joints[number].continuous);
    let long = args.hold.is_some_and(|hold| hold > joint::HOLD_S);
    match args.torque {
        TestTorque::Fixed(torque) if !(torque != 0.0 && torque.abs() <= peak) => {
            bail!(
                "--torque {torque} is out of range; legal: up to {peak} N m either way, and not 0; or auto"
            );
        }
        TestTorque::Auto if !(peak > 0.0) => bail!("joint {} has no motor", args.joint),
        TestTorque::Fixed(torque) if long && torque.abs() > continuous => bail!(
            "--torque {torque} is too much for --hold; legal: up to the joint's continuous torque, {continuous} N m, either way"
        ),
        TestTorque::Auto if args.hold.is_some() => bail!("--hold needs a number after --torque"),
        _ => {}
    }
    let outcome = on_the_lines(&rig, Truth::default(), |bench| {
        Ok(match args.torque {
            TestTorque::Fixed(torque) => {
                joint::test(bench, number, torque, args.hold.unwrap_or(joint::HOLD_S), args.speed)?
            }
            TestTorque::Auto => joint::ramp(bench, number, continuous, args.speed)?,
        })
    })?;
    let good = outcome.verdict == Verdict::Good;
    let colour = if good { style::GOOD } else { style::BAD };
    tell!(
        "joint {}, {}: {:+.4} rad by its counts, {:+.4} rad by its rates, at most {:.2} rad/s\n  {colour}{}{}",
        args.joint,
        joint_name(&rig, number),
        outcome.moved,
        outcome.by_rate,
        outcome.fastest,
        outcome.verdict,
        style::OFF
    )?;
    if args.torque == TestTorque::Auto && outcome.verdict != Verdict::Turns {
        tell!("  the torque rose to {:.2} mN m", 1e3 * outcome.torque)?;
    }
    match outcome.verdict {
        Verdict::Good => {
            tell!("  {}", compared(&outcome))?;
            let turned = (outcome.torque > 0.0) != rig.rig.joints[number].reversed;
            let sense = if turned { "in" } else { "against" };
            tell!(
                "  by the rig file's sign it has turned {sense} its positive sense; `hbot rig calibrate` tells whether that is so\n  \
                 where another joint than the {} has turned, `controller` of the two is exchanged in the rig file",
                joint_name(&rig, number)
            )?;
        }
        Verdict::Gear(ratio) if ratio.is_finite() => tell!(
            "  {} would have them agree; the rig file has {}",
            format_args!("{}.gear = {:.3}", field(number), ratio * rig.rig.joints[number].gear),
            rig.rig.joints[number].gear
        )?,
        _ => {}
    }
    Ok(if good { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Says what was compared in a test that has found a joint to be good.
fn compared(outcome: &Outcome) -> String {
    let Outcome { torque, moved, by_rate, .. } = outcome;
    format!(
        "under {:+.2} mN m its counts went the way of the torque, by {moved:+.4} rad; the rates that its controller reports \
         add up to {by_rate:+.4} rad, which differs by {:.1} % (good: less than {:.0} %)",
        1e3 * torque,
        100.0 * (by_rate / moved - 1.0).abs(),
        100.0 * DISAGREEMENT
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_good_test_says_what_was_compared_with_numbers_and_units() {
        let outcome = Outcome {
            joint: 1,
            torque: 0.01,
            moved: 0.3,
            by_rate: 0.303,
            fastest: 2.0,
            verdict: Verdict::Good,
        };
        let said = compared(&outcome);
        for words in ["+10.00 mN m", "+0.3000 rad", "+0.3030 rad", "differs by 1.0 %", "less than 10 %"] {
            assert!(said.contains(words), "{said}");
        }
    }
}
