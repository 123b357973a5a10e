//! The thread that reopens a lost line.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};

use super::{Held, LOOK, Peer, Serial, open, unguarded};
use crate::line::Renewed;
use crate::rig::last_word::{LastWord, Program, Watched};

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
        let port = open(path, *baud).map_err(|error| error.to_string())?;
        let mut line = Serial::holding(port);
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
    use std::os::fd::OwnedFd;
    use std::os::unix::net::UnixStream;
    use std::sync::Mutex;
    use std::sync::atomic::AtomicUsize;
    use std::thread::JoinHandle;
    use std::time::Instant;

    use hbot_config::RigConfig;
    use hbot_link::{Decoder, FromController, encode};
    use hbot_testing::far::open_plainly;
    use hbot_testing::log::Listener;
    use hbot_testing::patience::{eventually, until};
    use hbot_testing::prototype::simulated_as;
    use rustix::termios::ioctl_tiocnxcl;
    use serialport::{SerialPort as _, TTYPort};

    use super::super::tests::port;
    use super::*;
    use crate::bus::{Expected, Found, MeetError, MotorBus, Protocol, Traffic, drivers::hbot::HbotLink};
    use crate::line::Line;
    use crate::rig::layout::Layout;

    /// A protocol whose attempts to switch the motors off fail for the reasons that a test gives,
    /// one after the other.
    #[derive(Debug)]
    struct Scripted {
        reasons: &'static [&'static str],
        attempts: AtomicUsize,
        /// Is set at the last of the reasons: the control loop then no longer needs the line.
        over: Arc<AtomicBool>,
        /// Another descriptor of the port.
        port: OwnedFd,
    }

    impl Protocol for Scripted {
        fn meet(&self, _: &mut dyn Line, _: &Expected) -> Result<(), MeetError> {
            Ok(())
        }

        fn switch_off(&self, _: &mut dyn Line, expected: &Expected) -> Result<bool, MeetError> {
            // Half of the stack of the thread: a driver can have large buffers.
            let mut buffers = [0_u8; STACK_OF_A_DRIVER];
            std::hint::black_box(&mut buffers);
            // This process has the port open, so its exclusive use would outlast the attempt.
            ioctl_tiocnxcl(&self.port).expect("a terminal");
            let attempt = self.attempts.fetch_add(1, Ordering::Relaxed);
            let Some(reason) = self.reasons.get(attempt) else { return Ok(false) };
            if attempt + 1 == self.reasons.len() {
                self.over.store(true, Ordering::Relaxed);
            }
            Err(MeetError::Setting { port: expected.port().to_owned(), reason: (*reason).to_owned() })
        }

        fn off_bytes(&self, _: &Expected) -> Vec<u8> {
            Vec::new()
        }

        fn bus(&self, line: Box<dyn Line>, expected: Expected) -> Box<dyn MotorBus> {
            HbotLink.bus(line, expected)
        }

        fn scan(&self, _: &mut dyn Line, _: &Expected) -> Result<Vec<Found>, MeetError> {
            Ok(Vec::new())
        }

        fn traffic(&self, joints: usize) -> Traffic {
            HbotLink.traffic(joints)
        }
    }

    const STACK_OF_A_DRIVER: usize = 128 * 1024;

    fn scripted(
        path: &str,
        reasons: &'static [&'static str],
        over: &Arc<AtomicBool>,
    ) -> &'static dyn Protocol {
        let (attempts, over, port) = (AtomicUsize::new(0), Arc::clone(over), open_plainly(path));
        Box::leak(Box::new(Scripted { reasons, attempts, over, port }))
    }

    fn kept(path: &str, protocol: &'static dyn Protocol) -> Kept {
        let rig = RigConfig::prototype();
        let expected = Expected::new(path, &rig.rig, &Layout::single(0..4), 0);
        Kept { path: path.into(), baud: rig.link.baud, peer: Peer { protocol, expected }, helper: None }
    }

    /// Returns a keeper whose loop has not lost its line.
    fn keeper(kept: Kept, watched: Option<Watched>, over: &Arc<AtomicBool>) -> Keeper {
        let (_, lost) = RingBuffer::new(1);
        let (back, _) = RingBuffer::new(1);
        Keeper { kept, watched, lost, back, over: Arc::clone(over) }
    }

    /// Starts `work` in a thread. Returns the thread and the log messages of it.
    fn logged<T: Send + 'static>(
        work: impl FnOnce() -> T + Send + 'static,
    ) -> (JoinHandle<T>, Arc<Mutex<Vec<String>>>) {
        let said = Arc::<Mutex<Vec<String>>>::default();
        let heard = Arc::clone(&said);
        // With a single subscriber, `tracing` caches for each log statement whether the first
        // thread that reaches it has the subscriber. That can be a thread of another test, without
        // one. A second subscriber disables this shortcut.
        let second = tracing::Dispatch::new(tracing::subscriber::NoSubscriber::default());
        let log = tracing::Dispatch::new(Listener(move |text| heard.lock().expect("no panic").push(text)));
        let thread = std::thread::spawn(move || {
            let _second = second;
            let _log = tracing::dispatcher::set_default(&log);
            work()
        });
        (thread, said)
    }

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
        let port = open_plainly(&path);
        let far_side = std::thread::spawn(move || {
            let _far = far;
            let (mut buffer, mut reply, mut decoder) =
                ([0; 4096], Vec::new(), Decoder::<FromController>::new());
            let (start, mut first) = (Instant::now(), None);
            while !stop.load(Ordering::Relaxed) {
                // This process has the port open, so the exclusive use of an attempt would outlast
                // it. Only root may then open the port again.
                ioctl_tiocnxcl(&port).expect("a terminal");
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
        let (_, renewed) = keeper(kept(&path, &HbotLink), None, &over).find().unwrap();
        assert_eq!(renewed, Renewed { rebooted: true });
        over.store(true, Ordering::Relaxed);
        far_side.join().unwrap();
    }

    /// A line can be away for hours, and an attempt is made every two seconds.
    #[test]
    fn only_a_new_reason_is_logged_and_the_search_ends_with_the_need_for_the_line() {
        let (_pty, path) = port();
        let over = Arc::new(AtomicBool::new(false));
        let reasons = &["no supply", "no supply", "no brake resistor"];
        let keeper = keeper(kept(&path, scripted(&path, reasons, &over)), None, &over);
        let begun = Instant::now();
        let (search, said) = logged(move || keeper.find().is_some());
        eventually("the search ends", || search.is_finished());
        assert!(!search.join().unwrap(), "the line is back although nobody needs it");
        // The pauses before the three attempts are 100, 200 and 400 ms.
        assert!(begun.elapsed() >= Duration::from_millis(700), "{:?}", begun.elapsed());
        let said = said.lock().unwrap();
        assert_eq!(said.len(), 2, "{said:#?}");
        for (text, reason) in said.iter().zip([reasons[0], reasons[2]]) {
            assert!(text.contains(&path) && text.contains(reason), "{text}");
        }
    }

    #[test]
    fn a_helper_that_ends_by_itself_is_a_warning() {
        let (_pty, path) = port();
        let mut line = Serial::open(&path, 115_200).unwrap();
        // This helper reports that it is ready, reads the frame with its length byte, and ends.
        let helper = Program::shell("printf '\\002' >&2; head -c 5 >/dev/null");
        line.guard(&helper, &[0, 7, 7, 0]).unwrap();
        let over = Arc::new(AtomicBool::new(false));
        let keeper = keeper(kept(&path, &HbotLink), line.watched(), &over);
        let (thread, said) = logged(move || keeper.run());
        let warned = |text: &String| text.contains(&path) && text.contains("the helper process has ended");
        eventually("a warning", || said.lock().unwrap().iter().any(warned));
        over.store(true, Ordering::Relaxed);
        thread.join().unwrap();
    }

    /// The thread opens the port again within the stack that it has, and ends with its line.
    #[test]
    fn the_thread_of_a_line_has_room_for_a_driver_and_ends_with_the_line() {
        let (_pty, path) = port();
        let over = Arc::new(AtomicBool::new(false));
        let mut reopening = keep(kept(&path, scripted(&path, &[], &over)), None).unwrap();
        let (dead, _) = UnixStream::pair().unwrap();
        assert!(reopening.lost.push(Held { last_word: None, line: dead.into(), _port: None }).is_ok());
        let (_, renewed) = until("the line is back", || reopening.back.pop().ok());
        assert_eq!(renewed, Renewed { rebooted: false });
        let lost = std::mem::replace(&mut reopening.lost, RingBuffer::new(1).0);
        assert!(!lost.is_abandoned(), "the thread waits for the next loss");
        drop(reopening);
        eventually("the thread ends", || lost.is_abandoned());
    }
}
