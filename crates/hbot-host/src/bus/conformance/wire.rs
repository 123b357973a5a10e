//! The line between a bus and its virtual controllers, with the disturbances that the suite causes
//! on it.

use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::{Controllers, PERIOD_NS};
use crate::line::{Line, Renewed};

/// The bus's end of the line to its virtual controllers.
pub(super) struct Wire(Arc<Mutex<Middle>>);

/// The test suite's access to the line, used to disturb it.
#[derive(Clone)]
pub(super) struct Tap(Arc<Mutex<Middle>>);

/// A function that disturbs the line: it replaces an answer of the controllers by pieces, each with
/// a delay in ticks.
pub(super) type Fate = Box<dyn FnMut(Vec<u8>) -> Vec<(u32, Vec<u8>)> + Send>;

/// The state of the line between its two ends.
pub(super) struct Middle {
    controllers: Box<dyn Controllers>,
    /// Bytes on their way to the bus, in pieces. Each piece has the time from which it can be read,
    /// ns.
    pieces: Vec<(u64, Vec<u8>)>,
    /// The function that disturbs the answers of the controllers. With `None`, answers arrive
    /// whole.
    pub(super) fate: Option<Fate>,
    /// Largest number of bytes that the line accepts in one write. With `None`, it accepts all.
    pub(super) takes: Option<usize>,
    /// True while the line is lost, so that reads and writes fail.
    pub(super) gone: bool,
    /// Report to the bus that the line has been reopened, if the bus has not read it yet.
    pub(super) renewed: Option<Renewed>,
    /// If set, collects the bytes that the bus writes, instead of passing them to the controllers.
    pub(super) diverted: Option<Vec<u8>>,
    /// Time of the controllers at which the host's clock last started again from 0, in ns. The
    /// host's bring-up has its own clock.
    base_ns: u64,
    /// Last time of the host's clock, in ns.
    last_ns: u64,
    /// True during bring-up, before the first tick. Answers can then be read at once.
    meeting: bool,
}

impl Wire {
    pub(super) fn new(controllers: Box<dyn Controllers>) -> (Self, Tap) {
        let middle = Arc::new(Mutex::new(Middle {
            controllers,
            pieces: Vec::new(),
            fate: None,
            takes: None,
            gone: false,
            renewed: None,
            diverted: None,
            base_ns: 0,
            last_ns: 0,
            meeting: true,
        }));
        (Self(Arc::clone(&middle)), Tap(middle))
    }
}

impl Tap {
    /// Returns another end of the line for the host, like the one that the thread reopening a lost
    /// line uses.
    pub(super) fn wire(&self) -> Wire {
        held(&self.0).meeting = true;
        Wire(Arc::clone(&self.0))
    }

    /// Locks the line, so that a case can disturb it.
    pub(super) fn line(&self) -> MutexGuard<'_, Middle> {
        held(&self.0)
    }

    pub(super) fn controllers<T>(&self, with: impl FnOnce(&mut dyn Controllers) -> T) -> T {
        with(held(&self.0).controllers.as_mut())
    }

    /// Ends the bring-up of the controllers. From now on the times that the bus passes count from
    /// the start of its loop.
    pub(super) fn begin(&self) {
        let middle = &mut *held(&self.0);
        middle.meeting = false;
        middle.pieces.clear();
    }

    /// Returns the torque of each motor at the host's time `now_ns`, in N m.
    pub(super) fn torque(&self, now_ns: u64) -> Vec<f64> {
        let middle = &mut *held(&self.0);
        let now_ns = middle.time(now_ns);
        middle.controllers.torque(now_ns)
    }

    /// Sends bytes to the bus, which reads them in the next tick.
    pub(super) fn say(&self, bytes: Vec<u8>) {
        held(&self.0).pieces.push((0, bytes));
    }

    /// Removes all bytes that are on their way to the bus, and returns them.
    pub(super) fn take(&self) -> Vec<u8> {
        held(&self.0).pieces.drain(..).flat_map(|(_, bytes)| bytes).collect()
    }

    /// Sends `bytes` to the controllers as another sender on the line would. The answer goes to the
    /// bus.
    pub(super) fn write(&self, now_ns: u64, bytes: &[u8]) {
        held(&self.0).reach(now_ns, bytes);
    }
}

fn held(middle: &Mutex<Middle>) -> MutexGuard<'_, Middle> {
    middle.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Middle {
    /// Converts the host's time to the controllers' time, in ns.
    fn time(&mut self, now_ns: u64) -> u64 {
        if now_ns < self.last_ns {
            self.base_ns += self.last_ns;
        }
        self.last_ns = now_ns;
        self.base_ns + now_ns
    }

    fn reach(&mut self, now_ns: u64, bytes: &[u8]) {
        let mut answer = Vec::new();
        let time_ns = self.time(now_ns);
        self.controllers.hear(time_ns, bytes, &mut answer);
        if answer.is_empty() {
            return;
        }
        // The next tick is the first that can read it.
        let due = |later: u32| now_ns + u64::from(1 + later) * PERIOD_NS;
        match &mut self.fate {
            None => self.pieces.push((due(0), answer)),
            Some(fate) => {
                self.pieces.extend(fate(answer).into_iter().map(|(later, piece)| (due(later), piece)));
            }
        }
    }
}

impl Line for Wire {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> io::Result<usize> {
        let mut middle = held(&self.0);
        if middle.gone {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        // What they say unasked.
        middle.reach(now_ns, &[]);
        let meeting = middle.meeting;
        let mut n = 0;
        for (_, piece) in middle.pieces.iter_mut().filter(|(due_ns, _)| meeting || *due_ns <= now_ns) {
            let part = piece.len().min(buffer.len() - n);
            buffer[n..n + part].copy_from_slice(&piece[..part]);
            piece.drain(..part);
            n += part;
        }
        middle.pieces.retain(|(_, piece)| !piece.is_empty());
        Ok(n)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> io::Result<usize> {
        let mut middle = held(&self.0);
        if middle.gone {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let n = middle.takes.map_or(bytes.len(), |most| most.min(bytes.len()));
        match &mut middle.diverted {
            Some(kept) => kept.extend_from_slice(&bytes[..n]),
            None if n > 0 => middle.reach(now_ns, &bytes[..n]),
            None => {}
        }
        Ok(n)
    }

    fn pause(&mut self) {}

    fn renewed(&mut self) -> Option<Renewed> {
        held(&self.0).renewed.take()
    }
}
