//! Opens, reads and writes a pseudo-terminal.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::PathBuf;

use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, ioctl_tiocnxcl, tcgetattr, tcsetattr};

use crate::served::End;

/// Both ends of a pseudo-terminal. The far end is the port that other programs open. It is also
/// kept open here, so that the near end gets no hang-up while no other program has the port open.
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
        // Raw mode: no echo, no line buffering, no signals, even if the program that opens the port
        // does not ask for it.
        let mut settings = tcgetattr(&far)?;
        settings.make_raw();
        tcsetattr(&far, OptionalActions::Now, &settings)?;
        rustix::io::ioctl_fionbio(&near, true)?;
        Ok((Self { near, far }, path.into()))
    }
}

impl End for Line {
    fn descriptor(&self) -> BorrowedFd<'_> {
        self.near.as_fd()
    }

    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Errno> {
        match rustix::io::read(&self.near, buffer) {
            Ok(count) => Ok(count),
            // EIO means hung up. The line is then silent until a program opens it again.
            Err(Errno::AGAIN | Errno::INTR | Errno::IO) => Ok(0),
            Err(errno) => Err(errno),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Errno> {
        match rustix::io::write(&self.near, bytes) {
            Ok(_) | Err(Errno::AGAIN | Errno::INTR | Errno::IO) => Ok(()),
            Err(errno) => Err(errno),
        }
    }

    /// Ends exclusive use of the far end (the port), so that other programs can open it again.
    ///
    /// Exclusive use outlasts the program that asked for it, as long as any program has the port
    /// open. This process always has it open.
    fn idle(&mut self) {
        // If this fails, the port was not locked.
        let _ = ioctl_tiocnxcl(&self.far);
    }
}
