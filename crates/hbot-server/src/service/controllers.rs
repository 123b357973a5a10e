//! The answer to `controllers`: what the motor controllers report about themselves.

use hbot_api::{ControllerFlag, ControllerInfo, ControllersOk};
use hbot_core::{MAX_JOINTS, Rig};
use hbot_host::bus::Telemetry;
use hbot_host::rig::controllers::{Controllers, JointController};

/// Returns the answer. `telemetry` is what the controller of each joint last reported.
pub(super) fn answer(
    rig: &Rig,
    controllers: &Controllers,
    telemetry: &[Telemetry; MAX_JOINTS],
) -> ControllersOk {
    let one = |joint: usize| {
        let telemetry = telemetry[joint];
        let JointController { port, protocol, id, firmware } = controllers.of(joint);
        // A controller can count in the opposite direction to its joint.
        let sign = if rig.joints[joint].reversed { -1.0 } else { 1.0 };
        ControllerInfo {
            joint: joint as u32,
            port,
            protocol: protocol.map(|protocol| protocol.name().to_owned()),
            id: id.map(u32::from),
            firmware,
            // Adding 0 turns a negative zero into a positive one.
            current_a: telemetry.current.map(|current| sign * thousandths(current) + 0.0),
            temperature_c: telemetry.temperature.map(thousandths),
            flags: flags(&telemetry).map(|flag| flag.to_string()).collect(),
        }
    };
    ControllersOk { controllers: (0..rig.device.joints()).map(one).collect() }
}

/// Rounds a value to thousandths, so that single precision adds no digits that mean nothing.
fn thousandths(value: f32) -> f64 {
    (f64::from(value) * 1e3).round() / 1e3
}

/// Returns what is wrong with a controller, in the order of the documentation.
fn flags(telemetry: &Telemetry) -> impl Iterator<Item = ControllerFlag> + use<> {
    let Telemetry { complaints, restarted, silent, .. } = *telemetry;
    ControllerFlag::ALL.into_iter().filter(move |flag| match flag {
        ControllerFlag::Fault => complaints.fault,
        ControllerFlag::Watchdog => complaints.watchdog,
        ControllerFlag::Overcurrent => complaints.overcurrent,
        ControllerFlag::Overtemperature => complaints.overtemperature,
        ControllerFlag::Disobeyed => complaints.disobeyed,
        ControllerFlag::NotFinite => complaints.not_finite,
        ControllerFlag::Restarted => restarted,
        ControllerFlag::Silent => silent,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_config::RigConfig;
    use hbot_core::inputs::Complaints;

    #[test]
    fn each_joint_has_its_values_with_the_sign_of_the_joint() {
        let rig = RigConfig::prototype().rig.with(|parts| {
            (parts.joints[0].reversed, parts.joints[1].reversed) = (false, true);
        });
        let rig = rig.expect("legal");
        let mut telemetry = [Telemetry::default(); MAX_JOINTS];
        telemetry[0] = Telemetry { current: Some(0.1), ..Telemetry::default() };
        let complaints = Complaints { overtemperature: true, fault: true, ..Complaints::default() };
        telemetry[1] = Telemetry {
            current: Some(0.1),
            temperature: Some(31.25),
            complaints,
            silent: true,
            ..Telemetry::default()
        };
        let told = answer(&rig, &Controllers::default(), &telemetry).controllers;
        let joints: Vec<u32> = told.iter().map(|it| it.joint).collect();
        assert_eq!(joints, [0, 1, 2, 3]);
        assert_eq!((told[0].current_a, told[0].temperature_c), (Some(0.1), None));
        assert_eq!((told[1].current_a, told[1].temperature_c), (Some(-0.1), Some(31.25)));
        assert_eq!(told[1].flags, ["fault", "overtemperature", "silent"]);
        assert!(
            told[0].flags.is_empty() && told[2] == ControllerInfo { joint: 2, ..ControllerInfo::default() }
        );
    }

    #[test]
    fn each_flag_follows_from_one_report() {
        let none = Complaints::default();
        let of = |complaints| Telemetry { complaints, ..Telemetry::default() };
        let cases = [
            (of(Complaints { fault: true, ..none }), "fault"),
            (of(Complaints { watchdog: true, ..none }), "watchdog"),
            (of(Complaints { overcurrent: true, ..none }), "overcurrent"),
            (of(Complaints { overtemperature: true, ..none }), "overtemperature"),
            (of(Complaints { disobeyed: true, ..none }), "disobeyed"),
            (of(Complaints { not_finite: true, ..none }), "not_finite"),
            (Telemetry { restarted: true, ..Telemetry::default() }, "restarted"),
            (Telemetry { silent: true, ..Telemetry::default() }, "silent"),
        ];
        assert_eq!(cases.len(), ControllerFlag::ALL.len());
        for (telemetry, flag) in cases {
            let told: Vec<String> = flags(&telemetry).map(|flag| flag.to_string()).collect();
            assert_eq!(told, [flag]);
        }
    }
}
