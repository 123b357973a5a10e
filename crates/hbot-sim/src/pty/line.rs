//! The pseudo-terminal itself.

use std::os::fd::OwnedFd;
use std::path::PathBuf;

use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, ioctl_tiocnxcl, tcgetattr, tcsetattr};

/// Both ends of a pseudo-terminal. The far one is kept open so that the near one hears no hang-up while nobody else
/// has it open.
pub(super) struct Line {
    pub(super) near: OwnedFd,
    pub(super) far: OwnedFd,
}

impl Line {
    pub(super) fn open() -> Result<(Self, PathBuf), Errno> {
        let near = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&near)?;
        unlockpt(&near)?;
        let path = ptsname(&near, Vec::new())?.into_string().map_err(|_| Errno::ILSEQ)?;
        let far = rustix::fs::open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
        // Bytes as they are: no echo, no lines, no signals, whether or not the one who opens it says so.
        let mut settings = tcgetattr(&far)?;
        settings.make_raw();
        tcsetattr(&far, OptionalActions::Now, &settings)?;
        rustix::io::ioctl_fionbio(&near, true)?;
        Ok((Self { near, far }, path.into()))
    }

    /// Some bytes, if any have arrived.
    pub(super) fn read(&self, buffer: &mut [u8]) -> Result<usize, Errno> {
        match rustix::io::read(&self.near, buffer) {
            Ok(count) => Ok(count),
            // Hung up (EIO): as good as silent until someone opens it again.
            Err(Errno::AGAIN | Errno::INTR | Errno::IO) => Ok(0),
            Err(errno) => Err(errno),
        }
    }

    /// All bytes in one call, or as many as there is room for: a line that nobody reads loses bytes.
    pub(super) fn write(&self, bytes: &[u8]) -> Result<(), Errno> {
        match rustix::io::write(&self.near, bytes) {
            Ok(_) | Err(Errno::AGAIN | Errno::INTR | Errno::IO) => Ok(()),
            Err(errno) => Err(errno),
        }
    }

    /// Lets others open the far end again. A program that opens a serial port for itself alone and then closes it
    /// leaves it barred for as long as anyone has it open, which here is always.
    pub(super) fn unbar(&self) {
        // Where it does not work, nothing was barred.
        let _ = ioctl_tiocnxcl(&self.far);
    }
}
