//! The bridge between the loop and the rest of the server: wait-free rings, and an event that wakes
//! the other side.
//!
//! Orders and compiled scenes go to the loop; samples and retired scenes come back. The loop never
//! waits, and never allocates or frees memory. If the ring of orders or scenes is full, the sender
//! gets an error. If the ring of samples is full, the sample is dropped and counted.

use std::io;
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering, fence};
use std::thread::Thread;

use hbot_core::CompiledScene;
use hbot_core::inputs::{Command, ModelCommand};
use hbot_core::render::model::LocalModel;
use hbot_core::safety::mode::{Cause, Mode};
use rtrb::{Consumer, Producer, RingBuffer};
use rustix::event::{EventfdFlags, eventfd};
use thiserror::Error;

use crate::run_loop::sample::Sample;

/// Number of samples that can wait for the service. At 8 kHz they last for half a second, in case
/// the service is busy.
const SAMPLES: usize = 4096;
/// Number of samples since the last wake-up after which the loop wakes the service, even if the
/// service asked to be woken only for notable samples, such as a change of mode.
const MANY_UNANNOUNCED: usize = 64;
const ORDERS: usize = 256;
const SCENES: usize = 4;

/// A command on its way to the loop, with the number that identifies its answer.
#[derive(Debug, Clone, Copy)]
pub struct Order {
    /// Number of the order, returned with the answer in [`Sample::answers`].
    pub ticket: u64,
    /// The command, which the control law of hbot-core carries out.
    pub command: Command,
    /// The model of a [`Command::Model`].
    pub model: Option<LocalModel>,
}

/// Error: an order or scene cannot be sent, because the ring to the loop is full.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the loop has not yet taken what it was given before")]
pub struct Busy;

/// The control loop's end of the bridge to the service. It receives orders and scenes, and sends
/// samples.
pub struct LoopEnd {
    orders: Consumer<Order>,
    scenes: Consumer<Box<CompiledScene>>,
    retired: Producer<Box<CompiledScene>>,
    samples: Producer<Sample>,
    waker: Arc<Waker>,
    /// Mode, fault cause and scene of the last published sample, to detect a change.
    last: Option<Situation>,
    /// Number of samples since the service was last woken.
    unannounced: usize,
}

/// The parts of a sample whose change wakes the service: mode, cause of a fault, and revision of
/// the scene.
type Situation = (Mode, Option<Cause>, u64);

/// The service's end of the bridge to the control loop. It sends orders and scenes, and receives
/// samples.
pub struct ServiceEnd {
    orders: Producer<Order>,
    scenes: Producer<Box<CompiledScene>>,
    retired: Consumer<Box<CompiledScene>>,
    samples: Consumer<Sample>,
    waker: Arc<Waker>,
    next_ticket: u64,
    /// The loop's thread, if the loop runs in virtual time.
    in_virtual_time: Option<Thread>,
}

/// A notification from the loop that samples are waiting: its file descriptor becomes readable. It
/// is separate from [`ServiceEnd`], so that one task can wait for it while another uses the
/// `ServiceEnd`.
#[derive(Clone)]
pub struct Wakeup(Arc<Waker>);

/// A handle that requests an emergency stop at the loop's next tick, from any thread. It only
/// writes to memory and shares no channel and no lock, so nothing that the service does can delay
/// it.
#[derive(Clone)]
pub struct EmergencyStop(Arc<Waker>);

/// State shared by both ends of the bridge, with which the loop wakes the service. The loop wakes
/// it only if it sleeps, so that a busy service costs the loop no system call.
struct Waker {
    /// Which samples wake the service: [`AWAKE`], [`NOTABLE`] or [`EVERY`].
    armed: AtomicU8,
    /// Tick number of the newest sample that the loop has published.
    tick: AtomicU64,
    /// Tick before which a loop in virtual time waits, or [`FREELY`].
    until: AtomicU64,
    /// True if an emergency stop is requested. It takes effect before all orders that wait in the
    /// ring.
    estop: AtomicBool,
    /// True if a signal requested the emergency stop and the service has not noticed it yet.
    signalled: AtomicBool,
    /// True if the loop has ended: no more samples will come.
    ended: AtomicBool,
    event: OwnedFd,
}

