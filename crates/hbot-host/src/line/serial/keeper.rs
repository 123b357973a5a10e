//! The thread that reopens a lost line.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};

use super::{Held, LOOK, Peer, Serial, open, unguarded};
use crate::last_word::{LastWord, Program, Watched};
use crate::line::Renewed;

/// Pause before the first attempt to reopen a lost line.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
/// Longest pause between two attempts to reopen a lost line.
const LONGEST_PAUSE: Duration = Duration::from_secs(2);
/// Stack size of the thread that reopens a line, bytes.
const STACK: usize = 256 * 1024;

/// The control loop's connection to the thread that reopens a lost line.
#[derive(Debug)]
pub(super) struct Reopening {
    pub(super) lost: Producer<Held>,
    pub(super) back: Consumer<(Held, Renewed)>,
    over: Arc<AtomicBool>,
}

impl Drop for Reopening {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
    }
}

/// The settings that are needed to reopen a lost line.
#[derive(Debug, Clone)]
pub(super) struct Kept {
    pub(super) path: PathBuf,
    pub(super) baud: u32,
    pub(super) peer: Peer,
    pub(super) helper: Option<Program>,
}

/// The thread that reopens a lost line, with its settings and channels.
struct Keeper {
    kept: Kept,
    /// The helper process of the line, or `None` while the line is lost.
    watched: Option<Watched>,
    lost: Consumer<Held>,
    back: Producer<(Held, Renewed)>,
    over: Arc<AtomicBool>,
}

/// Starts the thread that reopens a line whenever it is lost. The line must be open when this
/// function is called, and `watched` is its helper process.
pub(super) fn keep(kept: Kept, watched: Option<Watched>) -> io::Result<Reopening> {
    let (lost, to_reopen) = RingBuffer::new(1);
    let (into, back) = RingBuffer::new(1);
    let over = Arc::new(AtomicBool::new(false));
    let keeper = Keeper { kept, watched, lost: to_reopen, back: into, over: Arc::clone(&over) };
    std::thread::Builder::new().name("hbot-port".to_owned()).stack_size(STACK).spawn(|| keeper.run())?;
    Ok(Reopening { lost, back, over })
}

impl Keeper {
    fn run(mut self) {
        while !self.over.load(Ordering::Relaxed) {
            let Ok(mut port) = self.lost.pop() else {
                if self.watched.take_if(|helper| helper.is_lost()).is_some() {
                    tracing::warn!(port = %self.kept.path.display(), "the helper process has ended: if the server dies, motors stop by \
                        their controllers' watchdog alone");
                }
                std::thread::sleep(LOOK);
                continue;
            };
            tracing::warn!(port = %self.kept.path.display(), "the serial line is gone; looking for it");
            if let Some(last_word) = &mut port.last_word {
                // The helper has the port open as well, so it must end first.
                last_word.all_said();
            }
            // Closing can wait: some drivers wait until all written bytes have been sent.
            drop(port);
            if let Some(found) = self.find() {
                self.watched = found.0.last_word.as_ref().map(LastWord::watched);
                tracing::warn!(port = %self.kept.path.display(), rebooted = found.1.rebooted, "the serial line is back");
                // This cannot fail: the loop has no port now, so the ring is empty.
                let _ = self.back.push(found);
            }
        }
    }

    /// Repeats attempts to reopen the line until one succeeds. Returns the open port and a report
    /// for the control loop, or `None` if the control loop no longer needs the line.
    fn find(&self) -> Option<(Held, Renewed)> {
        let mut told = String::new();
        let mut rebooted = false;
        for pause in pauses() {
            for _ in 0..pause.as_millis() / LOOK.as_millis() {
                if self.over.load(Ordering::Relaxed) {
                    return None;
                }
                std::thread::sleep(LOOK);
            }
            match self.try_once(&mut rebooted) {
                Ok(port) => return Some((port, Renewed { rebooted })),
                Err(reason) if reason != told => {
                    tracing::warn!(port = %self.kept.path.display(), reason, "not yet");
                    told = reason;
                }
                Err(_) => {}
            }
        }
        None
    }

