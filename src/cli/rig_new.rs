//! `hbot rig new`: writes a commented rig file from a few answers.

use std::fmt::Write as _;
use std::io::{BufRead as _, IsTerminal as _, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use clap::{Args, ValueEnum};
use hbot_config::RigConfig;

use super::out::say;

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
    #[arg(long, value_parser = clap::value_parser!(u32).range(2..=8))]
    wheels: Option<u32>,
    /// Radius of the sphere, m
    #[arg(long, value_name = "M")]
    radius: Option<f64>,
    /// Mass of the sphere, kg
    #[arg(long, value_name = "KG")]
    mass: Option<f64>,
    /// Radius of the wheels, m
    #[arg(long, value_name = "M")]
    wheel_radius: Option<f64>,
    /// Angle between a wheel's steering axis and the line to its contact, degrees
    #[arg(long, value_name = "DEG")]
    cone: Option<f64>,
    /// Turns of the motor per turn of the wheel about its steering axis
    #[arg(long, value_name = "RATIO")]
    steer_gear: Option<f64>,
    /// Turns of the motor per turn of the rolling wheel
    #[arg(long, value_name = "RATIO")]
    drive_gear: Option<f64>,
    /// Largest torque of a steer joint after its gear, N m
    #[arg(long, value_name = "NM")]
    steer_peak: Option<f64>,
    /// Largest torque of a drive joint after its gear, N m
    #[arg(long, value_name = "NM")]
    drive_peak: Option<f64>,
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
    let file = args.file.clone();
    let answers = answers(args)?;
    let text = text(&answers)?;
    // A rig that is not legal is reported by the keys of the file that would have been written.
    RigConfig::from_toml(&text, &file.display().to_string())?;
    std::fs::write(&file, text).with_context(|| format!("{}: cannot be written", file.display()))?;
    say!("{} is written. Measure what is marked \"measure\", then run", file.display())?;
    say!("  hbot rig check {0}\n  hbot server --rig {0} --port sim", file.display())?;
    say!("docs/first-torque.md leads from here to the first torque")?;
    Ok(ExitCode::SUCCESS)
}

fn answers(args: NewArgs) -> anyhow::Result<Answers> {
    let protocol = match args.protocol {
        Some(protocol) => protocol,
        None => Controllers::from_str(
            &ask("protocol of the motor controllers (hbot, moteus, odrive)", "hbot")?,
            true,
        )
        .map_err(|_| anyhow::anyhow!("the protocol is hbot, moteus or odrive"))?,
    };
    let text = |given: Option<String>, question, default| given.map_or_else(|| ask(question, default), Ok);
    let number = |given: Option<f64>, question, default: &str| match given {
        Some(number) => Ok(number),
        None => ask(question, default)?.parse().with_context(|| format!("{question}: a number")),
    };
    Ok(Answers {
        name: text(args.name, "name of the rig", "My Hbot")?,
        protocol,
        port: text(args.port, "serial device, or sim", "sim")?,
        wheels: match args.wheels {
            Some(wheels) => wheels,
            None => ask("number of wheels", "2")?.parse().context("number of wheels: 2 to 8")?,
        },
        radius: number(args.radius, "radius of the sphere, m", "0.102")?,
        mass: number(args.mass, "mass of the sphere, kg", "0.467")?,
        wheel_radius: number(args.wheel_radius, "radius of the wheels, m", "0.0155")?,
        cone_deg: number(args.cone, "angle between steering axis and contact, degrees", "10")?,
        steer: Motor {
            gear: number(args.steer_gear, "gear of the steer joints", "1")?,
            peak: number(args.steer_peak, "largest torque of a steer joint after its gear, N m", "0.93")?,
            inertia: 2.7e-5,
        },
        drive: Motor {
            gear: number(args.drive_gear, "gear of the drive joints", "17")?,
            peak: number(args.drive_peak, "largest torque of a drive joint after its gear, N m", "0.14")?,
            inertia: 3.5e-6,
        },
    })
}

/// Asks a question if a person is at the terminal. Returns `default` if there is none, or if the
/// answer is empty.
fn ask(question: &str, default: &str) -> anyhow::Result<String> {
    let terminal = std::io::stdin().is_terminal() && std::io::stderr().is_terminal();
    if !terminal {
        return Ok(default.to_owned());
    }
    write!(anstream::stderr(), "{question} [{default}]: ")?;
    std::io::stderr().flush()?;
    let mut line = String::new();
    std::io::stdin().lock().read_line(&mut line)?;
    let answer = line.trim();
    Ok(if answer.is_empty() { default.to_owned() } else { answer.to_owned() })
}

