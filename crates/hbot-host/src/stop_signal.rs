//! SIGUSR1: an emergency stop by signal, on a thread that does nothing else.

use std::io;

use signal_hook::consts::SIGUSR1;
use signal_hook::iterator::Signals;

use crate::bridge::EmergencyStop;
use crate::realtime::{SIMULATOR_PRIORITY, real_time};

/// Receives the signal from the moment it is made.
pub struct StopSignal(Signals);

impl StopSignal {
    /// Takes SIGUSR1 over: it no longer ends the process. One that comes before [`obey`](Self::obey) is kept for it.
    ///
    /// # Errors
    /// The system gives no descriptor.
    pub fn listen() -> io::Result<Self> {
        Signals::new([SIGUSR1]).map(Self)
    }

    /// Stops the loop at every signal from now on, on a thread of just below the loop's priority where the system allows that.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn obey(self, stop: EmergencyStop) -> io::Result<()> {
        let Self(mut signals) = self;
        let wait = move || {
            // Without the right to it the thread still sleeps until the signal comes, and is then woken before busy ones.
            let _ = real_time(SIMULATOR_PRIORITY);
            for _ in signals.forever() {
                stop.stop_by_signal();
            }
        };
        std::thread::Builder::new().name("hbot-stop".to_owned()).spawn(wait).map(drop)
    }
}