    /// Makes one attempt to reopen the line. Sets `rebooted` if the motor controllers have lost
    /// power, even if the attempt then fails. The controllers report the loss of power only until
    /// they are asked to describe themselves, so a later attempt would not notice it.
    fn try_once(&self, rebooted: &mut bool) -> Result<Held, String> {
        let Kept { path, baud, peer: Peer { protocol, expected }, helper } = &self.kept;
        let port = open(path, *baud).map_err(|errno| errno.to_string())?;
        let mut line = Serial::of(port);
        // The motors are switched off before anything else.
        *rebooted |= protocol.switch_off(&mut line, expected).map_err(|error| error.to_string())?;
        protocol.meet(&mut line, expected).map_err(|error| error.to_string())?;
        let off = protocol.off_bytes(expected);
        if let Some(Err(error)) = helper.as_ref().map(|helper| line.guard(helper, &off)) {
            tracing::warn!("{}", unguarded(&path.display(), &error));
        }
        line.port.ok_or_else(|| "gone again".to_owned())
    }
}

/// Returns an endless sequence of the pauses before each attempt to reopen a lost line.
fn pauses() -> impl Iterator<Item = Duration> {
    std::iter::successors(Some(FIRST_PAUSE), |pause| Some((2 * *pause).min(LONGEST_PAUSE)))
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};
    use std::time::Instant;

    use hbot_config::RigConfig;
    use hbot_link::{Decoder, FromController, encode};
    use hbot_testing::prototype::simulated_as;
    use serialport::{SerialPort as _, TTYPort};

    use super::*;
    use crate::bus::{Expected, hbot::HbotLink};
    use crate::layout::Layout;

    #[test]
    fn a_lost_line_is_looked_for_with_growing_pauses() {
        let ms: Vec<_> = pauses().take(7).map(|pause| pause.as_millis()).collect();
        assert_eq!(ms, [100, 200, 400, 800, 1600, 2000, 2000]);
    }

    #[test]
    fn a_loss_of_power_is_not_forgotten_where_the_first_question_gets_no_answer() {
        let (mut near, far) = TTYPort::pair().expect("this test needs pseudo-terminals");
        let path = far.name().unwrap();
        near.set_timeout(Duration::from_millis(5)).unwrap();
        let rig = RigConfig::prototype();
        let mut simulated = simulated_as(&rig, |_| ());
        let over = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&over);
        // The controllers have just powered on. Their descriptions are lost on the line until after
        // the first attempt (1 s).
        let far_side = std::thread::spawn(move || {
            let _far = far;
            let (mut buffer, mut reply, mut decoder) =
                ([0; 4096], Vec::new(), Decoder::<FromController>::new());
            let (start, mut first) = (Instant::now(), None);
            while !stop.load(Ordering::Relaxed) {
                let Ok(n) = near.read(&mut buffer) else { continue };
                reply.clear();
                simulated.receive(start.elapsed().as_nanos() as u64, &buffer[..n], &mut reply);
                decoder.feed(&reply, |message| {
                    let Ok(message) = message else { return };
                    let described = matches!(message, FromController::Description(_));
                    if described
                        && first.get_or_insert_with(Instant::now).elapsed() < Duration::from_millis(1500)
                    {
                        return;
                    }
                    let mut frame = [0; 512];
                    let n = encode(&message, &mut frame).unwrap();
                    let _ = near.write(&frame[..n]);
                });
            }
        });
        let (_lost, to_reopen) = RingBuffer::new(1);
        let (back, _back) = RingBuffer::new(1);
        let expected = Expected::new(&path, &rig.rig, &Layout::single(0..4), 0);
        let peer = Peer { protocol: &HbotLink, expected };
        let over_too = Arc::clone(&over);
        let kept = Kept { path: path.into(), baud: rig.link.baud, peer, helper: None };
        let keeper = Keeper { kept, watched: None, lost: to_reopen, back, over: over_too };
        let (_, renewed) = keeper.find().unwrap();
        assert_eq!(renewed, Renewed { rebooted: true });
        over.store(true, Ordering::Relaxed);
        far_side.join().unwrap();
    }
}
