//! The way between the loop and the rest of the server: wait-free rings, and an event that wakes the other side.
//!
//! Orders and compiled scenes go in, samples and retired scenes come out. The loop never waits, allocates or frees; where a
//! ring is full the other side is told so, or loses a sample that is counted.

use std::io;
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering, fence};

use hbot_core::CompiledScene;
use hbot_core::inputs::{Command, OnClientLost};
use hbot_core::mode::{Cause, Mode};
use rtrb::{Consumer, Producer, RingBuffer};
use rustix::event::{EventfdFlags, eventfd};
use thiserror::Error;

use crate::sample::Sample;

/// Samples between loop and service: half a second at 8 kHz, while the service is busy elsewhere.
const SAMPLES: usize = 4096;
/// So many may come before a service is woken that hears only of what is notable.
const UNHEARD: usize = 64;
const ORDERS: usize = 256;
const SCENES: usize = 4;

/// Follows an emergency stop through the ring and is answered in its tick or after it. It does nothing:
/// a second stop some ticks after the first would undo a reset that somebody has asked for meanwhile.
pub const CONFIRMED: Command = Command::ClientLost(OnClientLost::Keep);

/// A command on its way to the loop, with the number under which it is answered.
#[derive(Debug, Clone, Copy)]
pub struct Order {
    /// Comes back in [`Sample::answers`].
    pub ticket: u64,
    /// What to do.
    pub command: Command,
}

/// The loop has not yet taken what it was given before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the loop has not yet taken what it was given before")]
pub struct Busy;

/// The loop's end.
pub struct LoopEnd {
    orders: Consumer<Order>,
    scenes: Consumer<Box<CompiledScene>>,
    retired: Producer<Box<CompiledScene>>,
    samples: Producer<Sample>,
    waker: Arc<Waker>,
    /// Of the last sample.
    last: Option<Situation>,
    /// Samples since the service was last woken.
    unheard: usize,
}

/// What of a sample the service hears of at once when it changes: what the rig does, and the scene that it renders.
type Situation = (Mode, Option<Cause>, u64);

/// The other end: orders and scenes in, samples out.
pub struct ServiceEnd {
    orders: Producer<Order>,
    scenes: Producer<Box<CompiledScene>>,
    retired: Consumer<Box<CompiledScene>>,
    samples: Consumer<Sample>,
    waker: Arc<Waker>,
    next_ticket: u64,
}

/// Rings when the loop has something to say: its event descriptor becomes readable. It is apart from
/// [`ServiceEnd`], so that whoever waits for it leaves that end to others.
#[derive(Clone)]
pub struct Bell(Arc<Waker>);

/// Stops the loop at its next tick, from any thread, by stores into memory: it shares no channel and no lock with anything, so
/// nothing that the service does can delay it.
#[derive(Clone)]
pub struct EmergencyStop(Arc<Waker>);

/// Wakes the service only where it sleeps, so that a busy one costs the loop no system call.
struct Waker {
    /// What wakes it: one of the constants below.
    ear: AtomicU8,
    /// Of the last sample.
    tick: AtomicU64,
    /// An emergency stop stands before everything that waits in the ring.
    estop: AtomicBool,
    /// It came by a signal, of which the service has not heard yet.
    signalled: AtomicBool,
    /// The loop is over: no sample will come.
    ended: AtomicBool,
    event: OwnedFd,
}

/// The service is awake.
const AWAKE: u8 = 0;
/// It sleeps until something notable happens, or many samples wait.
const NOTABLE: u8 = 1;
/// It sleeps until the next sample.
const EVERY: u8 = 2;

/// Both ends of a new bridge.
///
/// # Errors
/// The system gives no event descriptor.
pub fn bridge() -> io::Result<(LoopEnd, ServiceEnd)> {
    let event = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?;
    let waker = Arc::new(Waker {
        ear: AtomicU8::new(AWAKE),
        tick: AtomicU64::new(0),
        estop: AtomicBool::new(false),
        signalled: AtomicBool::new(false),
        ended: AtomicBool::new(false),
        event,
    });
    let (orders_in, orders_out) = RingBuffer::new(ORDERS);
    let (scenes_in, scenes_out) = RingBuffer::new(SCENES);
    // Room for every scene on its way and the running one: the loop can always give one back.
    let (retired_in, retired_out) = RingBuffer::new(SCENES + 1);
    let (samples_in, samples_out) = RingBuffer::new(SAMPLES);
    let inner = LoopEnd {
        orders: orders_out,
        scenes: scenes_out,
        retired: retired_in,
        samples: samples_in,
        waker: Arc::clone(&waker),
        last: None,
        unheard: 0,
    };
    let outer = ServiceEnd {
        orders: orders_in,
        scenes: scenes_in,
        retired: retired_out,
        samples: samples_out,
        waker,
        next_ticket: 1,
    };
    Ok((inner, outer))
}

impl LoopEnd {
    /// The oldest order that has not been taken.
    #[inline]
    pub fn take_order(&mut self) -> Option<Order> {
        self.orders.pop().ok()
    }

    /// Puts the newest scene in the place of `scene`. Those that it replaces go back, to be freed
    /// outside of the loop.
    #[inline]
    pub fn adopt_scene(&mut self, scene: &mut Box<CompiledScene>) {
        while let Ok(newer) = self.scenes.pop() {
            let old = std::mem::replace(scene, newer);
            // The ring has a place for every scene that can be on its way.
            let _ = self.retired.push(old);
        }
    }

