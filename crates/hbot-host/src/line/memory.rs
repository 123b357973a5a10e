//! A line to the simulated rig in memory, for virtual time. It carries the bytes that a serial line
//! would carry.

use std::io;
use std::sync::mpsc::Receiver;

use hbot_sim::rig::SimulatedRig;

use super::Line;

/// A function that is run on the simulated rig between two ticks.
pub type SimulatorCall = Box<dyn FnOnce(&mut SimulatedRig) + Send>;

/// Capacity of the receive buffer, bytes. It has room for everything that an impaired line can
/// deliver at once, so that the loop never allocates memory.
const INBOX: usize = 256 * 1024;

/// A line to a simulated rig that runs in the same process in virtual time. It needs no serial
/// port.
pub struct Memory {
    rig: SimulatedRig,
    calls: Receiver<SimulatorCall>,
    inbox: Vec<u8>,
    read: usize,
    /// Offset from the caller's time to the line's time, ns. It grows whenever the caller's time
    /// starts again from 0, as it does between the check of the motor controllers and the first
    /// tick.
    base_ns: u64,
    /// The time that the caller gave in its last call, ns.
    last_ns: u64,
}

impl Memory {
    /// Returns a line to `rig`. Functions that are sent through the channel `calls` are run on the
    /// rig before the next bytes are written.
    #[must_use]
    pub fn new(rig: SimulatedRig, calls: Receiver<SimulatorCall>) -> Self {
        Self { rig, calls, inbox: Vec::with_capacity(INBOX), read: 0, base_ns: 0, last_ns: 0 }
    }

    /// Converts the caller's time `now_ns` to the line's time, in ns. The caller's time can start
    /// again from 0; the line's time never goes back. For this, the function stores the caller's
    /// last time.
    fn time(&mut self, now_ns: u64) -> u64 {
        if now_ns < self.last_ns {
            self.base_ns += self.last_ns;
        }
        self.last_ns = now_ns;
        self.base_ns + now_ns
    }
}

impl Line for Memory {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> io::Result<usize> {
        let now_ns = self.time(now_ns);
        // Fetches bytes that an impaired line has delayed and that are due before this tick.
        if self.rig.next_arrival_ns().is_some_and(|at_ns| at_ns < now_ns) {
            self.rig.deliver(now_ns, &mut self.inbox);
        }
        let waiting = &self.inbox[self.read..];
        let n = waiting.len().min(buffer.len());
        buffer[..n].copy_from_slice(&waiting[..n]);
        self.read += n;
        if self.read == self.inbox.len() {
            self.inbox.clear();
            self.read = 0;
        }
        Ok(n)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> io::Result<usize> {
        for call in self.calls.try_iter() {
            call(&mut self.rig);
        }
        let now_ns = self.time(now_ns);
        self.rig.receive(now_ns, bytes, &mut self.inbox);
        Ok(bytes.len())
    }

    fn pause(&mut self) {}
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use hbot_config::RigConfig;
    use hbot_link::{Command, MAX_COMMAND_FRAME, ToController, encode};
    use hbot_sim::phenomena::Link;
    use hbot_testing::prototype::simulated;

    use super::*;
    use crate::bus::drivers::odrive::Odrive;
    use crate::bus::{Expected, Protocol as _};
    use crate::rig::attach::simulated_rig;
    use crate::rig::layout::Layout;

    const MS: u64 = 1_000_000;
    /// An impaired line that neither delays, loses nor damages frames. Tests add a delay.
    const EXACT: Link =
        Link { latency_s: 0.0, command_latency_s: 0.0, jitter_s: 0.0, loss: 0.0, corrupt: 0.0, seed: 1 };

    fn line() -> Memory {
        Memory::new(simulated(), mpsc::channel().1)
    }

    fn frame(message: &ToController) -> Vec<u8> {
        let mut frame = [0; MAX_COMMAND_FRAME];
        let n = encode(message, &mut frame).expect("it fits");
        frame[..n].to_vec()
    }

    /// The caller's time begins again at 5 ms and at 40 ms. Whatever time it gives then, the rig is
    /// simulated for the time that has passed.
    #[test]
    fn the_time_of_the_rig_goes_on_where_that_of_the_caller_begins_again() {
        let mut line = line();
        for (now_ms, simulated_ms) in [
            (0, 0.0),
            (1, 1.0),
            (2, 2.0),
            (5, 5.0),
            (0, 5.0),
            (0, 5.0),
            (3, 8.0),
            (3, 8.0),
            (40, 45.0),
            (10, 55.0),
            (12, 57.0),
        ] {
            line.write(now_ms * MS, &[]).expect("it is open");
            let simulated = 1000.0 * line.rig.simulated_s();
            assert!((simulated - simulated_ms).abs() < 1e-9, "{simulated} ms at {now_ms} ms");
        }
    }