/// Value of [`Waker::armed`]: the service is awake and needs no wake-up.
const AWAKE: u8 = 0;
/// Value of [`Waker::armed`]: the service sleeps until a notable sample is published, such as one
/// with a change of mode, or until many samples wait.
const NOTABLE: u8 = 1;
/// Value of [`Waker::armed`]: the service sleeps until the next sample is published.
const EVERY: u8 = 2;

/// Value of [`Waker::until`]: the loop does not wait.
const FREELY: u64 = u64::MAX;

/// Creates the bridge between the control loop and the service. Returns the loop's end and the
/// service's end.
///
/// # Errors
/// Fails if the system provides no event descriptor.
pub fn bridge() -> io::Result<(LoopEnd, ServiceEnd)> {
    let event = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?;
    let waker = Arc::new(Waker {
        armed: AtomicU8::new(AWAKE),
        tick: AtomicU64::new(0),
        until: AtomicU64::new(FREELY),
        estop: AtomicBool::new(false),
        signalled: AtomicBool::new(false),
        ended: AtomicBool::new(false),
        event,
    });
    let (orders_in, orders_out) = RingBuffer::new(ORDERS);
    let (scenes_in, scenes_out) = RingBuffer::new(SCENES);
    // Room for all scenes in the ring and the running one, so that the loop can always give a scene
    // back.
    let (retired_in, retired_out) = RingBuffer::new(SCENES + 1);
    let (samples_in, samples_out) = RingBuffer::new(SAMPLES);
    let inner = LoopEnd {
        orders: orders_out,
        scenes: scenes_out,
        retired: retired_in,
        samples: samples_in,
        waker: Arc::clone(&waker),
        last: None,
        unannounced: 0,
    };
    let outer = ServiceEnd {
        orders: orders_in,
        scenes: scenes_in,
        retired: retired_out,
        samples: samples_out,
        waker,
        next_ticket: 1,
        in_virtual_time: None,
    };
    Ok((inner, outer))
}

impl LoopEnd {
    /// Removes and returns the oldest waiting order, if any.
    #[inline]
    pub fn take_order(&mut self) -> Option<Order> {
        self.orders.pop().ok()
    }

    /// Replaces `scene` by the newest scene that waits in the ring, if any. Sends the old scenes
    /// back to the service, so that their memory is not freed in the control loop.
    #[inline]
    pub fn adopt_scene(&mut self, scene: &mut Box<CompiledScene>) {
        while let Ok(newer) = self.scenes.pop() {
            let old = std::mem::replace(scene, newer);
            // This cannot fail: the ring has room for every scene that can be in use.
            let _ = self.retired.push(old);
        }
    }

    /// Sends a sample to the service. Returns false if the ring was full, so that the sample was
    /// dropped. Makes at most one system call, a non-blocking write that wakes the service.
    #[inline]
    pub fn publish(&mut self, sample: Sample) -> bool {
        let situation = Some((sample.state.mode, sample.state.cause, sample.scene));
        let notable = self.last != situation || sample.answers.iter().any(Option::is_some);
        self.last = situation;
        self.waker.tick.store(sample.state.tick, Ordering::Relaxed);
        let placed = self.samples.push(sample).is_ok();
        self.unannounced += 1;
        // The fence guarantees one of two things: the service sees this sample when it checks again
        // before it sleeps, or this load sees that the service wants to be woken.
        fence(Ordering::SeqCst);
        let wakes = match self.waker.armed.load(Ordering::Relaxed) {
            AWAKE => false,
            NOTABLE => notable || self.unannounced >= MANY_UNANNOUNCED,
            _ => true,
        };
        if wakes {
            self.unannounced = 0;
            self.waker.armed.store(AWAKE, Ordering::SeqCst);
            // The write fails only if the event's counter is full, and then the service has been
            // woken already.
            let _ = rustix::io::write(&self.waker.event, &1_u64.to_ne_bytes());
        }
        placed
    }

