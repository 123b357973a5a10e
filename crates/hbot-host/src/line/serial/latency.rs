//! The latency timer of a USB serial chip, which holds received bytes back.

use std::fs;
use std::path::{Path, PathBuf};

/// The latency to which FTDI chips are set, ms. Their default of 16 ms would delay a reading by 16
/// ticks at 1 kHz.
const LATENCY_MS: u32 = 1;

/// The latency timer of a USB serial chip: how long the chip waits for more bytes before it passes
/// on what it has received. FTDI chips have one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LatencyTimer {
    /// The system file through which the timer is read and set.
    pub path: PathBuf,
    /// The current latency, ms.
    pub ms: u32,
}

impl LatencyTimer {
    /// Returns the latency timer of the device behind `port`, or `None` if its driver has none.
    #[must_use]
    pub fn of(port: &Path) -> Option<Self> {
        Self::listed(Path::new("/sys/class/tty"), port)
    }

    fn listed(devices: &Path, port: &Path) -> Option<Self> {
        let device = fs::canonicalize(port).ok()?;
        let path = devices.join(device.file_name()?).join("device/latency_timer");
        let ms = fs::read_to_string(&path).ok()?.trim().parse().ok()?;
        Some(Self { path, ms })
    }

    /// Sets the timer to 1 ms. If this program is not allowed to write the timer's file, the timer
    /// does not change, and `hbot doctor` reports this.
    pub(super) fn shorten(&self) {
        if self.ms > LATENCY_MS {
            let _ = fs::write(&self.path, LATENCY_MS.to_string());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chip_that_holds_readings_back_is_asked_not_to() {
        let folder = tempfile::tempdir().unwrap();
        let (devices, port) = (folder.path().join("tty"), folder.path().join("ttyUSB7"));
        fs::create_dir_all(devices.join("ttyUSB7/device")).unwrap();
        fs::write(&port, "").unwrap();
        // The device is found by its real name, even if `port` is a symbolic link to it.
        let link = folder.path().join("hbot");
        std::os::unix::fs::symlink(&port, &link).unwrap();
        assert_eq!(LatencyTimer::listed(&devices, &link), None, "a driver that has none");
        let file = devices.join("ttyUSB7/device/latency_timer");
        for (was, is) in [("16\n", "1"), ("1\n", "1\n"), ("0\n", "0\n")] {
            fs::write(&file, was).unwrap();
            LatencyTimer::listed(&devices, &link).unwrap().shorten();
            assert_eq!(fs::read_to_string(&file).unwrap(), is, "from {was:?}");
        }
    }
}
