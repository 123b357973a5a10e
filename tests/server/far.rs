//! Motor controllers at the far end of a pseudo-terminal that record all commands. The tests of
//! hbot-server use this file too.

use std::io::{Read as _, Write as _};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hbot_config::RigConfig;
use hbot_link::{Command, Decoder, ToController};
use hbot_sim::rig::{RigConfig as SimulatedConfig, SimulatedRig};
use serialport::{SerialPort as _, TTYPort};

/// A simulated rig that records the commands it receives.
pub(crate) struct Far {
    /// Path of the port to open.
    pub(crate) path: String,
    heard: Arc<Mutex<Vec<Command>>>,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Far {
    pub(crate) fn start(rig: &RigConfig) -> Self {
        let (mut near, far) = TTYPort::pair().expect("this test needs pseudo-terminals (/dev/ptmx)");
        let path = far.name().expect("a name");
        near.set_timeout(Duration::from_millis(5)).expect("a port");
        let heard = Arc::new(Mutex::new(Vec::new()));
        let over = Arc::new(AtomicBool::new(false));
        let mut simulated = SimulatedRig::new(&SimulatedConfig::new(&rig.rig)).expect("it can be simulated");
        let (record, stop) = (Arc::clone(&heard), Arc::clone(&over));
        let thread = std::thread::spawn(move || {
            // The far end stays open as long as this thread runs, so that the near end sees no
            // hang-up.
            let _far = far;
            let mut decoder = Decoder::<ToController>::new();
            let (start, mut buffer, mut reply) = (Instant::now(), [0; 4096], Vec::new());
            while !stop.load(Ordering::Relaxed) {
                let Ok(n) = near.read(&mut buffer) else { continue };
                decoder.feed(&buffer[..n], |message| {
                    if let Ok(ToController::Command(command)) = message {
                        record.lock().expect("no panic").push(command);
                    }
                });
                reply.clear();
                simulated.receive(start.elapsed().as_nanos() as u64, &buffer[..n], &mut reply);
                // An answer that the line does not take becomes a missed reading.
                let _ = near.write(&reply);
            }
        });
        Self { path, heard, over, thread: Some(thread) }
    }

    /// Returns the number of commands received.
    pub(crate) fn count(&self) -> usize {
        self.heard.lock().expect("no panic").len()
    }

    /// Returns whether any command after the first `count` satisfies `so`.
    pub(crate) fn any_after(&self, count: usize, so: impl Fn(&Command) -> bool) -> bool {
        self.heard.lock().expect("no panic")[count..].iter().any(so)
    }

    /// Returns whether a command with torque has been received.
    pub(crate) fn pushed(&self) -> bool {
        self.any_after(0, |command| command.enable && !still(command))
    }

    /// Waits until no more commands arrive. Asserts that the last three commands are zero torque
    /// with motors off, and returns the last one.
    pub(crate) fn ends_still(mut self) -> Command {
        let mut before = 0;
        while self.count() > before {
            before = self.count();
            std::thread::sleep(Duration::from_millis(200));
        }
        self.over.store(true, Ordering::Relaxed);
        self.thread.take().expect("it runs").join().expect("no panic");
        let heard = self.heard.lock().expect("no panic");
        let last = &heard[heard.len() - 3..];
        assert!(last.iter().all(|command| !command.enable && still(command)), "{last:?}");
        last[2].clone()
    }
}

impl Drop for Far {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has already reported it.
            let _ = thread.join();
        }
    }
}

fn still(command: &Command) -> bool {
    command.torque.iter().all(|torque| *torque == 0.0)
}
