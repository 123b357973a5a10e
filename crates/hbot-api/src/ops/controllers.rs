//! The op `controllers`.

use super::{Op, OpRow, Who};
use crate::names::names;
use crate::{Client, ClientError, finite};
use serde::{Deserialize, Serialize};

pub(super) const ROW: OpRow = OpRow::new(Who::Any, &[]).weighing(100);

/// The answer to the op `controllers`, with which a client asks what the motor controllers report
/// about themselves.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ControllersOk {
    /// The motor controller of each joint, in the order of the joints in state messages.
    pub controllers: Vec<ControllerInfo>,
}

/// The motor controller of one joint. A field that the server does not send is read as its default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ControllerInfo {
    /// Number of the joint, from 0: its place in the list of joints of a state message.
    pub joint: u32,
    /// Name of the port that leads to the controller. `None` if it is not known.
    pub port: Option<String>,
    /// Protocol of the controller, as a rig file names it. `None` if it is not known.
    pub protocol: Option<String>,
    /// Id of the controller on its line. `None` if the protocol has no ids.
    pub id: Option<u32>,
    /// Name and version of the controller's firmware, as found when its line was last opened.
    /// `None` if it is not known.
    pub firmware: Option<String>,
    /// Motor current that makes torque, A. A positive current drives the joint in its positive
    /// direction. `None` if the controller does not report it.
    #[serde(serialize_with = "finite::optional")]
    pub current_a: Option<f64>,
    /// The highest temperature that the controller reports, °C: of the motor or of the power stage.
    /// `None` if it reports none.
    #[serde(serialize_with = "finite::optional")]
    pub temperature_c: Option<f64>,
    /// What the controller complains of now: names of [`ControllerFlag`]. A later server can send
    /// names that this version does not know.
    pub flags: Vec<String>,
}

names! {
    /// What is wrong with a motor controller.
    pub enum ControllerFlag {
        /// The controller reports that it has a fault.
        Fault = "fault": "The controller reports that it has a fault.",
        /// Its watchdog has expired, because no command arrived in time.
        Watchdog = "watchdog": "Its watchdog has expired: no command arrived in time.",
        /// The motor's current is at its limit or beyond it.
        Overcurrent = "overcurrent": "The motor's current is at its limit or beyond it.",
        /// The motor or the power stage is too hot.
        Overtemperature = "overtemperature": "The motor or the power stage is too hot.",
        /// The motor is on although it was commanded off, or off although it was commanded on.
        Disobeyed = "disobeyed": "The motor is on although it was commanded off, or off although it was commanded on.",
        /// It has reported a value that is not a finite number.
        NotFinite = "not_finite": "It has reported a value that is not a finite number.",
        /// It may have lost power within the last 5 s, and with it the zero of its joint.
        Restarted = "restarted": "It may have lost power, and with it the zero of its joint.",
        /// Nothing has arrived from it for 0.2 s.
        Silent = "silent": "Nothing has arrived from it for 0.2 s.",
    }

    /// Returns an explanation of this complaint, for the person who uses the rig.
    fn sentence() -> &'static str;
}

impl Client {
    /// Asks what the motor controller of each joint reports about itself. The result has the order
    /// of the joints in state messages.
    pub fn controllers(&mut self) -> Result<Vec<ControllerInfo>, ClientError> {
        let answer: ControllersOk = self.ask(Op::Controllers)?;
        Ok(answer.controllers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn each_complaint_is_explained_in_its_own_words() {
        let sentences: BTreeSet<_> = ControllerFlag::ALL.iter().map(|flag| flag.sentence()).collect();
        assert_eq!(sentences.len(), ControllerFlag::ALL.len());
    }
}
