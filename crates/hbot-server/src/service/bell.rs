//! The loop's bell on the service's runtime.

use std::io;
use std::os::fd::OwnedFd;

use hbot_host::bridge::Bell;
use tokio::io::unix::AsyncFd;

/// A bell that can be waited for. It belongs to a tokio runtime.
pub(super) struct Ringing {
    bell: Bell,
    descriptor: AsyncFd<OwnedFd>,
}

impl Ringing {
    /// Waits for `bell`.
    ///
    /// # Errors
    /// The system gives no descriptor, or there is no runtime.
    pub(super) fn of(bell: Bell) -> io::Result<Self> {
        // Its successor is an unsafe function, because other types than OwnedFd may change or close
        // their descriptor.
        #[expect(
            deprecated,
            reason = "an OwnedFd always gives the same open descriptor, which is all that new() asks"
        )]
        let descriptor = AsyncFd::new(bell.descriptor()?)?;
        Ok(Self { bell, descriptor })
    }

    /// See [`Bell::set`].
    pub(super) fn set(&self, every: bool) {
        self.bell.set(every);
    }

    /// Waits until it rings. Cancel safe.
    ///
    /// # Errors
    /// The runtime shuts down.
    pub(super) async fn rung(&self) -> io::Result<()> {
        let mut guard = self.descriptor.readable().await?;
        self.bell.heard();
        guard.clear_ready();
        Ok(())
    }
}
