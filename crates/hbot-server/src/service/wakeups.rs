//! The loop's wake-ups of the service, made available to async tasks.

use std::io;
use std::os::fd::OwnedFd;

use hbot_host::run_loop::bridge::Wakeup;
use tokio::io::unix::AsyncFd;

/// The loop's notification of new samples, in a form that async tasks can wait for. It belongs to
/// one tokio runtime.
pub(super) struct Wakeups {
    wakeup: Wakeup,
    descriptor: AsyncFd<OwnedFd>,
}

impl Wakeups {
    /// Makes `wakeup`, the loop's notification of new samples, available to async tasks.
    ///
    /// # Errors
    /// Fails if the operating system refuses a descriptor.
    ///
    /// # Panics
    /// Panics outside of a tokio runtime.
    pub(super) fn of(wakeup: Wakeup) -> io::Result<Self> {
        // The replacement of the deprecated function is unsafe, because types other than `OwnedFd`
        // can change or close their descriptor.
        #[expect(
            deprecated,
            reason = "an OwnedFd always gives the same open descriptor, which is all that new() asks"
        )]
        let descriptor = AsyncFd::new(wakeup.descriptor()?)?;
        Ok(Self { wakeup, descriptor })
    }

    /// Selects which sample triggers the next notification: any sample if `every` is true,
    /// otherwise only a notable one. See [`Wakeup::arm`].
    pub(super) fn arm(&self, every: bool) {
        self.wakeup.arm(every);
    }

    /// Waits until the loop notifies the service of new samples. Cancel safe.
    ///
    /// # Errors
    /// Fails if the runtime shuts down.
    pub(super) async fn wait(&self) -> io::Result<()> {
        let mut guard = self.descriptor.readable().await?;
        self.wakeup.clear();
        guard.clear_ready();
        Ok(())
    }
}
