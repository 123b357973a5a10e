//! An emergency stop by the signal SIGUSR1, handled by a thread that does nothing else.

use std::io;

use signal_hook::consts::SIGUSR1;
use signal_hook::iterator::Signals;

use crate::run_loop::bridge::EmergencyStop;
use crate::run_loop::realtime::{SIMULATOR_PRIORITY, real_time};

/// A receiver of the signal SIGUSR1, which requests an emergency stop. It receives signals from the
/// moment it is created.
pub struct StopSignal(Signals);

impl StopSignal {
    /// Starts to receive SIGUSR1, which no longer ends the process. A signal that arrives before
    /// [`obey`](Self::obey) is called takes effect when it is called.
    ///
    /// # Errors
    /// Fails if the system provides no file descriptor.
    pub fn listen() -> io::Result<Self> {
        Signals::new([SIGUSR1]).map(Self)
    }

    /// Starts a thread that triggers `stop` at every SIGUSR1. The thread runs just below the loop's
    /// priority if the system allows it.
    ///
    /// # Errors
    /// Fails if the system cannot start a thread.
    pub fn obey(self, stop: EmergencyStop) -> io::Result<()> {
        let Self(mut signals) = self;
        let wait = move || {
            // Without real-time priority the stop still works: the thread sleeps until the signal
            // arrives, and a thread that has slept is scheduled before busy ones.
            let _ = real_time(SIMULATOR_PRIORITY);
            for _ in signals.forever() {
                stop.stop_by_signal();
            }
        };
        std::thread::Builder::new().name("hbot-stop".to_owned()).spawn(wait).map(drop)
    }
}
