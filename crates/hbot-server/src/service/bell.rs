//! The loop's bell, made available to async tasks.

use std::io;
use std::os::fd::OwnedFd;

use hbot_host::run_loop::bridge::Bell;
use tokio::io::unix::AsyncFd;

/// The loop's notification of new samples, in a form that async tasks can wait for. It belongs to
/// one tokio runtime.
pub(super) struct Ringing {
    bell: Bell,
    descriptor: AsyncFd<OwnedFd>,
}

impl Ringing {
    /// Makes `bell`, the loop's notification of new samples, available to async tasks.
    ///
    /// # Errors
    /// Fails if the operating system refuses a descriptor.
    ///
    /// # Panics
    /// Panics outside of a tokio runtime.
    pub(super) fn of(bell: Bell) -> io::Result<Self> {
        // The replacement of the deprecated function is unsafe, because types other than `OwnedFd`
        // can change or close their descriptor.
        #[expect(
            deprecated,
            reason = "an OwnedFd always gives the same open descriptor, which is all that new() asks"
        )]
        let descriptor = AsyncFd::new(bell.descriptor()?)?;
        Ok(Self { bell, descriptor })
    }

    /// Selects which sample triggers the next notification: any sample if `every` is true,
    /// otherwise only a notable one. See [`Bell::set`].
    pub(super) fn set(&self, every: bool) {
        self.bell.set(every);
    }

    /// Waits until the loop notifies the service of new samples. Cancel safe.
    ///
    /// # Errors
    /// Fails if the runtime shuts down.
    pub(super) async fn rung(&self) -> io::Result<()> {
        let mut guard = self.descriptor.readable().await?;
        self.bell.heard();
        guard.clear_ready();
        Ok(())
    }
}