    /// Returns whether an emergency stop was requested since the last call.
    #[inline]
    #[must_use]
    pub fn take_estop(&self) -> bool {
        // A plain load comes first, because a swap in every tick would cost a locked instruction.
        self.waker.estop.load(Ordering::Acquire) && self.waker.estop.swap(false, Ordering::AcqRel)
    }

    /// Returns whether a loop in virtual time may run the tick `tick` now. An emergency stop needs
    /// no permission.
    #[must_use]
    pub fn may_run(&self, tick: u64) -> bool {
        tick < self.waker.until.load(Ordering::Acquire) || self.waker.estop.load(Ordering::Acquire)
    }

    /// Returns whether the ring of samples to the service is full, so that the next sample would be
    /// dropped.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.samples.is_full()
    }
}

impl ServiceEnd {
    /// Sends a command to the loop. Returns its ticket: the number under which a later sample
    /// contains the answer. An emergency stop takes effect even if the ring is full.
    ///
    /// # Errors
    /// Fails if 256 orders wait already. The loop takes up to 7 in each tick.
    pub fn order(&mut self, command: Command) -> Result<u64, Busy> {
        if command == Command::Estop {
            // The flag takes effect at once, whatever waits in the ring, and even if the ring has
            // no room for the confirmation. A second stop in its place, a few ticks after the
            // first, would undo a reset that was ordered in between.
            self.emergency_stop().stop();
            return self.order(Command::Confirm);
        }
        self.push(command, None)
    }

    /// Sends a local model of a client to the loop. Returns its ticket, as [`order`](Self::order)
    /// does.
    ///
    /// # Errors
    /// Fails if 256 orders wait already.
    pub fn order_model(&mut self, command: ModelCommand, model: &LocalModel) -> Result<u64, Busy> {
        self.push(Command::Model(command), Some(*model))
    }

    fn push(&mut self, command: Command, model: Option<LocalModel>) -> Result<u64, Busy> {
        let ticket = self.next_ticket;
        self.orders.push(Order { ticket, command, model }).map_err(|_| Busy)?;
        self.next_ticket += 1;
        Ok(ticket)
    }

    /// Returns a handle that requests an emergency stop from any thread, even if the ring of orders
    /// is full.
    #[must_use]
    pub fn emergency_stop(&self) -> EmergencyStop {
        EmergencyStop(Arc::clone(&self.waker))
    }

    /// Returns whether a signal has requested an emergency stop since the last call.
    #[must_use]
    pub fn take_signalled(&self) -> bool {
        self.waker.signalled.swap(false, Ordering::AcqRel)
    }

    /// Returns whether the ring to the loop has room for another scene. Also frees the scenes that
    /// the loop has sent back.
    pub fn can_install(&mut self) -> bool {
        while self.retired.pop().is_ok() {}
        !self.scenes.is_full()
    }

    /// Sends a compiled scene to the loop, which renders it from its next tick on.
    ///
    /// # Errors
    /// Fails if four scenes wait already.
    pub fn install(&mut self, scene: Box<CompiledScene>) -> Result<(), Busy> {
        if !self.can_install() {
            return Err(Busy);
        }
        self.scenes.push(scene).map_err(|_| Busy)?;
        self.let_it_answer();
        Ok(())
    }

    /// Tells this end that the loop runs in virtual time, in the thread `thread`, so that it can be
    /// made to wait.
    pub fn in_virtual_time(&mut self, thread: Thread) {
        self.in_virtual_time = Some(thread);
    }

