//! The rig's real serial ports.

use std::path::Path;

use hbot_config::RigConfig;

use super::StartError;
use crate::engine::Line;
use crate::handshake::{Expected, handshake};
use crate::last_word::{Program, without_core_file};
use crate::serial::{LatencyTimer, Serial, unguarded};

/// Opens the rig's serial ports, meets the controllers on them, and has them kept open and guarded.
pub(super) fn open(
    devices: &[String],
    rig: &RigConfig,
    line: &Line,
    helper: Option<&Program>,
    notices: &mut Vec<String>,
) -> Result<Vec<Serial>, StartError> {
    let open = |(port, device): (usize, &String)| {
        let mut wire = Serial::open(device, rig.link.baud)?;
        let expected = Expected::new(device, &rig.rig, line, port);
        handshake(&mut wire, &expected)?;
        if let Some(Err(error)) = helper.map(|helper| wire.guard(helper, &expected)) {
            notices.push(unguarded(device, &error));
        }
        wire.keep_open(device, rig.link.baud, expected, helper.cloned())?;
        if let Some(timer) = LatencyTimer::of(Path::new(device)).filter(|timer| timer.ms > 1) {
            notices.push(format!(
                "{device} holds readings back for {} ms: write 1 to {} (contrib/ has a udev rule)",
                timer.ms,
                timer.path.display()
            ));
        }
        Ok(wire)
    };
    if helper.is_some() {
        without_core_file();
    }
    devices.iter().enumerate().map(open).collect()
}
