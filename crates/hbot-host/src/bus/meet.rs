//! Checks whether the controllers on a line are those of the rig, before the first tick and after a
//! lost line has been reopened.

use std::io;
use std::sync::atomic::AtomicI64;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use hbot_core::{MAX_JOINTS, Rig};
use thiserror::Error;

use super::Filtering;
use crate::line::Line;
use crate::rig::layout::{JointPlace, Layout};

/// How many times a question is sent without an answer before the controllers count as silent.
const TRIES: u32 = 10;
/// How long the host waits for an answer to each question.
const WAIT: Duration = Duration::from_millis(100);

/// Number of values that a driver can store about the controllers of one line: one for the line,
/// and two for each joint.
const NOTES: usize = 1 + 2 * MAX_JOINTS;

/// The reason why the controllers on a line were not accepted.
#[derive(Debug, Error)]
pub enum MeetError {
    /// The controllers did not answer in time.
    #[error(
        "no answer from the motor controllers on {port} within {} ms: check power and cable, and whether the rig file has their protocol and baud rate",
        u64::from(TRIES) * u64::try_from(WAIT.as_millis()).unwrap_or(0)
    )]
    Silent {
        /// Name of the serial port.
        port: String,
    },
    /// Reading from or writing to the line failed.
    #[error("serial port {port}: {error}")]
    Line {
        /// Name of the serial port.
        port: String,
        /// The error that the system reports.
        error: io::Error,
    },
    /// The controllers use another version of the protocol.
    #[error(
        "controllers speak version {theirs} of the link protocol, this server {ours}: update the older one"
    )]
    Version {
        /// Protocol version of the controllers.
        theirs: u16,
        /// Protocol version of this program.
        ours: u16,
    },
    /// The number of joints on the line differs from the rig file.
    #[error("the controllers on {port} have {theirs} joints, the rig file {ours} there: correct its wheels")]
    Joints {
        /// Name of the serial port.
        port: String,
        /// Number of joints that the controllers report.
        theirs: usize,
        /// Number of joints that the rig file has on this line.
        ours: usize,
    },
    /// An encoder has another number of counts per turn than the rig file states.
    #[error(
        "joint {joint}: its controller counts {theirs} a turn, the rig file says {ours}: correct counts_per_turn of \
         {field}"
    )]
    Counts {
        /// Number of the joint in the rig, from 1.
        joint: usize,
        /// The joint's table in the rig file, such as `wheel[0].steer`.
        field: String,
        /// Encoder counts per turn that the controller reports.
        theirs: u32,
        /// Encoder counts per turn in the rig file.
        ours: u32,
    },
    /// A setting of a controller makes torque commands impossible.
    #[error("{port}: {reason}")]
    Setting {
        /// Name of the serial port.
        port: String,
        /// What is wrong with the setting, and the command that corrects it.
        reason: String,
    },
}

/// The motor controllers that the rig file expects on one line.
#[derive(Debug, Clone)]
pub struct Expected {
    /// Name of the port, used in error messages.
    port: String,
    /// The expected joints, in their order on the bus.
    joints: Vec<ExpectedJoint>,
    /// Nominal time between ticks, ns.
    period_ns: u64,
    /// Numbers that the driver stores about the controllers. All clones of this value share them.
    notes: Arc<[AtomicI64; NOTES]>,
    /// Name and version of the firmware of each joint's controller, in the order of the bus. All
    /// clones of this value share them.
    firmware: Arc<Mutex<Vec<Option<String>>>>,
    /// The delays that the settings of each joint's controller cause, in the order of the bus. All
    /// clones of this value share them.
    filtering: Arc<Mutex<Vec<Filtering>>>,
}

/// One joint on a line, as the rig file describes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExpectedJoint {
    /// Number of the joint in the rig, from 0, in the order steer, drive of each wheel.
    pub number: usize,
    /// Id of the joint's controller on the bus: the key `controller` of the rig file. On the
    /// simulated line, ids follow the order of the joints. The joints of a bus are ordered by these
    /// ids.
    pub id: u8,
    /// Encoder counts per turn of the encoder.
    pub counts_per_turn: u32,
    /// Gear ratio: turns of the encoder per turn of the joint.
    pub gear: f64,
    /// Largest torque at the joint, N m. It is 0 for a joint without a motor.
    pub peak: f64,
}

