//! `hbot rig test` and `hbot rig calibrate`: a rig before any loop is closed over it. No server may hold its port meanwhile.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use clap::Args;
use hbot_config::{Override, RigConfig};
use hbot_core::rig::Zero;
use hbot_server::bringup::calibrate::{Calibration, calibrate};
use hbot_server::bringup::joint::{self, Verdict};
use hbot_server::bringup::open;
use serde_json::json;

use super::out::say;
use super::style;

/// Readings are this far apart, s: long enough that a count is little of what has moved, short enough that wheels hardly turn.
const APART_S: f64 = 0.02;
/// Slip that bearings, rubber and encoders leave of a rig that is as its file says, as a share of rolling.
const ORDINARY: f64 = 0.05;
/// A zero that is off by less is as good as it gets by hand, rad.
const TRIFLE: f64 = 0.01;

/// Which rig.
#[derive(Debug, Args)]
pub(crate) struct Which {
    /// Rig file (TOML) [default: the prototype, built in]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// `sim` for the simulated rig, or a serial device, in place of the rig file's
    #[arg(long, value_name = "sim|DEVICE")]
    port: Option<String>,
}

impl Which {
    fn load(&self) -> anyhow::Result<RigConfig> {
        let over =
            self.port.as_ref().map(|port| Override { path: "link.port", value: json!(port), from: "--port" });
        Ok(RigConfig::load(self.rig.as_deref(), over.as_slice())?)
    }
}

/// Options of `hbot rig test`.
#[derive(Debug, Args)]
pub(crate) struct TestArgs {
    #[command(flatten)]
    which: Which,
    /// Which joint, from 1, in the order steer, drive of each wheel
    #[arg(long, value_name = "N")]
    joint: usize,
    /// Torque at the joint in its controller's own sense, N m; begin with a hundredth of its peak
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    torque: f64,
    /// Stop where the joint turns faster, rad/s
    #[arg(long, value_name = "RATE", default_value_t = 5.0)]
    speed: f64,
}

/// Options of `hbot rig calibrate`.
#[derive(Debug, Args)]
pub(crate) struct CalibrateArgs {
    #[command(flatten)]
    which: Which,
    /// How long to watch
    #[arg(long, value_name = "SECONDS", default_value_t = 20, value_parser = clap::value_parser!(u32).range(5..=600))]
    seconds: u32,
}

fn joint_name(rig: &RigConfig, joint: usize) -> String {
    format!("{} of wheel {}", if joint.is_multiple_of(2) { "steer" } else { "drive" }, rig.wheels[joint / 2])
}

pub(crate) fn test(args: &TestArgs) -> anyhow::Result<ExitCode> {
    let rig = args.which.load()?;
    let joints = rig.rig.device.joints();
    if !(1..=joints).contains(&args.joint) {
        bail!("--joint {} is not there; legal: 1 to {joints}", args.joint);
    }
    let number = args.joint - 1;
    let peak = rig.rig.joints[number].peak;
    if !(args.torque != 0.0 && args.torque.abs() <= peak) {
        bail!("--torque {} is out of range; legal: up to {peak} N m either way, and not 0", args.torque);
    }
    if !(args.speed > 0.0) {
        bail!("--speed {} is out of range; legal: above 0 rad/s", args.speed);
    }
    let mut bench = open(&rig, false)?;
    let outcome = joint::test(&mut bench, number, args.torque, args.speed)?;
    let good = outcome.verdict == Verdict::Good;
    let colour = if good { style::GOOD } else { style::BAD };
    say!(
        "joint {}, {}: {:+.4} rad by its counts, {:+.4} rad by its rates, at most {:.2} rad/s\n  {colour}{}{}",
        args.joint,
        joint_name(&rig, number),
        outcome.moved,
        outcome.by_rate,
        outcome.fastest,
        outcome.verdict,
        style::OFF
    )?;
    if good {
        let sense = if rig.rig.joints[number].reversed { "against" } else { "in" };
        say!(
            "  by the rig file's sign it has turned {sense} its positive sense; `hbot rig calibrate` tells whether that is so"
        )?;
    }
    Ok(if good { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

pub(crate) fn run_calibrate(args: &CalibrateArgs) -> anyhow::Result<ExitCode> {
    let rig = args.which.load()?;
    let mut bench = open(&rig, true)?;
    say!(
        "motors are off: turn the sphere about all axes, slowly and without letting it slip, for {} s",
        args.seconds
    )?;
    let every = (APART_S / bench.period_s()).round().max(1.0) as u32;
    let ticks = (f64::from(args.seconds) / bench.period_s()) as u32;
    let mut counts = Vec::new();
    for tick in 0..ticks {
        let reading = bench.exchange(None)?;
        if tick.is_multiple_of(every) {
            counts.push(reading.counts);
        }
    }
    let found = calibrate(&rig.rig, &counts).context("nothing has moved: turn the sphere while this runs")?;
    Ok(if report(&rig, &found)? { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Says what was found: whether the rig is as its file says.
fn report(rig: &RigConfig, found: &Calibration) -> anyhow::Result<bool> {
    say!(
        "slip over rolling, root mean square: {:.2} % as the file has the rig, {:.2} % as found",
        100.0 * found.before,
        100.0 * found.after
    )?;
    let (bad, off) = (style::BAD, style::OFF);
    if !found.known {
        say!(
            "  {bad}not enough was turned to tell the zeros{off}: turn further, about all three axes, and longer"
        )?;
        return Ok(false);
    }
    let mut as_filed = true;
    for (i, wheel) in found.wheels.iter().enumerate() {
        let name = &rig.wheels[i];
        for (wrong, joint, key) in
            [(wheel.wrong_sign[0], 2 * i, "steer"), (wheel.wrong_sign[1], 2 * i + 1, "drive")]
        {
            if wrong {
                as_filed = false;
                let sign = if rig.rig.joints[joint].reversed { 1 } else { -1 };
                say!(
                    "  {bad}wheel {name}: the sign of {key} is wrong{off}: set wheel[{i}].{key}.sign = {sign}"
                )?;
            }
        }
        let zero_wrong = wheel.zero.abs() > TRIFLE.max(3.0 * wheel.zero_deviation);
        as_filed &= !zero_wrong;
        say!(
            "  wheel {name}: {}steering zero off by {:+.4} rad{off} (+- {:.4}); radius {:.3} mm, cone {:.4} rad",
            if zero_wrong { bad } else { style::GOOD },
            wheel.zero,
            wheel.zero_deviation,
            1000.0 * wheel.radius,
            wheel.cone
        )?;
        if zero_wrong {
            let filed = rig.zero_offsets[2 * i];
            let lasts = match rig.rig.joints[2 * i].zero {
                Zero::Absolute | Zero::Index => "for good",
                Zero::Assume | Zero::Calibrate => "with zero = \"assume\", until the controllers lose power",
            };
            say!(
                "    set wheel[{i}].steer.zero_offset = {:.4}: it holds {lasts}",
                if wheel.wrong_sign[0] { wheel.zero - filed } else { wheel.zero + filed }
            )?;
        }
    }
    if found.after > ORDINARY {
        as_filed = false;
        say!(
            "  {bad}no signs, zeros, radii and cones explain it{off}: look for slip, play, or a wrong gear (`hbot rig test`)"
        )?;
    }
    Ok(as_filed)
}
