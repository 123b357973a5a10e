//! The lines of `hbot info` about the motor controllers.

use hbot_api::{Client, ClientError, ControllerInfo, ErrorCode, InfoOk};

use super::out::{foreign, tell};
use super::{orders, style};

/// Asks what the motor controllers report about themselves. Returns an empty list if the server is
/// too old to know the question.
pub(super) fn ask(client: &mut Client) -> anyhow::Result<Vec<ControllerInfo>> {
    match client.controllers() {
        Err(ClientError::Server(error)) if error.code == ErrorCode::BadRequest => Ok(Vec::new()),
        answer => answer.map_err(orders::remedied),
    }
}

/// Prints one line for each joint.
pub(super) fn print(info: &InfoOk, controllers: &[ControllerInfo]) -> anyhow::Result<()> {
    if controllers.is_empty() {
        return Ok(());
    }
    tell!("  motor controllers")?;
    for controller in controllers {
        let complaints = match controller.flags.as_slice() {
            [] => String::new(),
            flags => {
                format!("; {}complains of {}{}", style::WARN, foreign(&flags.join(", ")), style::OFF)
            }
        };
        tell!("    {:16} {}{complaints}", name(info, controller.joint), report(controller))?;
    }
    Ok(())
}

/// Returns the name of a joint: that of its wheel, and steer or drive.
fn name(info: &InfoOk, joint: u32) -> String {
    let wheel = joint / 2;
    let known = info.rig.wheels.get(wheel as usize).and_then(|wheel| wheel.name.as_deref());
    let wheel = known.map_or_else(|| wheel.to_string(), |name| foreign(name).to_string());
    format!("wheel {wheel} {}", if joint.is_multiple_of(2) { "steer" } else { "drive" })
}

/// Returns the values that a controller reports, its firmware, and where it is.
fn report(controller: &ControllerInfo) -> String {
    let text = |text: &Option<String>, unknown: &str| {
        text.as_deref().map_or_else(|| unknown.to_owned(), |text| foreign(text).to_string())
    };
    let current = controller.current_a.map(|ampere| format!("{ampere:.3} A"));
    let temperature = controller.temperature_c.map(|degrees| format!("{degrees:.1} \u{b0}C"));
    let id = controller.id.map(|id| format!(", id {id}")).unwrap_or_default();
    format!(
        "{}, {}, {} on {}{id}",
        current.unwrap_or_else(|| "current not reported".to_owned()),
        temperature.unwrap_or_else(|| "temperature not reported".to_owned()),
        text(&controller.firmware, "unknown firmware"),
        text(&controller.port, "an unknown port"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_api::{RigInfo, WheelInfo};

    #[test]
    fn a_controller_is_described_with_what_it_reports_and_what_it_does_not() {
        let full = ControllerInfo {
            port: Some("/dev/ttyACM0".to_owned()),
            id: Some(3),
            firmware: Some("moteus 0x010f".to_owned()),
            current_a: Some(-0.5),
            temperature_c: Some(31.5),
            ..ControllerInfo::default()
        };
        assert_eq!(report(&full), "-0.500 A, 31.5 \u{b0}C, moteus 0x010f on /dev/ttyACM0, id 3");
        let none = "current not reported, temperature not reported, unknown firmware on an unknown port";
        assert_eq!(report(&ControllerInfo::default()), none);
    }

    #[test]
    fn a_joint_has_the_name_of_its_wheel() {
        let wheels =
            vec![WheelInfo { name: Some("left".to_owned()), ..WheelInfo::default() }, WheelInfo::default()];
        let info = InfoOk { rig: RigInfo { wheels, ..RigInfo::default() }, ..InfoOk::default() };
        let names: Vec<String> = (0..4).map(|joint| name(&info, joint)).collect();
        assert_eq!(names, ["wheel left steer", "wheel left drive", "wheel 1 steer", "wheel 1 drive"]);
    }
}