impl Expected {
    /// Returns the controllers of `rig` that belong on bus number `bus` of `layout`. `port` is the
    /// name of the port for error messages.
    #[must_use]
    pub fn new(port: &str, rig: &Rig, layout: &Layout, bus: usize) -> Self {
        let mut joints: Vec<_> = layout.on(bus).collect();
        joints.sort_by_key(|(_, place)| place.at);
        let expected = |(number, place): (usize, &JointPlace)| {
            let joint = &rig.joints[number];
            ExpectedJoint {
                number,
                id: place.id,
                counts_per_turn: joint.counts_per_turn,
                gear: joint.gear,
                peak: joint.peak,
            }
        };
        let notes = Arc::new(std::array::from_fn(|_| AtomicI64::new(0)));
        let joints: Vec<_> = joints.into_iter().map(expected).collect();
        let firmware = Arc::new(Mutex::new(vec![None; joints.len()]));
        let filtering = Arc::new(Mutex::new(vec![Filtering::default(); joints.len()]));
        Self { port: port.to_owned(), joints, period_ns: rig.timing.period_ns, notes, firmware, filtering }
    }

    /// Returns the number of ticks that last `ms` milliseconds, rounded up. It is at least 1.
    #[must_use]
    pub fn ticks(&self, ms: u32) -> u32 {
        let ticks = (u64::from(ms) * 1_000_000).div_ceil(self.period_ns.max(1));
        u32::try_from(ticks).unwrap_or(u32::MAX).max(1)
    }

    /// Returns the name of the port.
    #[must_use]
    pub fn port(&self) -> &str {
        &self.port
    }

    /// Returns the number of joints on the line.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.joints.len()
    }

    /// Returns the joint at place `at` of the bus, from 0, or `None` if there is no such joint. A
    /// driver uses it to convert units if its controllers report turns, or angles of the motor
    /// shaft.
    #[must_use]
    pub fn joint(&self, at: usize) -> Option<&ExpectedJoint> {
        self.joints.get(at)
    }

    /// Returns a number that the driver can store about these controllers. `at` is from 0 to twice
    /// [`MAX_JOINTS`], and every note starts as 0. All clones share the notes, so the bus and the
    /// thread that reopens a lost line can read what [`meet`](super::Protocol::meet) has stored.
    ///
    /// # Panics
    /// Panics if `at` is greater than twice [`MAX_JOINTS`].
    #[must_use]
    pub fn note(&self, at: usize) -> &AtomicI64 {
        &self.notes[at]
    }

    /// Stores the name and the version of the firmware of the controller at place `at` of the bus,
    /// as text for people. [`meet`](super::Protocol::meet) calls it. All clones share the text, so
    /// that a line which comes back with other firmware is described correctly. Locks a mutex, so
    /// the loop must not call it.
    pub fn set_firmware(&self, at: usize, name: String) {
        let mut firmware = self.firmware.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(place) = firmware.get_mut(at) {
            *place = Some(name);
        }
    }

    /// Returns the name and the version of the firmware of the controller at place `at` of the bus,
    /// or `None` if they are not known. Locks a mutex, so the loop must not call it.
    #[must_use]
    pub fn firmware(&self, at: usize) -> Option<String> {
        self.firmware.lock().unwrap_or_else(PoisonError::into_inner).get(at)?.clone()
    }

    /// Stores the delays that the settings of the controller at place `at` of the bus cause.
    /// [`meet`](super::Protocol::meet) calls it if the protocol lets one read these settings. Locks
    /// a mutex, so the loop must not call it.
    pub fn set_filtering(&self, at: usize, it: Filtering) {
        let mut filtering = self.filtering.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(place) = filtering.get_mut(at) {
            *place = it;
        }
    }

    /// Returns the delays that the settings of the controller at place `at` of the bus cause, as
    /// far as they are known. Locks a mutex, so the loop must not call it.
    #[must_use]
    pub fn filtering(&self, at: usize) -> Filtering {
        let filtering = self.filtering.lock().unwrap_or_else(PoisonError::into_inner);
        filtering.get(at).cloned().unwrap_or_default()
    }

    /// Returns a copy without the last joint, for tests of drivers.
    #[must_use]
    pub fn without_last(&self) -> Self {
        let mut other = self.clone();
        other.joints.pop();
        other
    }

    /// Returns a copy whose last encoder has one more count per turn, for tests of drivers.
    #[must_use]
    pub fn with_other_counts(&self) -> Self {
        let mut other = self.clone();
        if let Some(joint) = other.joints.last_mut() {
            joint.counts_per_turn += 1;
        }
        other
    }

    /// Returns the place on the bus of the first joint whose encoder counts per turn differ from
    /// `theirs`, the numbers that the controllers report in the order of the bus. Returns `None` if
    /// all agree. Does not allocate memory.
    pub fn first_wrong_counts(&self, theirs: impl IntoIterator<Item = u32>) -> Option<usize> {
        theirs.into_iter().zip(&self.joints).position(|(theirs, joint)| theirs != joint.counts_per_turn)
    }

    /// Returns the error for a line that has `theirs` joints instead of the expected number.
    #[must_use]
    pub fn wrong_joints(&self, theirs: usize) -> MeetError {
        MeetError::Joints { port: self.port.clone(), theirs, ours: self.joints() }
    }

    /// Returns the error for a joint at place `at` whose controller reports `theirs` counts per
    /// turn.
    ///
    /// # Panics
    /// Panics if the bus has no joint at place `at`.
    #[must_use]
    pub fn wrong_counts(&self, at: usize, theirs: u32) -> MeetError {
        let ExpectedJoint { number, counts_per_turn: ours, .. } = self.joints[at];
        MeetError::Counts { joint: number + 1, field: field(number), theirs, ours }
    }
}