    #[test]
    fn bytes_are_read_once_and_in_order_in_pieces_of_any_size() {
        let question = frame(&ToController::Describe);
        let ask = |line: &mut Memory| line.write(0, &question).expect("it is open");
        let read = |line: &mut Memory, size: usize| {
            let mut piece = vec![0; size];
            let n = line.read(0, &mut piece).expect("it is open");
            piece.truncate(n);
            piece
        };
        let mut line = line();
        assert_eq!(ask(&mut line), question.len());
        let whole = read(&mut line, 4096);
        assert!(whole.len() > 20, "{whole:?}");
        assert!(read(&mut line, 4096).is_empty());
        for size in [1, 7, whole.len() - 1] {
            ask(&mut line);
            let mut all = Vec::new();
            while all.len() <= whole.len() {
                let piece = read(&mut line, size);
                if piece.is_empty() {
                    break;
                }
                all.extend(piece);
            }
            assert_eq!(all, whole, "pieces of {size} bytes");
        }
    }

    /// An answer that comes exactly at the time of a tick is read in the next one.
    #[test]
    fn an_answer_that_arrives_before_a_tick_is_read_in_this_tick() {
        for (delay_s, tick) in [(0.0004, 1), (0.001, 2), (0.0016, 2), (0.002, 3)] {
            let mut line = line();
            line.rig.set_link(Some(Link { command_latency_s: delay_s, ..EXACT }));
            line.write(0, &frame(&ToController::Describe)).expect("it is open");
            let found = (1..10_u64).find(|tick| {
                let n = line.read(tick * MS, &mut [0; 4096]).expect("it is open");
                line.write(tick * MS, &[]).expect("it is open");
                n > 0
            });
            assert_eq!(found, Some(tick), "after {delay_s} s");
        }
    }

    /// ODrives send messages without being asked. One that is sent exactly at the time of a tick is
    /// read in the next one, as on a real line.
    #[test]
    fn a_message_that_nobody_asked_for_is_read_in_the_first_tick_after_it() {
        let file = include_str!("../../../../rigs/prototype-odrive.toml");
        let rig = RigConfig::from_toml(file, "prototype-odrive.toml").expect("a legal rig");
        let simulated = simulated_rig(&rig, Default::default()).expect("it can be simulated");
        let mut line = Memory::new(simulated, mpsc::channel().1);
        let expected = Expected::new("test", &rig.rig, &Layout::of(&rig), 0);
        Odrive.meet(&mut line, &expected).expect("they are those of the rig");
        let mut buffer = [0; 4096];
        // The time of the next message is that of the rig, and the line adds `base_ns` to ours.
        let next_ns = |line: &Memory| line.rig.next_arrival_ns().expect("they report") - line.base_ns;
        // What was sent up to now is read first.
        let now_ns = line.last_ns;
        line.write(now_ns, &[]).expect("it is open");
        while line.read(now_ns, &mut buffer).expect("it is open") > 0 {}

        let sent_ns = next_ns(&line);
        assert!(sent_ns > now_ns, "{sent_ns} ns after {now_ns} ns");
        assert_eq!(line.read(sent_ns, &mut buffer).expect("it is open"), 0);
        line.write(sent_ns, &[]).expect("it is open");
        assert!(line.read(sent_ns + 1, &mut buffer).expect("it is open") > 0);
        // The next message is read before anything is written.
        let sent_ns = next_ns(&line);
        assert!(line.read(sent_ns + 1, &mut buffer).expect("it is open") > 0);
    }

    /// After a pause of the caller, everything that was on its way arrives at once.
    #[test]
    fn nine_hundred_answers_at_once_allocate_no_memory() {
        let mut line = line();
        line.rig.set_link(Some(Link { latency_s: 0.1, ..EXACT }));
        let mut off = Command { watchdog_ms: 100, ..Command::default() };
        off.torque.resize(4, 0.0).expect("a place for each joint");
        let off = frame(&ToController::Command(off));
        for k in 0..900 {
            line.write(k * MS / 10, &off).expect("it is open");
        }
        let (mut buffer, mut bytes) = ([0; 4096], 0);
        let measured = allocation_counter::measure(|| {
            loop {
                let n = line.read(300 * MS, &mut buffer).expect("it is open");
                if n == 0 {
                    break;
                }
                bytes += n;
            }
        });
        assert_eq!((measured.count_total, measured.count_current), (0, 0));
        assert!(bytes > 900 * 20, "{bytes} bytes");
    }
}
