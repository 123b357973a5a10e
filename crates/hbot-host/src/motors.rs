//! All motor buses of a rig as one set of joints, in the order of the rig.

use std::panic::{AssertUnwindSafe, catch_unwind};

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
    /// It has panicked. It is not asked again, so that a helper process, if it has one, speaks.
    broken: bool,
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
    ///
    /// # Panics
    /// Where there are more or fewer buses than `layout` has.
    #[must_use]
    pub fn new(buses: Vec<Box<dyn MotorBus>>, layout: &Layout, watchdog_ms: u16) -> Self {
        assert_eq!(buses.len(), layout.buses(), "a joint without a bus would never be commanded");
        let attach = |(number, bus)| Attached {
            bus,
            joints: layout.joints(number).collect(),
            answers: None,
            broken: false,
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

    /// Writes the command that switches the motors off to all buses, even if one of them panics.
    /// Returns how many did not take it whole.
    pub fn switch_off(&mut self, now_ns: u64, tick: u32) -> u64 {
        let command =
            BusCommand { tick, enable: false, watchdog_ms: self.watchdog_ms, torque: [0.0; MAX_JOINTS] };
        let mut refused = 0;
        for attached in self.buses.iter_mut().filter(|attached| !attached.broken) {
            let taken = catch_unwind(AssertUnwindSafe(|| attached.bus.command(now_ns, &command)));
            attached.broken = taken.is_err();
            refused += u64::from(!taken.unwrap_or(false));
        }
        refused
    }

    /// Tells all buses that their motors are off and that no command follows. May wait.
    pub fn release(&mut self) {
        for attached in self.buses.iter_mut().filter(|attached| !attached.broken) {
            attached.broken = catch_unwind(AssertUnwindSafe(|| attached.bus.release())).is_err();
        }
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

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;
    use crate::layout::Place;

    /// Notes what it is told; panics at every command if it is to.
    struct Noted(Arc<Mutex<Vec<String>>>, bool);

    impl MotorBus for Noted {
        fn receive(&mut self, _: u64, _: u32) -> Heard {
            Heard::default()
        }

        fn command(&mut self, _: u64, command: &BusCommand) -> bool {
            assert!(!self.1, "as a test asks");
            self.0.lock().unwrap().push(format!("{} {:?}", command.enable, &command.torque[..2]));
            true
        }

        fn release(&mut self) {
            self.0.lock().unwrap().push("released".to_owned());
        }
    }

    #[test]
    fn a_bus_that_panics_keeps_the_last_word_from_no_other() {
        let said = [Arc::default(), Arc::default()];
        let place = |bus, at| Place { bus, at, id: at as u8 };
        let layout =
            Layout { places: vec![place(0, 0), place(0, 1), place(1, 0), place(1, 1)], ..Layout::single([]) };
        let buses = said.iter().zip([true, false]);
        let buses =
            buses.map(|(said, panics)| Box::new(Noted(Arc::clone(said), panics)) as Box<dyn MotorBus>);
        let mut motors = Motors::new(buses.collect(), &layout, 20);
        assert_eq!((motors.switch_off(0, 1), motors.switch_off(0, 2)), (1, 0));
        motors.release();
        assert_eq!(*said[1].lock().unwrap(), ["false [0.0, 0.0]", "false [0.0, 0.0]", "released"]);
        // Not released: its helper, if it has one, speaks.
        assert!(said[0].lock().unwrap().is_empty());
    }
}
