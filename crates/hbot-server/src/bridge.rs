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
use tokio::io::unix::AsyncFd;

use crate::sample::Sample;

/// Samples between loop and service: half a second at 8 kHz, while the service is busy elsewhere.
const SAMPLES: usize = 4096;
/// So many may come before a service is woken that hears only of what is notable.
const UNHEARD: usize = 64;
const ORDERS: usize = 256;
const SCENES: usize = 4;

/// Follows an emergency stop through the ring and is answered in its tick or after it. It does nothing:
/// a second stop some ticks after the first would undo a reset that somebody has asked for meanwhile.
pub(crate) const CONFIRMED: Command = Command::ClientLost(OnClientLost::Keep);

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
pub(crate) struct LoopEnd {
    pub(crate) orders: Consumer<Order>,
    pub(crate) scenes: Consumer<Box<CompiledScene>>,
    pub(crate) retired: Producer<Box<CompiledScene>>,
    samples: Producer<Sample>,
    waker: Arc<Waker>,
    /// Of the last sample.
    last: Option<Situation>,
    /// Samples since the service was last woken.
    unheard: usize,
}

/// What of a sample the service hears of at once when it changes: what the rig does, and the scene that it renders.
type Situation = (Mode, Option<Cause>, u64);

/// The service's end. It belongs to a tokio runtime.
pub struct ServiceEnd {
    orders: Producer<Order>,
    scenes: Producer<Box<CompiledScene>>,
    retired: Consumer<Box<CompiledScene>>,
    samples: Consumer<Sample>,
    waker: Arc<Waker>,
    event: Arc<AsyncFd<OwnedFd>>,
    next_ticket: u64,
}

/// Rings when the loop has something to say. It is apart from the service's end, so that who waits for it leaves that end to
/// others.
pub(crate) struct Bell {
    waker: Arc<Waker>,
    event: Arc<AsyncFd<OwnedFd>>,
}

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
/// The system gives no event descriptor, or there is no tokio runtime.
pub(crate) fn bridge() -> io::Result<(LoopEnd, ServiceEnd)> {
    let event = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?;
    let waker = Arc::new(Waker {
        ear: AtomicU8::new(AWAKE),
        tick: AtomicU64::new(0),
        estop: AtomicBool::new(false),
        signalled: AtomicBool::new(false),
        ended: AtomicBool::new(false),
        event: event.try_clone()?,
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
    // Its successor is an unsafe function, because other types than OwnedFd may change or close their descriptor.
    #[expect(
        deprecated,
        reason = "an OwnedFd always gives the same open descriptor, which is all that new() asks"
    )]
    let event = Arc::new(AsyncFd::new(event)?);
    let outer = ServiceEnd {
        orders: orders_in,
        scenes: scenes_in,
        retired: retired_out,
        samples: samples_out,
        waker,
        event,
        next_ticket: 1,
    };
    Ok((inner, outer))
}

impl LoopEnd {
    /// Publishes a sample: false where there was no place for it. At most one non-blocking write to the event.
    #[inline]
    pub(crate) fn publish(&mut self, sample: Sample) -> bool {
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
    pub(crate) fn take_estop(&self) -> bool {
        // Looked at first, because a swap in every tick would cost a locked instruction.
        self.waker.estop.load(Ordering::Acquire) && self.waker.estop.swap(false, Ordering::AcqRel)
    }

    /// Whether the next sample will find no place.
    pub(crate) fn is_full(&self) -> bool {
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
    pub(crate) fn take_signalled(&self) -> bool {
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
    pub(crate) fn tick(&self) -> u64 {
        self.waker.tick.load(Ordering::Relaxed)
    }

    /// Whether there are samples to be fetched.
    pub(crate) fn has_samples(&self) -> bool {
        !self.samples.is_empty()
    }

    /// Whether the loop has ended and all samples are fetched.
    pub(crate) fn is_over(&self) -> bool {
        // In this order: the loop's last sample comes before its end.
        self.waker.ended.load(Ordering::SeqCst) && self.samples.is_empty()
    }

    /// What rings when there are more.
    pub(crate) fn bell(&self) -> Bell {
        Bell { waker: Arc::clone(&self.waker), event: Arc::clone(&self.event) }
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
    /// Has it ring at the next sample, or else at the next one that is notable (another mode, cause or scene, an answer) or after many; and
    /// at the end of the loop. Look again after this whether there is anything to be fetched: only what comes later rings.
    pub(crate) fn set(&self, every: bool) {
        self.waker.ear.store(if every { EVERY } else { NOTABLE }, Ordering::SeqCst);
        fence(Ordering::SeqCst);
    }

    /// Waits until it rings. Cancel safe.
    ///
    /// # Errors
    /// The runtime shuts down.
    pub(crate) async fn rung(&self) -> io::Result<()> {
        let mut guard = self.event.readable().await?;
        let mut count = [0; 8];
        // Where another has read it, it has rung all the same.
        let _ = rustix::io::read(guard.get_inner(), &mut count);
        guard.clear_ready();
        Ok(())
    }
}

impl Drop for LoopEnd {
    fn drop(&mut self) {
        // Whoever waits for a sample learns that there will be none.
        self.waker.ended.store(true, Ordering::SeqCst);
        let _ = rustix::io::write(&self.waker.event, &1_u64.to_ne_bytes());
    }
}
