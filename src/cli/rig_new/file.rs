//! The text of a rig file with the answers of a person.

use std::fmt::Write as _;

use clap::ValueEnum as _;

use super::{Answers, Controllers};

/// Returns the text of the rig file.
pub(super) fn text(answers: &Answers) -> anyhow::Result<String> {
    let Answers { name, radius, mass, port, .. } = answers;
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
            "\n[[wheel]]\nname = \"{}\"\naxis = [{:.6}, {:.6}, -1] # measure: from the centre to the wheel, z up; any length\n\
             cone = \"{} deg\" # between the steering axis and the contact's normal; must not be 0\n\
             radius = {} # m\n",
            char::from(b'A' + wheel as u8),
            angle.cos(),
            angle.sin(),
            answers.cone_deg,
            real(answers.wheel_radius),
        )?;
        joint(&mut text, answers, 2 * wheel)?;
        joint(&mut text, answers, 2 * wheel + 1)?;
    }
    write!(
        text,
        "\n[loop]\nrate_hz = 1000 # `hbot doctor --rig FILE` says how high it can be\n\n\
         [link]\nport = {} # \"sim\", or a device such as \"/dev/ttyACM0\"\nprotocol = {protocol:?} # docs/controllers.md\n\n\
         [limits]\ntorque = {} # N m on the sphere: begin low\ntorque_rate = 20 # N m/s: begin low\nspeed = 10 # rad/s\n",
        quoted(port),
        rounded(0.2 * answers.drive.peak.min(answers.steer.peak) * answers.radius / answers.wheel_radius)
            .min(1000.0),
    )?;
    Ok(text)
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
        writeln!(
            text,
            "zero = \"assume\" # a person sets the wheels to zero before power goes on; or \"index\", \"absolute\""
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
                assert_eq!(rig.link.protocol.name(), format!("{protocol:?}").to_lowercase());
            }
        }
    }
}