/// A controller that answered on a line, with what it reports about itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Id of the controller on the bus, or its place on the line if it has no id.
    pub id: u8,
    /// Name of the controller's model.
    pub model: String,
    /// Version of the controller's firmware and of the protocol that it uses.
    pub firmware: String,
    /// Supply voltage, V, if the controller reports it.
    pub supply_v: Option<f64>,
    /// How the controller knows its zero, if it reports this.
    pub zero: Option<&'static str>,
    /// The delays that its settings cause, as far as it reports them.
    pub filtering: Filtering,
    /// The settings of the controller that are wrong. Empty if all are right.
    pub remedies: Vec<Remedy>,
}

/// A wrong setting of a controller, and how to correct it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Remedy {
    /// What is wrong, and why it matters.
    pub what: String,
    /// The command of the vendor's tool, or the line of the rig file, that corrects it.
    pub command: String,
}

/// Returns the name of a joint's table in a rig file, such as `wheel[0].steer`. `joint` counts from
/// 0.
#[must_use]
pub fn field(joint: usize) -> String {
    format!("wheel[{}].{}", joint / 2, if joint.is_multiple_of(2) { "steer" } else { "drive" })
}

/// Writes `question` up to ten times, 100 ms apart, until `answer` returns a value for the received
/// bytes. Returns this value. The call blocks, so drivers must use it outside the loop only.
///
/// # Errors
/// Fails if no answer arrives, or if the line is lost.
pub fn converse<T>(
    line: &mut dyn Line,
    expected: &Expected,
    question: &[u8],
    mut answer: impl FnMut(&[u8]) -> Option<T>,
) -> Result<T, MeetError> {
    let failed = |error| MeetError::Line { port: expected.port.clone(), error };
    let mut buffer = [0; 512];
    for _ in 0..TRIES {
        // The time is 0 because this runs before the first tick: the time of a simulated line has
        // not started.
        line.write(0, question).map_err(failed)?;
        for _ in 0..WAIT.as_millis() {
            let got = line.read(0, &mut buffer).map_err(failed)?;
            if let Some(found) = answer(&buffer[..got]) {
                return Ok(found);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    Err(MeetError::Silent { port: expected.port.clone() })
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::Ordering;

    use super::*;

    fn expected(period_ns: u64) -> Expected {
        let config = hbot_config::RigConfig::prototype();
        let rig = config.rig.with(|parts| parts.timing.period_ns = period_ns).expect("legal");
        Expected::new("test", &rig, &Layout::single([3, 2, 1, 0]), 0)
    }

    #[test]
    fn a_time_is_rounded_up_to_whole_ticks() {
        for (period_ns, ms, ticks) in [
            (1_000_000, 20, 20),
            (250_000, 20, 80),
            (3_000_000, 20, 7),
            (3_000_000, 21, 7),
            (3_000_000, 22, 8),
            (20_000_000, 1, 1),
            (1_000_000, 0, 1),
        ] {
            assert_eq!(expected(period_ns).ticks(ms), ticks, "{ms} ms in ticks of {period_ns} ns");
        }
    }

    #[test]
    fn joints_have_the_order_of_the_bus_and_their_numbers_in_the_rig() {
        let expected = expected(1_000_000);
        let numbers: Vec<_> = (0..5).map(|at| expected.joint(at).map(|joint| joint.number)).collect();
        assert_eq!(numbers, [Some(3), Some(2), Some(1), Some(0), None]);
        let counts: Vec<_> = (0..4).filter_map(|at| Some(expected.joint(at)?.counts_per_turn)).collect();
        assert_eq!(expected.first_wrong_counts(counts.clone()), None);
        assert_eq!(expected.with_other_counts().first_wrong_counts(counts.clone()), Some(3));
        let more = expected.with_other_counts().joint(3).map(|joint| joint.counts_per_turn);
        assert_eq!(more, Some(counts[3] + 1));
        assert_eq!(expected.without_last().joints(), 3);
        for at in 0..4 {
            let mut other = counts.clone();
            other[at] += 4;
            assert_eq!(expected.first_wrong_counts(other), Some(at));
        }
        let text = expected.wrong_counts(1, 77).to_string();
        assert!(text.contains("joint 3") && text.contains("77") && text.contains("wheel[1].steer"), "{text}");
    }

    /// The bus and the thread that reopens a lost line have clones of what `meet` has filled in.
    #[test]
    fn clones_share_the_notes_and_the_firmware_of_each_controller() {
        let expected = expected(1_000_000);
        let clone = expected.clone();
        assert_eq!((expected.port(), expected.joints()), ("test", 4));
        // One note for the line, and one for each joint that a line can have.
        for at in 0..=MAX_JOINTS {
            assert_eq!(expected.note(at).swap(7 + at as i64, Ordering::Relaxed), 0, "note {at}");
        }
        for at in 0..=MAX_JOINTS {
            assert_eq!(clone.note(at).load(Ordering::Relaxed), 7 + at as i64, "note {at}");
        }
        let names = |of: &Expected| (0..5).map(|at| of.firmware(at)).collect::<Vec<_>>();
        let named = |name: &str| Some(name.to_owned());
        assert_eq!(names(&expected), vec![None::<String>; 5]);
        expected.set_firmware(0, "one 1.0".to_owned());
        clone.set_firmware(2, "two 2.0".to_owned());
        // There is no fifth joint on the line.
        expected.set_firmware(4, "five 5.0".to_owned());
        let both = [named("one 1.0"), None, named("two 2.0"), None, None];
        assert!(names(&expected) == both && names(&clone) == both, "{:?}", names(&clone));
        clone.set_firmware(0, "one 1.1".to_owned());
        assert_eq!(expected.firmware(0), named("one 1.1"), "the line came back with other firmware");
    }

    /// A line that answers the question number `answered`, counted from 1.
    struct Slow {
        asked: u32,
        answered: u32,
        reads: u32,
    }

    impl Line for Slow {
        fn read(&mut self, _now_ns: u64, buffer: &mut [u8]) -> io::Result<usize> {
            self.reads += 1;
            let answers = self.asked == self.answered;
            buffer[0] = 7;
            Ok(usize::from(answers))
        }

        fn write(&mut self, _now_ns: u64, bytes: &[u8]) -> io::Result<usize> {
            self.asked += 1;
            Ok(bytes.len())
        }
    }

    /// A question is repeated every 100 ms, ten times at most. This test takes some time because
    /// time is its subject.
    #[test]
    fn a_question_is_asked_ten_times_at_most() {
        for (answered, asked, reads) in [(1, 1, 1), (3, 3, 201), (11, 10, 1000)] {
            let mut line = Slow { asked: 0, answered, reads: 0 };
            let begun = std::time::Instant::now();
            let answer = converse(&mut line, &expected(1_000_000), b"?", |bytes| bytes.first().copied());
            assert_eq!((line.asked, line.reads), (asked, reads));
            let least = Duration::from_millis(u64::from(reads) - 1);
            assert!(begun.elapsed() >= least, "{reads} reads in {:?}", begun.elapsed());
            match answer {
                Ok(byte) => assert!(byte == 7 && answered <= 10),
                Err(error) => {
                    assert!(answered == 11 && error.to_string().contains("within 1000 ms"), "{error}")
                }
            }
        }
    }
}
