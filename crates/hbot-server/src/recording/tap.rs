//! The loop's half of a recorder: it copies each tick into a ring, and never waits.

use hbot_core::{Controller, Inputs, Outputs};
use hbot_host::run_loop::engine::Ticked;
use hbot_host::run_loop::sample::TickTiming;
use rtrb::{Consumer, Producer, PushError, RingBuffer};

/// Number of ticks that can wait for the recorder's thread: one second at 4 kHz.
pub(super) const ENTRIES: usize = 4096;
/// Number of copies of the controller that can be requested at a time.
const BLANKS: usize = 2;

/// One tick, on its way from the loop to the recorder's thread.
#[derive(Clone)]
pub(super) struct Entry {
    pub(super) inputs: Inputs,
    pub(super) outputs: Outputs,
    /// Nominal time of the tick since the start of the loop, ns.
    pub(super) t_ns: u64,
    /// Revision of the scene that was rendered.
    pub(super) scene: u64,
    pub(super) timing: TickTiming,
    /// State of the control law after the tick, if the recorder's thread has requested it.
    pub(super) controller: Option<Box<Controller>>,
    /// Number of ticks that were dropped until now because the ring was full.
    pub(super) lost: u64,
}

/// The loop's half of a recorder.
pub(super) struct Tap {
    entries: Producer<Entry>,
    /// Memory for copies of the controller. Each is a request for one copy.
    blanks: Consumer<Box<Controller>>,
    /// Memory whose entry found no room in the ring.
    blank: Option<Box<Controller>>,
    lost: u64,
    /// Whether the loop waits for room in the ring. It does so in virtual time only.
    waits: bool,
}

/// The other half of a [`Tap`], for the recorder's thread.
pub(super) struct Drain {
    pub(super) entries: Consumer<Entry>,
    blanks: Producer<Box<Controller>>,
}

/// Creates both halves. Allocates all memory that the loop needs.
pub(super) fn tap(waits: bool) -> (Tap, Drain) {
    let (entries_in, entries) = RingBuffer::new(ENTRIES);
    let (blanks, blanks_out) = RingBuffer::new(BLANKS);
    (Tap { entries: entries_in, blanks: blanks_out, blank: None, lost: 0, waits }, Drain { entries, blanks })
}

impl Tap {
    /// Copies a tick into the ring, or counts it as lost if the ring is full.
    pub(super) fn take(&mut self, ticked: &Ticked<'_>) {
        let blank = self.blank.take().or_else(|| self.blanks.pop().ok());
        let controller = blank.map(|mut blank| {
            Controller::clone_from(&mut blank, ticked.controller);
            blank
        });
        let mut entry = Entry {
            inputs: *ticked.inputs,
            outputs: *ticked.outputs,
            t_ns: ticked.sample.t_ns,
            scene: ticked.sample.scene,
            timing: ticked.sample.timing,
            controller,
            lost: self.lost,
        };
        while let Err(PushError::Full(back)) = self.entries.push(entry) {
            if !self.waits || self.entries.is_abandoned() {
                self.lost += 1;
                // The memory must not be freed in the loop.
                self.blank = back.controller;
                return;
            }
            std::thread::yield_now();
            entry = back;
        }
    }
}

impl Drain {
    /// Requests a copy of the controller. It arrives with a later entry.
    pub(super) fn request(&mut self, blank: Box<Controller>) {
        // If the ring is full, enough copies are on their way.
        let _ = self.blanks.push(blank);
    }
}
