//! Which motor controllers move the joints of a rig: their ports, protocols, ids and firmware.

use hbot_config::rig::Protocol;

use crate::bus::Expected;

/// The motor controllers of all joints of a rig. The names of their firmware are those that were
/// found when each line was opened last.
#[derive(Debug, Clone, Default)]
pub struct Controllers {
    /// The protocol of all lines. `None` if the motor buses were given by the program.
    protocol: Option<Protocol>,
    /// The controllers on each line.
    lines: Vec<Expected>,
}

/// The motor controller of one joint. A value is `None` if it is not known.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct JointController {
    /// Name of the port that leads to the controller.
    pub port: Option<String>,
    /// Protocol of the controller.
    pub protocol: Option<Protocol>,
    /// Id of the controller on its line. Also `None` if the protocol has no ids.
    pub id: Option<u8>,
    /// Name and version of the controller's firmware.
    pub firmware: Option<String>,
}

impl Controllers {
    /// Creates the list of the controllers on `lines`, which all use `protocol`.
    #[must_use]
    pub fn new(protocol: Protocol, lines: Vec<Expected>) -> Self {
        Self { protocol: Some(protocol), lines }
    }

    /// Returns what is known of the controller of a joint. `joint` is its number in the rig, from
    /// 0.
    #[must_use]
    pub fn of(&self, joint: usize) -> JointController {
        let place = |line: &Expected| {
            let at = (0..line.joints()).find(|at| line.joint(*at).is_some_and(|it| it.number == joint))?;
            Some(JointController {
                port: Some(line.port().to_owned()),
                protocol: self.protocol,
                id: line
                    .joint(at)
                    .filter(|_| self.protocol.is_some_and(|it| it.ids().is_some()))
                    .map(|it| it.id),
                firmware: line.firmware(at),
            })
        };
        self.lines.iter().find_map(place).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::layout::{JointPlace, Layout};

    /// Two lines have two joints each. Those of the second line are in the opposite order.
    #[test]
    fn each_joint_has_the_controller_at_its_place_on_its_line() {
        let place = |bus, at, id| JointPlace { bus, at, id };
        let places = vec![place(0, 0, 5), place(0, 1, 9), place(1, 1, 8), place(1, 0, 7)];
        let layout = Layout { places, ..Layout::single([]) };
        let rig = hbot_config::RigConfig::prototype().rig;
        let lines = [("one", 0), ("two", 1)].map(|(port, bus)| Expected::new(port, &rig, &layout, bus));
        let vendors = Controllers::new(Protocol::Moteus, lines.to_vec());
        // The firmware becomes known later, when the line is opened.
        lines[1].set_firmware(1, "new".to_owned());
        let controller = |port: &str, id, firmware: Option<&str>| JointController {
            port: Some(port.to_owned()),
            protocol: Some(Protocol::Moteus),
            id: Some(id),
            firmware: firmware.map(str::to_owned),
        };
        let told: Vec<_> = (0..5).map(|joint| vendors.of(joint)).collect();
        let expected = [
            controller("one", 5, None),
            controller("one", 9, None),
            controller("two", 8, Some("new")),
            controller("two", 7, None),
            JointController::default(),
        ];
        assert_eq!(told, expected);
        // Controllers of hbot's own protocol have no ids.
        let own = Controllers::new(Protocol::Hbot, lines.to_vec());
        let without =
            JointController { protocol: Some(Protocol::Hbot), id: None, ..controller("two", 0, Some("new")) };
        assert_eq!((own.of(2), Controllers::default().of(2)), (without, JointController::default()));
    }
}