    /// Publishes a sample: false where there was no place for it. At most one non-blocking write to the event.
    #[inline]
    pub fn publish(&mut self, sample: Sample) -> bool {
        let situation = Some((sample.state.mode, sample.state.cause, sample.scene));
        let notable = self.last != situation || sample.answers.iter().any(Option::is_some);
        self.last = situation;
        self.waker.tick.store(sample.state.tick, Ordering::Relaxed);
        let placed = self.samples.push(sample).is_ok();
        self.unheard += 1;
        // Either the service sees the sample when it looks again before it sleeps, or its ear is seen here.
        fence(Ordering::SeqCst);
        let wakes = match self.waker.ear.load(Ordering::Relaxed) {
            AWAKE => false,
            NOTABLE => notable || self.unheard >= UNHEARD,
            _ => true,
        };
        if wakes {
            self.unheard = 0;
            self.waker.ear.store(AWAKE, Ordering::SeqCst);
            // A full counter has woken the service already.
            let _ = rustix::io::write(&self.waker.event, &1_u64.to_ne_bytes());
        }
        placed
    }

    /// Whether an emergency stop has been ordered since it was asked last.
    #[inline]
    #[must_use]
    pub fn take_estop(&self) -> bool {
        // Looked at first, because a swap in every tick would cost a locked instruction.
        self.waker.estop.load(Ordering::Acquire) && self.waker.estop.swap(false, Ordering::AcqRel)
    }

    /// Whether the next sample will find no place.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.samples.is_full()
    }
}

impl ServiceEnd {
    /// Sends a command to the loop; its answer comes with a sample under the ticket.
    ///
    /// # Errors
    /// The loop takes 7 commands a tick, and 256 wait already.
    pub fn order(&mut self, command: Command) -> Result<u64, Busy> {
        if command == Command::Estop {
            // At once, whatever waits in the ring, and even if the order itself finds no place in it.
            self.emergency_stop().stop();
            return self.order(CONFIRMED);
        }
        let ticket = self.next_ticket;
        self.orders.push(Order { ticket, command }).map_err(|_| Busy)?;
        self.next_ticket += 1;
        Ok(ticket)
    }

    /// What stops the loop without an order.
    #[must_use]
    pub fn emergency_stop(&self) -> EmergencyStop {
        EmergencyStop(Arc::clone(&self.waker))
    }

    /// Whether a signal has stopped the loop since this was asked last.
    #[must_use]
    pub fn take_signalled(&self) -> bool {
        self.waker.signalled.swap(false, Ordering::AcqRel)
    }

    /// Whether a scene can be installed now. Frees the scenes that the loop has given back.
    pub fn can_install(&mut self) -> bool {
        while self.retired.pop().is_ok() {}
        !self.scenes.is_full()
    }

    /// Hands a compiled scene to the loop, which takes it at its next tick.
    ///
    /// # Errors
    /// Four scenes wait already.
    pub fn install(&mut self, scene: Box<CompiledScene>) -> Result<(), Busy> {
        if !self.can_install() {
            return Err(Busy);
        }
        self.scenes.push(scene).map_err(|_| Busy)
    }

    /// The oldest sample that has not been fetched.
    pub fn try_sample(&mut self) -> Option<Sample> {
        self.samples.pop().ok()
    }

    /// The last tick of which there is a sample, fetched or not; 0 before the first.
    #[must_use]
    pub fn tick(&self) -> u64 {
        self.waker.tick.load(Ordering::Relaxed)
    }

    /// Whether there are samples to be fetched.
    #[must_use]
    pub fn has_samples(&self) -> bool {
        !self.samples.is_empty()
    }

    /// Whether the loop has ended and all samples are fetched.
    #[must_use]
    pub fn is_over(&self) -> bool {
        // In this order: the loop's last sample comes before its end.
        self.waker.ended.load(Ordering::SeqCst) && self.samples.is_empty()
    }

    /// What rings when there are more.
    #[must_use]
    pub fn bell(&self) -> Bell {
        Bell(Arc::clone(&self.waker))
    }
}

impl EmergencyStop {
    /// Stops the loop.
    pub fn stop(&self) {
        self.0.estop.store(true, Ordering::Release);
    }

    /// Stops the loop, and notes for the log that a signal did.
    pub fn stop_by_signal(&self) {
        self.0.signalled.store(true, Ordering::Release);
        self.stop();
    }
}

impl Bell {
    /// Has it ring at the next sample, or else at the next one that is notable (another mode, cause or
    /// scene, an answer) or after many; and at the end of the loop. Look again after this whether
    /// there is anything to be fetched: only what comes later rings.
    pub fn set(&self, every: bool) {
        self.0.ear.store(if every { EVERY } else { NOTABLE }, Ordering::SeqCst);
        fence(Ordering::SeqCst);
    }

    /// Takes note that it has rung, so that its descriptor is no longer readable.
    pub fn heard(&self) {
        let mut count = [0; 8];
        // Where another has read it, it has rung all the same.
        let _ = rustix::io::read(&self.0.event, &mut count);
    }

    /// A duplicate of the descriptor that becomes readable when it rings.
    ///
    /// # Errors
    /// The system gives no descriptor.
    pub fn descriptor(&self) -> io::Result<OwnedFd> {
        self.0.event.try_clone()
    }
}

impl Drop for LoopEnd {
    fn drop(&mut self) {
        // Whoever waits for a sample learns that there will be none.
        self.waker.ended.store(true, Ordering::SeqCst);
        let _ = rustix::io::write(&self.waker.event, &1_u64.to_ne_bytes());
    }
}
