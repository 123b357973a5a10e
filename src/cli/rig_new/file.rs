//! The text of a rig file with the answers of a person.

use std::fmt::Write as _;

use clap::ValueEnum as _;
use hbot_config::rig::Protocol;
use hbot_host::bus::driver;
use hbot_host::commission::doctor::line_rate;

use super::{Answers, Controllers};

/// Baud rate of a line whose rig file names none.
const BAUD: u32 = 3_000_000;

/// Returns the text of the rig file.
pub(super) fn text(answers: &Answers) -> anyhow::Result<String> {
    let Answers { name, radius, mass, port, friction, normal_force, .. } = answers;
    let protocol =
        answers.protocol.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default();
    let mut text = format!(
        "# Written by `hbot rig new`. Units are SI; an angle can be a text such as \"10 deg\". docs/files.md describes every key.\n\
         # What is marked \"measure\" was not asked for and is a value of the prototype.\n\n\
         name = {}\n\n[sphere]\nradius = {} # m\nmass = {} # kg; a hollow sphere is assumed\n",
        quoted(name),
        real(*radius),
        real(*mass),
    );
    for wheel in 0..answers.wheels {
        let angle = std::f64::consts::TAU * f64::from(wheel) / f64::from(answers.wheels);
        write!(
            text,
            "\n[[wheel]]\nname = \"{}\"\naxis = [{}, {}, -1] # measure: from the centre to the wheel, z up; any length\n\
             cone = \"{} deg\" # between the steering axis and the contact's normal; must not be 0\n\
             radius = {} # m\n",
            char::from(b'A' + wheel as u8),
            digits(angle.cos()),
            digits(angle.sin()),
            answers.cone_deg,
            real(answers.wheel_radius),
        )?;
        joint(&mut text, answers, 2 * wheel)?;
        joint(&mut text, answers, 2 * wheel + 1)?;
    }
    let (rate, why) = rate(answers);
    let (torque, from) = torque(answers);
    writeln!(text, "\n[loop]\nrate_hz = {rate} # {why}")?;
    let late = Protocol::from(answers.protocol).rate_lag();
    if late * f64::from(rate) > 1.0 {
        writeln!(
            text,
            "rate_estimate = \"kalman\" # from the positions: the controllers' own rates are {:.1} ms late",
            1e3 * late
        )?;
    }
    write!(
        text,
        "\n\
         [link]\nport = {} # \"sim\", or a device such as \"/dev/ttyACM0\"\nprotocol = {protocol:?} # docs/controllers.md\n\n\
         [limits]\n# {from}\ntorque = {torque} # N m on the sphere: begin low\ntorque_rate = 20 # N m/s: begin low\n\
         speed = 10 # rad/s\ntraction = {{ mu = {}, normal_force = {} }} # N, on each wheel\n",
        quoted(port),
        real(*friction),
        real(*normal_force),
    )?;
    Ok(text)
}

/// The rate of the loop where the line carries it, Hz.
const USUAL_RATE: f64 = 1000.0;

/// Returns the rate of the loop, Hz, and why it is that: the usual one, or what the line carries
/// with all joints on it.
fn rate(answers: &Answers) -> (u32, String) {
    let protocol = Protocol::from(answers.protocol);
    let most = |joints: u32| {
        let most = line_rate(&driver(protocol).traffic(joints as usize), BAUD);
        // An ODrive sends its position every few whole milliseconds.
        if protocol == Protocol::Odrive { 1000.0 / (1000.0 / most).ceil() } else { most }.floor()
    };
    let joints = 2 * answers.wheels;
    if most(joints) >= USUAL_RATE {
        return (USUAL_RATE as u32, "`hbot doctor --rig FILE` says how high it can be".to_owned());
    }
    let lines = (2..=joints).find(|lines| most(joints.div_ceil(*lines)) >= USUAL_RATE);
    let more = lines.map_or_else(String::new, |lines| {
        format!("; {lines} lines (`port` a list, and a `port` of each joint) carry {USUAL_RATE:.0} Hz")
    });
    (most(joints) as u32, format!("the most that one line carries with {joints} joints{more}"))
}

/// Returns a largest torque on the sphere to begin with, N m, and how it was found: a fifth of what
/// one wheel makes with the weaker of its motors, or of what friction holds, if that is less.
fn torque(answers: &Answers) -> (f64, String) {
    let Answers { radius, wheel_radius, friction, normal_force, .. } = answers;
    let peak = answers.drive.peak.min(answers.steer.peak);
    let [motors, grip] = [peak * radius / wheel_radius, friction * normal_force * radius];
    let torque = rounded(0.2 * motors.min(grip)).min(1000.0);
    let from = if motors <= grip {
        format!(
            "A fifth of {} N m: the smaller peak, {peak} N m, times radius of the sphere / radius of the wheel.",
            rounded(motors)
        )
    } else {
        format!(
            "A fifth of {} N m: friction {friction} times normal force {normal_force} N times radius of the sphere; the motors \
             could make {} N m.",
            rounded(grip),
            rounded(motors)
        )
    };
    (torque, from)
}