    /// Makes the loop run `ticks` more ticks and then wait for the next call. Returns the number of
    /// the last of them, or `None` if the loop runs in wall-clock time. While the loop still runs
    /// freely, it may run a few ticks more before it waits.
    pub fn advance(&mut self, ticks: u64) -> Option<u64> {
        self.in_virtual_time.as_ref()?;
        let until = self.waker.until.load(Ordering::Relaxed);
        let next = self.tick() + 1;
        let from = if until == FREELY { next } else { until.max(next) };
        self.run_until(from.saturating_add(ticks));
        Some(from.saturating_add(ticks) - 1)
    }

    /// Lets a loop that waits run one tick more, so that it takes what it was given.
    pub fn let_it_answer(&mut self) {
        if self.waker.until.load(Ordering::Relaxed) != FREELY {
            self.advance(1);
        }
    }

    /// Returns whether the loop waits for permission after the tick `tick`.
    #[must_use]
    pub fn waits_after(&self, tick: u64) -> bool {
        self.waker.until.load(Ordering::Relaxed) <= tick.saturating_add(1)
    }

    /// Lets the loop run without waiting for [`advance`](Self::advance).
    pub fn run_freely(&mut self) {
        self.run_until(FREELY);
    }

    fn run_until(&mut self, tick: u64) {
        self.waker.until.store(tick, Ordering::Release);
        if let Some(thread) = &self.in_virtual_time {
            thread.unpark();
        }
    }

    /// Removes and returns the oldest waiting sample, if any.
    pub fn try_sample(&mut self) -> Option<Sample> {
        self.samples.pop().ok()
    }

    /// Returns the tick number of the newest sample that the loop has published, or 0 before the
    /// first sample.
    #[must_use]
    pub fn tick(&self) -> u64 {
        self.waker.tick.load(Ordering::Relaxed)
    }

    /// Returns whether samples are waiting to be fetched.
    #[must_use]
    pub fn has_samples(&self) -> bool {
        !self.samples.is_empty()
    }

    /// Returns whether the loop has ended and all samples have been fetched.
    #[must_use]
    pub fn is_over(&self) -> bool {
        // The order matters: the loop publishes its last sample before it sets `ended`.
        self.waker.ended.load(Ordering::SeqCst) && self.samples.is_empty()
    }

    /// Returns a handle with which a task can wait for new samples.
    #[must_use]
    pub fn wakeup(&self) -> Wakeup {
        Wakeup(Arc::clone(&self.waker))
    }
}

impl EmergencyStop {
    /// Requests an emergency stop at the loop's next tick.
    pub fn stop(&self) {
        self.0.estop.store(true, Ordering::Release);
    }

    /// Requests an emergency stop at the loop's next tick, and records for the service that a
    /// signal caused it.
    pub fn stop_by_signal(&self) {
        self.0.signalled.store(true, Ordering::Release);
        self.stop();
    }
}

impl Wakeup {
    /// Requests the next notification. If `every` is true, the next sample triggers it. Otherwise
    /// only a notable sample triggers it: one with a new mode, fault cause or scene, or one that
    /// contains an answer. A large number of waiting samples and the end of the loop always trigger
    /// it. After this call, the caller must check for samples again, because samples that already
    /// wait trigger no notification.
    pub fn arm(&self, every: bool) {
        self.0.armed.store(if every { EVERY } else { NOTABLE }, Ordering::SeqCst);
        fence(Ordering::SeqCst);
    }

    /// Clears the notification, so that its descriptor is no longer readable.
    pub fn clear(&self) {
        let mut count = [0; 8];
        // The read fails if another holder of the event has already read it, which does no harm.
        let _ = rustix::io::read(&self.0.event, &mut count);
    }

    /// Returns a duplicate of the file descriptor that becomes readable at a notification.
    ///
    /// # Errors
    /// Fails if the system provides no descriptor.
    pub fn descriptor(&self) -> io::Result<OwnedFd> {
        self.0.event.try_clone()
    }
}

impl Drop for LoopEnd {
    fn drop(&mut self) {
        // Wakes the service, so that it learns that no more samples will come.
        self.waker.ended.store(true, Ordering::SeqCst);
        let _ = rustix::io::write(&self.waker.event, &1_u64.to_ne_bytes());
    }
}