/// Returns the text of the rig file.
fn text(answers: &Answers) -> anyhow::Result<String> {
    let Answers { name, radius, mass, port, .. } = answers;
    let protocol =
        answers.protocol.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default();
    let mut text = format!(
        "# Written by `hbot rig new`. Units are SI; an angle can be a text such as \"10 deg\". docs/files.md describes every key.\n\
         # What is marked \"measure\" was not asked for and is a value of the prototype.\n\n\
         name = {name:?}\n\n[sphere]\nradius = {radius} # m\nmass = {mass} # kg; a hollow sphere is assumed\n"
    );
    for wheel in 0..answers.wheels {
        let angle = std::f64::consts::TAU * f64::from(wheel) / f64::from(answers.wheels);
        write!(
            text,
            "\n[[wheel]]\nname = \"{}\"\naxis = [{:.6}, {:.6}, -1] # measure: from the centre to the wheel, z up; any length\n\
             cone = \"{} deg\" # between the steering axis and the contact's normal; must not be 0\n\
             radius = {} # m\n",
            char::from(b'A' + wheel as u8),
            angle.cos(),
            angle.sin(),
            answers.cone_deg,
            answers.wheel_radius,
        )?;
        joint(&mut text, answers, 2 * wheel)?;
        joint(&mut text, answers, 2 * wheel + 1)?;
    }
    write!(
        text,
        "\n[loop]\nrate_hz = 1000 # `hbot doctor --rig FILE` says how high it can be\n\n\
         [link]\nport = {port:?} # \"sim\", or a device such as \"/dev/ttyACM0\"\nprotocol = {protocol:?} # docs/controllers.md\n\n\
         [limits]\ntorque = {:.3} # N m on the sphere: begin low\ntorque_rate = 20 # N m/s: begin low\nspeed = 10 # rad/s\n",
        0.2 * answers.drive.peak.min(answers.steer.peak) * answers.radius / answers.wheel_radius,
    )?;
    Ok(text)
}

/// Writes the table of joint `number` (from 0, in the order steer, drive of each wheel).
fn joint(text: &mut String, answers: &Answers, number: u32) -> std::fmt::Result {
    let steer = number.is_multiple_of(2);
    let (table, motor) = if steer { ("steer", answers.steer) } else { ("drive", answers.drive) };
    // Ids of moteus and ODrive begin with 1; hbot's own link counts places from 0.
    let controller = number + u32::from(answers.protocol != Controllers::Hbot);
    writeln!(text, "\n[wheel.{table}]\ncontroller = {controller} # its id, or its place on hbot's own link")?;
    if answers.protocol == Controllers::Hbot {
        writeln!(text, "counts_per_turn = 16384 # measure: counts of the encoder per turn of the motor")?;
    }
    writeln!(text, "gear = {} # turns of the motor per turn of the joint", motor.gear)?;
    writeln!(text, "sign = 1 # `hbot rig calibrate` tells whether it is -1")?;
    if steer {
        writeln!(
            text,
            "zero = \"assume\" # a person sets the wheels to zero before power goes on; or \"index\", \"absolute\""
        )?;
    }
    writeln!(
        text,
        "inertia = {:e} # measure: kg m² at the joint\npeak = {} # N m after the gear\ncontinuous = {:.4} # measure: N m that it \
         holds without getting hot",
        motor.inertia,
        motor.peak,
        0.1 * motor.peak,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn usual() -> Answers {
        Answers {
            name: "A \"test\"".to_owned(),
            protocol: Controllers::Hbot,
            port: "sim".to_owned(),
            wheels: 2,
            radius: 0.102,
            mass: 0.467,
            wheel_radius: 0.0155,
            cone_deg: 10.0,
            steer: Motor { gear: 1.0, peak: 0.93, inertia: 2.7e-5 },
            drive: Motor { gear: 17.0, peak: 0.14, inertia: 3.5e-6 },
        }
    }

    #[test]
    fn every_answer_is_in_the_rig_that_is_read_back() {
        for wheels in 2..=8 {
            for protocol in [Controllers::Hbot, Controllers::Moteus, Controllers::Odrive] {
                let answers = Answers { wheels, protocol, ..usual() };
                let rig = RigConfig::from_toml(&text(&answers).unwrap(), "new.toml");
                let rig = rig.unwrap_or_else(|mistakes| panic!("{wheels} wheels, {protocol:?}:\n{mistakes}"));
                assert_eq!(rig.name, answers.name);
                assert_eq!(rig.rig.device.wheels().len(), wheels as usize);
                let spec = rig.rig.device.wheels()[0].spec();
                assert!((spec.cone - 10_f64.to_radians()).abs() < 1.0e-12, "{}", spec.cone);
                assert_eq!((spec.radius, rig.rig.joints[1].peak), (0.0155, 0.14));
                assert_eq!(rig.link.protocol.name(), format!("{protocol:?}").to_lowercase());
            }
        }
    }
}
