//! What a bad line does to the bytes on it: frames late, lost, damaged ([`Link`]).
//!
//! It works on frames (everything up to the byte that ends one in the protocol of the line), knows nothing of what is in
//! them, and reorders nothing within a direction. A frame begun is kept until its end has come. Its memory is bounded and
//! taken at the start: of a line that carries more than fits, frames are lost.

use std::collections::VecDeque;

use hbot_link::MAX_FEEDBACK_FRAME;
use oorandom::Rand64;

use crate::phenomena::Link;

/// The most frames and bytes of one direction that are on their way at a time: at the longest latency and jitter, 0.2 s, all
/// of a loop of 5 kHz.
const FRAMES: usize = 1024;
const BYTES: usize = 128 * 1024;

/// The longest frame, with its end before it. What is longer without an end is no frame; it travels in pieces of this size.
pub(crate) const LONGEST: usize = MAX_FEEDBACK_FRAME + 1;

/// What became of the frames of one direction since the line was impaired.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Traffic {
    /// Frames sent.
    pub sent: u64,
    /// Of those, lost.
    pub lost: u64,
    /// Of those, delivered with a flipped byte.
    pub corrupted: u64,
}

/// A line that is impaired, both ways.
#[derive(Debug, Clone)]
pub(crate) struct Impairment {
    random: Rand64,
    pub(crate) commands: Lane,
    pub(crate) answers: Lane,
    /// Room for what the controllers answer to one frame.
    pub(crate) scratch: Vec<u8>,
}

impl Impairment {
    /// A line on which `end` ends a frame.
    pub(crate) fn new(link: &Link, end: u8) -> Self {
        let mut line = Self {
            random: Rand64::new(0),
            commands: Lane::new(end),
            answers: Lane::new(end),
            scratch: Vec::with_capacity(4 * LONGEST),
        };
        line.replace(link);
        line
    }

    /// Has the figures replaced; what is on its way stays so, and arrives when it was to.
    pub(crate) fn replace(&mut self, link: &Link) {
        self.random = Rand64::new(u128::from(link.seed));
        self.commands.set(link, link.command_latency_s);
        self.answers.set(link, link.latency_s);
    }

    /// Sends bytes to the controllers.
    pub(crate) fn command(&mut self, now_ns: u64, bytes: &[u8]) {
        self.commands.send(now_ns, bytes, &mut self.random);
    }

    /// Sends the scratch's bytes to the host.
    pub(crate) fn answer(&mut self, now_ns: u64) {
        self.answers.send(now_ns, &self.scratch, &mut self.random);
        self.scratch.clear();
    }

    /// When the next frame arrives at either end, ns.
    pub(crate) fn next_ns(&self) -> Option<u64> {
        let (command, answer) = (self.commands.next_ns(), self.answers.next_ns());
        command.map_or(answer, |c| Some(answer.map_or(c, |a| a.min(c))))
    }
}

#[derive(Debug, Clone, Copy)]
struct Frame {
    due_ns: u64,
    length: usize,
}

/// One direction of the line.
#[derive(Debug, Clone)]
pub(crate) struct Lane {
    /// The byte that ends a frame.
    end: u8,
    latency_ns: u64,
    jitter_ns: f64,
    loss: f64,
    corrupt: f64,
    /// A frame whose end has not come yet.
    begun: [u8; LONGEST],
    length: usize,
    /// On their way, the oldest first.
    frames: VecDeque<Frame>,
    bytes: VecDeque<u8>,
    pub(crate) traffic: Traffic,
}

impl Lane {
    fn new(end: u8) -> Self {
        Self {
            end,
            latency_ns: 0,
            jitter_ns: 0.0,
            loss: 0.0,
            corrupt: 0.0,
            begun: [0; LONGEST],
            length: 0,
            frames: VecDeque::with_capacity(FRAMES),
            bytes: VecDeque::with_capacity(BYTES),
            traffic: Traffic::default(),
        }
    }

    fn set(&mut self, link: &Link, latency_s: f64) {
        self.latency_ns = (latency_s * 1.0e9).round_ties_even() as u64;
        (self.jitter_ns, self.loss, self.corrupt) = (link.jitter_s * 1.0e9, link.loss, link.corrupt);
    }

    /// When its next frame arrives, ns.
    pub(crate) fn next_ns(&self) -> Option<u64> {
        self.frames.front().map(|frame| frame.due_ns)
    }

    /// Hands the next frame over if it arrives by `until_ns`.
    pub(crate) fn take(&mut self, until_ns: u64, mut each: impl FnMut(&[u8])) -> bool {
        let Some(frame) = self.frames.front().copied().filter(|frame| frame.due_ns <= until_ns) else {
            return false;
        };
        self.frames.pop_front();
        let (first, second) = self.bytes.as_slices();
        let in_first = frame.length.min(first.len());
        each(&first[..in_first]);
        if in_first < frame.length {
            each(&second[..frame.length - in_first]);
        }
        self.bytes.drain(..frame.length);
        true
    }

    fn send(&mut self, now_ns: u64, bytes: &[u8], random: &mut Rand64) {
        for byte in bytes {
            self.begun[self.length] = *byte;
            self.length += 1;
            // Ends alone are no frame: they belong to the next.
            let end = self.end;
            let ends = *byte == end && self.begun[..self.length].iter().any(|byte| *byte != end);
            if ends || self.length == LONGEST {
                self.put(now_ns, random);
                self.length = 0;
            }
        }
    }

    /// Puts the frame that has just ended on its way.
    fn put(&mut self, now_ns: u64, random: &mut Rand64) {
        let frame = &mut self.begun[..self.length];
        self.traffic.sent += 1;
        // As many draws for every frame, so that one figure does not change what another does.
        let (loss, corrupt, late) = (random.rand_float(), random.rand_float(), random.rand_float());
        let (place, flip) = (random.rand_u64(), random.rand_u64());
        let full = self.frames.len() == FRAMES || self.bytes.len() + frame.len() > BYTES;
        if loss < self.loss || full {
            self.traffic.lost += 1;
            return;
        }
        if corrupt < self.corrupt {
            self.traffic.corrupted += 1;
            // Remainders of 64 bits by small numbers: as even as nobody can tell from even.
            let place = (place % (frame.len() as u64 - 1).max(1)) as usize;
            frame[place] ^= (1 + flip % 255) as u8;
        }
        // One that is due earlier than the one before it waits behind it.
        let due_ns = now_ns.saturating_add(self.latency_ns).saturating_add((late * self.jitter_ns) as u64);
        self.frames.push_back(Frame { due_ns, length: frame.len() });
        self.bytes.extend(&*frame);
    }
}
