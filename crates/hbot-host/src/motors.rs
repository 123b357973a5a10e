//! All motor buses of a rig as one set of joints, in the order of the rig.

use hbot_core::MAX_JOINTS;
use hbot_core::inputs::{Complaints, JointFeedback};
use hbot_core::outputs::Drive;

use crate::bus::{BusCommand, Heard, MotorBus, Reading};
use crate::layout::Layout;

/// Motors off.
pub(crate) const OFF: Drive = Drive { enable: false, torque: [0.0; MAX_JOINTS] };

/// Before anything is heard.
const NO_READINGS: JointFeedback = JointFeedback {
    sequence: 0,
    counts: [0; MAX_JOINTS],
    rates: [0.0; MAX_JOINTS],
    index_seen: 0,
    complaints: NO_COMPLAINTS,
};

const NO_COMPLAINTS: Complaints = Complaints {
    fault: false,
    watchdog: false,
    overcurrent: false,
    overtemperature: false,
    disobeyed: false,
    not_finite: false,
};

/// The motor buses of a rig.
pub struct Motors {
    buses: Vec<Attached>,
    offsets: [i32; MAX_JOINTS],
    watchdog_ms: u16,
    /// What the joints of all buses have said last, each in its own time.
    readings: JointFeedback,
}

/// One bus and what is known of it.
struct Attached {
    bus: Box<dyn MotorBus>,
    /// Each joint of the rig on it, with its place.
    joints: Vec<(usize, usize)>,
    /// The tick of the command that its newest reading answers.
    answers: Option<u32>,
    /// The line was reopened. Reported as an expired watchdog with the next reading, so that torque
    /// needs `reset` and `enable`.
    lost: bool,
}

/// What all buses have said since they were asked last.
#[derive(Debug, Clone, Copy, Default)]
pub struct News {
    /// The readings of all joints, as old as the oldest of them; `None` where nothing is new.
    pub feedback: Option<JointFeedback>,
    /// How many buses have brought a reading.
    pub buses_with_reading: usize,
    /// Damaged frames.
    pub damaged: u16,
    /// Frames that are not from these controllers.
    pub foreign: u64,
    /// Zeros may be lost on some bus.
    pub zeros_lost: bool,
    /// Lines that were gone and are back.
    pub reopened: u64,
}

impl Motors {
    /// `buses` in the order of the buses of `layout`. Controllers hold a command for `watchdog_ms`.
    #[must_use]
    pub fn new(buses: Vec<Box<dyn MotorBus>>, layout: &Layout, watchdog_ms: u16) -> Self {
        let attach = |(number, bus)| Attached {
            bus,
            joints: layout.joints(number).collect(),
            answers: None,
            lost: false,
        };
        Self {
            buses: buses.into_iter().enumerate().map(attach).collect(),
            offsets: layout.offsets,
            watchdog_ms,
            readings: NO_READINGS,
        }
    }

    /// How many buses there are.
    #[must_use]
    pub fn buses(&self) -> usize {
        self.buses.len()
    }

    /// Whether any bus has brought a reading yet.
    pub(crate) fn has_answered(&self) -> bool {
        self.buses.iter().any(|attached| attached.answers.is_some())
    }

    /// The readings of all joints, each as new as its bus has brought it.
    pub(crate) fn readings(&self) -> &JointFeedback {
        &self.readings
    }

    /// Reads what has arrived on all buses before the command of `tick` goes out. Never waits.
    pub fn receive(&mut self, now_ns: u64, tick: u32) -> News {
        let mut news = News::default();
        let mut complaints = Complaints::default();
        for attached in &mut self.buses {
            let heard = attached.bus.receive(now_ns, tick);
            news.damaged = news.damaged.saturating_add(heard.damaged);
            news.foreign += u64::from(heard.foreign);
            news.zeros_lost |= heard.zeros_lost;
            news.reopened += u64::from(heard.reopened);
            complaints = complaints.or(attached.complaints(&heard));
            if let Some(reading) = heard.reading {
                news.buses_with_reading += 1;
                attached.answers = Some(reading.answers);
                attached.place(&reading, &self.offsets, &mut self.readings);
            }
        }
        // The oldest answer tells how new all are together: what the core takes as news is news of
        // every joint. Complaints it takes in any case.
        let age = |answers: u32| tick.wrapping_sub(answers);
        let oldest = self.buses.iter().try_fold(tick, |oldest, attached| {
            attached.answers.map(|answers| if age(answers) > age(oldest) { answers } else { oldest })
        });
        if let Some(sequence) =
            oldest.filter(|_| news.buses_with_reading > 0 || complaints != Complaints::default())
        {
            self.readings.sequence = sequence;
            news.feedback = Some(JointFeedback { complaints, ..self.readings });
        }
        news
    }

    /// Writes the command of `tick` to all buses. Returns how many did not take it whole.
    pub fn command(&mut self, now_ns: u64, tick: u32, drive: &Drive) -> u64 {
        let mut refused = 0;
        for attached in &mut self.buses {
            let mut torque = [0.0; MAX_JOINTS];
            for (joint, at) in &attached.joints {
                torque[*at] = drive.torque[*joint];
            }
            let command = BusCommand { tick, enable: drive.enable, watchdog_ms: self.watchdog_ms, torque };
            refused += u64::from(!attached.bus.command(now_ns, &command));
        }
        refused
    }

    /// Tells all buses that their motors are off and that no command follows. May wait.
    pub fn release(&mut self) {
        self.buses.iter_mut().for_each(|attached| attached.bus.release());
    }
}

impl Attached {
    /// What a bus complains of. The first word after its line was gone is a complaint.
    fn complaints(&mut self, heard: &Heard) -> Complaints {
        self.lost |= heard.reopened;
        let says = heard.reading.is_some() || heard.complaints != Complaints::default();
        let lost = says && std::mem::take(&mut self.lost);
        Complaints { watchdog: heard.complaints.watchdog | lost, ..heard.complaints }
    }

    /// Puts a reading of this bus where the rig has its joints.
    fn place(&self, reading: &Reading, offsets: &[i32; MAX_JOINTS], readings: &mut JointFeedback) {
        for (joint, at) in &self.joints {
            let read = &reading.joints[*at];
            readings.counts[*joint] = read.count.wrapping_add(offsets[*joint]);
            readings.rates[*joint] = read.rate;
            let bit = 1 << joint;
            readings.index_seen &= !bit;
            if read.index_seen {
                readings.index_seen |= bit;
            }
        }
    }
}
