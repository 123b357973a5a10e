//! `hbot rig new`: writes a commented rig file from a few answers.

mod file;
mod questions;
mod units;

use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use clap::{Args, ValueEnum};
use hbot_config::rig::Protocol;

use self::units::Quantity;
use super::ask::{at_terminal, note_if_nobody_is_there, somebody_is_there};
use super::numbers::whole;
use super::out::{create_new, note, refuse_missing_folder, say, tell};

/// Options of `hbot rig new`. On a terminal, the command asks for each number that is not given.
/// Otherwise it takes the default.
#[derive(Debug, Args)]
pub(crate) struct NewArgs {
    /// File to write; it must not exist
    file: PathBuf,
    /// Name of the rig, shown to people
    #[arg(long)]
    name: Option<String>,
    /// Protocol of the motor controllers
    #[arg(long, value_enum)]
    protocol: Option<Controllers>,
    /// Serial device of the motor controllers, or `sim`
    #[arg(long, value_name = "sim|DEVICE")]
    port: Option<String>,
    /// Number of wheels, 2 to 8
    #[arg(long, allow_negative_numbers = true, value_parser = whole(2..=8_u32))]
    wheels: Option<u32>,
    /// Radius of the sphere, m, 0.001 to 10
    #[arg(long, value_name = "M", allow_negative_numbers = true, value_parser = length)]
    radius: Option<f64>,
    /// Mass of the sphere, kg, 0.001 to 1000
    #[arg(long, value_name = "KG", allow_negative_numbers = true, value_parser = mass)]
    mass: Option<f64>,
    /// Radius of the wheels, m, 0.0001 to 10
    #[arg(long, value_name = "M", allow_negative_numbers = true, value_parser = length)]
    wheel_radius: Option<f64>,
    /// Angle between a wheel's steering axis and the line to its contact, degrees, above 0 and
    /// below 180
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = angle)]
    cone: Option<f64>,
    /// Turns of the motor per turn of the wheel about its steering axis, 0.001 to 10000
    #[arg(long, value_name = "RATIO", allow_negative_numbers = true, value_parser = ratio)]
    steer_gear: Option<f64>,
    /// Turns of the motor per turn of the rolling wheel, 0.001 to 10000
    #[arg(long, value_name = "RATIO", allow_negative_numbers = true, value_parser = ratio)]
    drive_gear: Option<f64>,
    /// Largest torque of a steer joint after its gear, N m, above 0 and at most 1000
    #[arg(long, value_name = "NM", allow_negative_numbers = true, value_parser = torque)]
    steer_peak: Option<f64>,
    /// Largest torque of a drive joint after its gear, N m, above 0 and at most 1000
    #[arg(long, value_name = "NM", allow_negative_numbers = true, value_parser = torque)]
    drive_peak: Option<f64>,
    /// Friction coefficient between wheel and sphere, above 0.001 and at most 10
    #[arg(long, value_name = "MU", allow_negative_numbers = true, value_parser = ratio)]
    friction: Option<f64>,
    /// Force with which each wheel presses on the sphere, N, above 0.001 and at most 10000
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = force)]
    normal_force: Option<f64>,
}

fn length(text: &str) -> Result<f64, String> {
    Quantity::Length.read(text)
}

fn mass(text: &str) -> Result<f64, String> {
    Quantity::Mass.read(text)
}

fn angle(text: &str) -> Result<f64, String> {
    Quantity::Angle.read(text)
}

fn torque(text: &str) -> Result<f64, String> {
    Quantity::Torque.read(text)
}

fn force(text: &str) -> Result<f64, String> {
    Quantity::Force.read(text)
}

fn ratio(text: &str) -> Result<f64, String> {
    Quantity::Ratio.read(text)
}

/// A protocol of motor controllers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Controllers {
    /// hbot's own serial link, for firmware of your own
    Hbot,
    /// moteus servos on an fdcanusb
    Moteus,
    /// ODrives on a serial CAN adapter
    Odrive,
}

impl From<Controllers> for Protocol {
    fn from(controllers: Controllers) -> Self {
        match controllers {
            Controllers::Hbot => Self::Hbot,
            Controllers::Moteus => Self::Moteus,
            Controllers::Odrive => Self::Odrive,
        }
    }
}

/// The answers from which a rig file is written.
#[derive(Debug, Clone, PartialEq)]
struct Answers {
    name: String,
    protocol: Controllers,
    port: String,
    wheels: u32,
    radius: f64,
    mass: f64,
    wheel_radius: f64,
    cone_deg: f64,
    steer: Motor,
    drive: Motor,
    /// Friction coefficient between wheel and sphere.
    friction: f64,
    /// Force of each wheel on the sphere, N.
    normal_force: f64,
}

impl Answers {
    /// Returns the default of each answer.
    fn usual() -> Self {
        Self {
            name: "My Hbot".to_owned(),
            protocol: Controllers::Hbot,
            port: "sim".to_owned(),
            wheels: 2,
            radius: 0.102,
            mass: 0.467,
            wheel_radius: 0.0155,
            cone_deg: 10.0,
            steer: Motor { gear: 1.0, peak: 0.93, inertia: 2.7e-5 },
            drive: Motor { gear: 17.0, peak: 0.14, inertia: 3.5e-6 },
            friction: 0.8,
            normal_force: 10.0,
        }
    }
}

/// The motor of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Motor {
    gear: f64,
    peak: f64,
    /// Inertia at the joint, kg m². It is that of the prototype.
    inertia: f64,
}

pub(crate) fn run(args: NewArgs) -> anyhow::Result<ExitCode> {
    if args.file.exists() {
        bail!("{} exists already: name another file", args.file.display());
    }
    refuse_missing_folder(&args.file)?;
    note_if_nobody_is_there();
    if somebody_is_there() {
        note!(
            "An answer can have a unit (60 mm). Enter takes the value in brackets, ? explains the question."
        );
    }
    let answers = questions::answers(&args, &mut at_terminal)?;
    let text = file::text(&answers)?;
    create_new(&args.file)?
        .write_all(text.as_bytes())
        .with_context(|| format!("{}: cannot be written", args.file.display()))?;
    say!("{} is written. Measure what is marked \"measure\", then run", args.file.display())?;
    tell!("  hbot rig check {0}\n  hbot server --rig {0} --port sim", args.file.display())?;
    say!("docs/first-torque.md leads from here to the first torque")?;
    Ok(ExitCode::SUCCESS)
}
