//! Impairs a simulated line: delays, loses and damages frames as a scene's [`Link`] asks.
//!
//! A frame is everything up to the byte that ends one in the line's protocol. Its contents do not
//! matter. Frames of one direction stay in order. A frame that is not complete is kept until its
//! last byte arrives. Memory is allocated at the start only. If more frames are in flight than fit
//! in it, frames are lost.

use std::collections::VecDeque;

use hbot_link::MAX_FEEDBACK_FRAME;
use oorandom::Rand64;

use crate::phenomena::Link;

/// Largest number of frames in flight in one direction. `BYTES` limits the sum of their bytes. Both
/// limits are large enough for all frames of a 5 kHz loop at the longest latency plus jitter, 0.2
/// s.
const FRAMES: usize = 1024;
const BYTES: usize = 128 * 1024;

/// Length of the longest frame, with the end byte of the frame before it. Longer data without an
/// end byte is not a frame and is sent in pieces of this size.
pub(crate) const LONGEST: usize = MAX_FEEDBACK_FRAME + 1;

/// Numbers of frames that were sent, lost and damaged in one direction of an impaired line, since
/// the impairment began.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FrameCounts {
    /// Number of frames sent.
    pub sent: u64,
    /// Number of frames that were lost, out of those sent.
    pub lost: u64,
    /// Number of frames that were delivered with a damaged byte, out of those sent.
    pub corrupted: u64,
}

/// An impaired line: it delays, loses and damages frames in both directions.
#[derive(Debug, Clone)]
pub(crate) struct Impairment {
    random: Rand64,
    pub(crate) commands: Lane,
    pub(crate) answers: Lane,
    /// Buffer in which the motor controllers write their answers to one frame.
    pub(crate) scratch: Vec<u8>,
}

impl Impairment {
    /// Creates an impaired line with the parameters `link`. `end` is the byte that ends a frame.
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

    /// Replaces the parameters of the impairment. Frames already in flight still arrive at the time
    /// that was set when they were sent.
    pub(crate) fn replace(&mut self, link: &Link) {
        self.random = Rand64::new(u128::from(link.seed));
        self.commands.set(link, link.command_latency_s);
        self.answers.set(link, link.latency_s);
    }

    /// Sends bytes from the host to the motor controllers.
    pub(crate) fn command(&mut self, now_ns: u64, bytes: &[u8]) {
        self.commands.send(now_ns, bytes, &mut self.random);
    }

    /// Sends the answers in `scratch` to the host and clears `scratch`.
    pub(crate) fn answer(&mut self, now_ns: u64) {
        self.answers.send(now_ns, &self.scratch, &mut self.random);
        self.scratch.clear();
    }

    /// Returns the time at which the next frame in either direction arrives, ns. Returns `None` if
    /// no frame is in flight.
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

/// The parameters and the frames in flight of one direction of an impaired line.
#[derive(Debug, Clone)]
pub(crate) struct Lane {
    /// The byte that ends a frame in the line's protocol.
    end: u8,
    latency_ns: u64,
    jitter_ns: f64,
    loss: f64,
    corrupt: f64,
    /// Bytes received so far of a frame that is not yet complete. The first `length` entries are
    /// used.
    begun: [u8; LONGEST],
    length: usize,
    /// Lengths and arrival times of the frames in flight, oldest first.
    frames: VecDeque<Frame>,
    bytes: VecDeque<u8>,
    pub(crate) traffic: FrameCounts,
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
            traffic: FrameCounts::default(),
        }
    }

    fn set(&mut self, link: &Link, latency_s: f64) {
        self.latency_ns = (latency_s * 1.0e9).round_ties_even() as u64;
        (self.jitter_ns, self.loss, self.corrupt) = (link.jitter_s * 1.0e9, link.loss, link.corrupt);
    }

    /// Returns the time at which the next frame of this direction arrives, ns.
    pub(crate) fn next_ns(&self) -> Option<u64> {
        self.frames.front().map(|frame| frame.due_ns)
    }

    /// Passes the bytes of the oldest frame in flight to `each` if the frame arrives by `until_ns`.
    /// Returns whether it did.
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
            // End bytes alone are not a frame. They belong to the next frame.
            let end = self.end;
            let ends = *byte == end && self.begun[..self.length].iter().any(|byte| *byte != end);
            if ends || self.length == LONGEST {
                self.put(now_ns, random);
                self.length = 0;
            }
        }
    }

    /// Sends the complete frame that is in `begun`. The frame is delayed, and it can be lost or
    /// damaged.
    fn put(&mut self, now_ns: u64, random: &mut Rand64) {
        let frame = &mut self.begun[..self.length];
        self.traffic.sent += 1;
        // Every frame draws equally many random numbers, so that one parameter does not change the
        // effect of another.
        let (loss, corrupt, late) = (random.rand_float(), random.rand_float(), random.rand_float());
        let (place, flip) = (random.rand_u64(), random.rand_u64());
        let full = self.frames.len() == FRAMES || self.bytes.len() + frame.len() > BYTES;
        if loss < self.loss || full {
            self.traffic.lost += 1;
            return;
        }
        if corrupt < self.corrupt {
            self.traffic.corrupted += 1;
            // The remainder of a 64-bit number by a small one is uniform to about 1e-17.
            let place = (place % (frame.len() as u64 - 1).max(1)) as usize;
            frame[place] ^= (1 + flip % 255) as u8;
        }
        // A frame that is due before its predecessor still waits behind it in the queue.
        let due_ns = now_ns.saturating_add(self.latency_ns).saturating_add((late * self.jitter_ns) as u64);
        self.frames.push_back(Frame { due_ns, length: frame.len() });
        self.bytes.extend(&*frame);
    }
}
