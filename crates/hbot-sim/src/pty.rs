//! Serves a simulated rig over a pseudo-terminal, like a serial port, in wall time.
//!
//! The other end of the line is a path that a server opens like a real port.

use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::rig::SimulatedRig;
use crate::served::{self, IDLE, ServeError, ServedRig};

mod line;

use line::Line;

/// Options of the thread that serves a simulated rig on a pseudo-terminal.
pub struct PtyOptions {
    /// Longest time between two updates of the plant while no bytes arrive on the line. The default
    /// is 2 ms.
    pub idle: Duration,
    /// Function that the thread calls when it starts, for example to set its scheduling priority.
    /// The default does nothing.
    pub on_start: Box<dyn FnOnce() + Send>,
}

impl Default for PtyOptions {
    fn default() -> Self {
        Self { idle: IDLE, on_start: Box::new(|| ()) }
    }
}

impl std::fmt::Debug for PtyOptions {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PtyOptions").field("idle", &self.idle).finish_non_exhaustive()
    }
}

/// A simulated rig behind a pseudo-terminal. Dropping this value stops its thread and removes the
/// port.
#[derive(Debug)]
pub struct PtyRig {
    path: PathBuf,
    served: ServedRig,
}

/// Serves `rig` on a new pseudo-terminal, from a thread named `hbot-sim`, until the returned
/// [`PtyRig`] is stopped or dropped.
///
/// # Errors
/// Fails if the machine provides no pseudo-terminal or the thread cannot be started.
pub fn spawn_pty(rig: SimulatedRig, options: PtyOptions) -> Result<PtyRig, ServeError> {
    let (line, path) = Line::open().map_err(|errno| ServeError::NoPty(errno.into()))?;
    serve(rig, line, path, options)
}

fn serve(rig: SimulatedRig, line: Line, path: PathBuf, options: PtyOptions) -> Result<PtyRig, ServeError> {
    let served = served::serve(rig, line, options.idle, options.on_start)?;
    Ok(PtyRig { path, served })
}

impl PtyRig {
    /// Returns the path of the port to open, such as `/dev/pts/3`. The port can be closed and
    /// opened again.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the rig that the thread serves. The port remains as long as this value exists.
    #[must_use]
    pub fn into_served(self) -> ServedRig {
        self.served
    }

    /// Stops the thread and returns the rig in its last state.
    ///
    /// # Errors
    /// Fails with the error that ended the thread earlier, if any.
    pub fn stop(self) -> Result<SimulatedRig, ServeError> {
        self.served.stop()
    }
}

impl Deref for PtyRig {
    type Target = ServedRig;

    fn deref(&self) -> &ServedRig {
        &self.served
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::SimulatedConfig;
    use hbot_testing::patience::eventually;
    use rustix::fs::{Mode, OFlags};
    use rustix::time::{ClockId, clock_gettime};

    // Not that of hbot-testing, whose simulated rig is of the library that this test replaces.
    fn rig() -> SimulatedRig {
        SimulatedRig::new(&SimulatedConfig::new(&hbot_config::RigConfig::prototype().rig)).unwrap()
    }

    /// A rig is served again after its line hangs up, which happens here whenever no program has
    /// the port open. While the line is hung up, the thread neither ends nor spins.
    #[test]
    fn a_line_that_hangs_up_is_served_again() {
        let (mut line, path) = Line::open().unwrap();
        line.far = rustix::fs::open("/dev/null", OFlags::RDWR, Mode::empty()).unwrap();
        let rig = serve(rig(), line, path, PtyOptions::default()).unwrap();
        for opened in 0..3 {
            let busy = || rig.call(|_| clock_gettime(ClockId::ThreadCPUTime)).unwrap();
            let before = busy();
            // What is measured is the processor time of a while in which nothing happens.
            std::thread::sleep(Duration::from_millis(100));
            let spent = busy() - before;
            assert!(spent.tv_sec == 0 && spent.tv_nsec < 50_000_000, "{spent:?} of 100 ms");

            let far = rustix::fs::open(rig.path(), OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
            // Two zeros and a byte: an empty frame, and a frame that is refused.
            rustix::io::write(&far, &[0, 1, 0]).unwrap();
            eventually("a frame is refused", || rig.call(|rig| rig.refused_frames()).unwrap() > opened);
        }
        rig.stop().unwrap();
    }
}