/// Returns a text as it stands in a TOML file.
fn quoted(text: &str) -> String {
    toml_edit::Value::from(text).to_string()
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
    writeln!(text, "gear = {} # turns of the motor per turn of the joint", real(motor.gear))?;
    writeln!(text, "sign = 1 # `hbot rig calibrate` tells whether it is -1")?;
    if steer {
        // Controllers with ids report no index.
        let index = if answers.protocol == Controllers::Hbot { "\"index\", " } else { "" };
        writeln!(
            text,
            "zero = \"assume\" # a person sets the wheels to zero before power goes on; or {index}\"absolute\""
        )?;
    }
    writeln!(
        text,
        "inertia = {:e} # measure: kg m² at the joint\npeak = {} # N m after the gear\ncontinuous = {} # N m that it holds \
         without getting hot; a tenth of the peak: replace it by the value of the motor's data sheet",
        motor.inertia,
        real(motor.peak),
        real(rounded(0.1 * motor.peak)),
    )
}

/// Returns a number with at most six decimals.
fn digits(x: f64) -> f64 {
    // Plus 0, which takes the sign of -0 away.
    (x * 1.0e6).round() / 1.0e6 + 0.0
}

/// Returns a number with three significant digits.
fn rounded(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
}

/// Returns a number as it stands in a TOML file. A long whole number would be too large an integer.
fn real(x: f64) -> String {
    if x.abs() < 1.0e15 { x.to_string() } else { format!("{x:e}") }
}

#[cfg(test)]
mod tests {
    use hbot_config::RigConfig;
    use hbot_host::bus::late_rates;

    use super::*;

    #[test]
    fn what_is_computed_is_marked_as_computed() {
        let text = text(&Answers::usual()).unwrap();
        assert!(
            text.contains("continuous = 0.093 # N m that it holds without getting hot; a tenth of the peak")
        );
        assert!(!text.lines().any(|line| line.contains("continuous") && line.contains("measure")), "{text}");
    }

    #[test]
    fn the_first_limit_says_whether_motors_or_friction_set_it() {
        let (torque_of_motors, from) = torque(&Answers { normal_force: 100.0, ..Answers::usual() });
        // 0.14 N m * 0.102 m / 0.0155 m = 0.921 N m.
        assert_eq!(torque_of_motors, 0.184);
        assert!(from.contains("A fifth of 0.921 N m: the smaller peak"), "{from}");
        let (torque_of_grip, from) = torque(&Answers::usual());
        // 0.8 * 10 N * 0.102 m = 0.816 N m.
        assert_eq!(torque_of_grip, 0.163);
        assert!(from.contains("A fifth of 0.816 N m: friction 0.8"), "{from}");
    }

    #[test]
    fn every_answer_is_in_the_rig_that_is_read_back() {
        for wheels in 2..=8 {
            for protocol in [Controllers::Hbot, Controllers::Moteus, Controllers::Odrive] {
                let name = "A \"test\" \\ of 'it'".to_owned();
                let answers = Answers { name, wheels, protocol, ..Answers::usual() };
                let rig = RigConfig::from_toml(&text(&answers).unwrap(), "new.toml");
                let rig = rig.unwrap_or_else(|mistakes| panic!("{wheels} wheels, {protocol:?}:\n{mistakes}"));
                assert_eq!(rig.name, answers.name);
                assert_eq!(rig.rig.device.wheels().len(), wheels as usize);
                let spec = rig.rig.device.wheels()[0].spec();
                assert!((spec.cone - 10_f64.to_radians()).abs() < 1.0e-12, "{}", spec.cone);
                assert_eq!((spec.radius, rig.rig.joints[1].peak), (0.0155, 0.14));
                assert_eq!(rig.link.baud, BAUD);
                assert_eq!(late_rates(&rig), None, "{protocol:?}");
                // `hbot rig check` accepts the line, and a faster loop would not fit.
                let most = line_rate(&driver(rig.link.protocol).traffic(2 * wheels as usize), BAUD);
                let rate = f64::from(rig.rate_hz);
                let is_odrive = rig.link.protocol == Protocol::Odrive;
                let faster = if is_odrive { 1000.0 / (1000.0 / rate - 0.9).floor() } else { rate + 1.0 };
                assert!(rate <= most && (rate == USUAL_RATE || faster > most), "{rate} of {most}");
                let traction = rig.rig.limits.traction.expect("it was asked for");
                assert_eq!((traction.mu, traction.normal_force), (0.8, 10.0));
                assert_eq!(rig.link.protocol.name(), format!("{protocol:?}").to_lowercase());
            }
        }
    }
}
