//! All motor buses of a rig as one set of joints, in the order of the rig.

use std::panic::{AssertUnwindSafe, catch_unwind};

use hbot_core::MAX_JOINTS;
use hbot_core::inputs::{Complaints, JointReadings};
use hbot_core::outputs::Drive;

use crate::bus::{BusCommand, Heard, MotorBus, Reading, Telemetry};
use crate::rig::layout::Layout;

/// The command that switches the motors off.
pub(crate) const OFF: Drive = Drive { enable: false, torque: [0.0; MAX_JOINTS] };

/// All motor buses of a rig. They are presented as one list of joints, in the order of the rig.
pub struct Motors {
    buses: Vec<Attached>,
    offsets: [i32; MAX_JOINTS],
    watchdog_ms: u16,
    /// The newest readings of the joints on all buses. Readings from different buses can differ in
    /// age.
    readings: JointReadings,
    /// The number of the joint whose telemetry was read last.
    turn: usize,
}

/// One motor bus of a rig, with its joints and its state.
struct Attached {
    bus: Box<dyn MotorBus>,
    /// The joints on this bus as pairs: the joint's number in the rig, and its index on the bus.
    joints: Vec<(usize, usize)>,
    /// The tick of the command that the newest reading of this bus answers, or `None` before the
    /// first reading.
    answers: Option<u32>,
    /// True if a call of the bus has panicked. The bus is then not called again, so that its helper
    /// process, if it has one, switches the motors off.
    broken: bool,
    /// Whether this bus last said that a motor is on or off against the command. This also counts
    /// in ticks in which only other buses answer.
    disobeyed: bool,
    /// Whether the line has taken a command of [`Motors::switch_off`] whole.
    off: bool,
}

/// Everything that all buses have received since the previous tick.
#[derive(Debug, Clone, Copy, Default)]
pub struct News {
    /// The newest readings of all joints, with the tick number of the oldest of them. `None` if no
    /// new reading has arrived.
    pub feedback: Option<JointReadings>,
    /// Number of buses that have delivered a new reading.
    pub buses_with_reading: usize,
    /// Number of damaged frames received.
    pub damaged: u16,
    /// Number of intact frames that came from other controllers or answer a command that was never
    /// sent.
    pub foreign: u64,
    /// True if the motor controllers of at least one bus may have lost the zeros of their joints.
    pub zeros_lost: bool,
    /// Number of lines that were lost and have been reopened.
    pub reopened: u64,
}

impl Motors {
    /// Combines the motor buses of a rig into one set of joints. `buses` must be in the order that
    /// `layout` gives them. If no further command arrives, the motor controllers switch their
    /// motors off after `watchdog_ms`, ms.
    ///
    /// # Panics
    /// Panics if the number of buses differs from that of `layout`.
    #[must_use]
    pub fn new(buses: Vec<Box<dyn MotorBus>>, layout: &Layout, watchdog_ms: u16) -> Self {
        assert_eq!(buses.len(), layout.buses(), "a joint without a bus would never be commanded");
        let attach = |(number, bus)| Attached {
            bus,
            joints: layout.joints(number).collect(),
            answers: None,
            broken: false,
            disobeyed: false,
            off: false,
        };
        Self {
            buses: buses.into_iter().enumerate().map(attach).collect(),
            offsets: layout.offsets,
            watchdog_ms,
            readings: JointReadings::new(0, [0; MAX_JOINTS], [0.0; MAX_JOINTS]),
            turn: 0,
        }
    }

    /// Returns the number of motor buses.
    #[must_use]
    pub fn buses(&self) -> usize {
        self.buses.len()
    }

    /// Returns whether any bus has delivered a reading yet.
    pub(crate) fn has_answered(&self) -> bool {
        self.buses.iter().any(|attached| attached.answers.is_some())
    }

    /// Returns the newest readings of all joints. Readings from different buses can differ in age.
    pub(crate) fn readings(&self) -> &JointReadings {
        &self.readings
    }

    /// Returns the number of a joint, and what its controller last reported about itself. Each call
    /// returns the next joint. The turn does not follow the number of the tick: if a slow loop
    /// skips every second tick, half of the joints would never have their turn.
    pub(crate) fn next_telemetry(&mut self, now_ns: u64) -> (usize, Telemetry) {
        let joints: usize = self.buses.iter().map(|attached| attached.joints.len()).sum();
        self.turn = (self.turn + 1) % joints.max(1);
        let told = self.buses.iter().find_map(|attached| {
            let (_, at) = attached.joints.iter().find(|(joint, _)| *joint == self.turn)?;
            Some(attached.bus.telemetry(now_ns, *at))
        });
        (self.turn, told.unwrap_or_default())
    }

    /// Reads all bytes that have arrived on all buses. The control loop calls this function before
    /// it sends the command of the tick number `tick`. Never waits.
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
                news.zeros_lost |= attached.place(&reading, &self.offsets, &mut self.readings);
            }
        }
        complaints.disobeyed |=
            news.buses_with_reading > 0 && self.buses.iter().any(|attached| attached.disobeyed);
        // The oldest answer defines the age of the combined reading. The core treats a reading as
        // new only if all of its joints are new. Once every bus has answered, complaints take
        // effect without a new one.
        let age = |answers: u32| tick.wrapping_sub(answers);
        let oldest = self.buses.iter().try_fold(tick, |oldest, attached| {
            attached.answers.map(|answers| if age(answers) > age(oldest) { answers } else { oldest })
        });
        if let Some(sequence) =
            oldest.filter(|_| news.buses_with_reading > 0 || complaints != Complaints::default())
        {
            self.readings.sequence = sequence;
            news.feedback.insert(self.readings).complaints = complaints;
        }
        news
    }

    /// Writes the command of the tick number `tick` to all buses. Returns how many buses did not
    /// accept it completely.
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

    /// Commands all buses to switch their motors off. If one of the buses panics, the others still
    /// get the command. Returns how many buses did not accept it completely.
    pub fn switch_off(&mut self, now_ns: u64, tick: u32) -> u64 {
        let command =
            BusCommand { tick, enable: false, watchdog_ms: self.watchdog_ms, torque: [0.0; MAX_JOINTS] };
        let mut refused = 0;
        for attached in self.buses.iter_mut().filter(|attached| !attached.broken) {
            let taken = catch_unwind(AssertUnwindSafe(|| attached.bus.command(now_ns, &command)));
            attached.broken = taken.is_err();
            let taken = taken.unwrap_or(false);
            attached.off |= taken;
            refused += u64::from(!taken);
        }
        refused
    }

    /// Informs all buses whose line has taken a command of [`switch_off`](Self::switch_off) that
    /// their motors are off and that no command follows. The helper processes of the others switch
    /// the motors off when the buses are dropped. This call can block.
    pub fn release(&mut self) {
        for attached in self.buses.iter_mut().filter(|attached| attached.off && !attached.broken) {
            attached.broken = catch_unwind(AssertUnwindSafe(|| attached.bus.release())).is_err();
        }
    }
}

impl Attached {
    /// Returns the complaints of the motor controllers on this bus. A line that was lost and
    /// reopened also reports an expired watchdog, so that torque returns only after `reset` and
    /// `enable`.
    fn complaints(&mut self, heard: &Heard) -> Complaints {
        if heard.reading.is_some() || heard.complaints != Complaints::default() {
            self.disobeyed = heard.complaints.disobeyed;
        }
        Complaints { watchdog: heard.complaints.watchdog | heard.reopened, ..heard.complaints }
    }

    /// Copies the joints of a reading from this bus into `readings`, which has the order of the
    /// rig, and adds the zero offset of each joint to its encoder count. Returns whether a joint
    /// that had seen its index no longer has, so its counts have another zero.
    fn place(&self, reading: &Reading, offsets: &[i32; MAX_JOINTS], readings: &mut JointReadings) -> bool {
        let before = readings.index_seen;
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
        before & !readings.index_seen != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::layout::JointPlace;
    use crate::tests::scripted::ScriptedBus;

    #[test]
    fn a_bus_that_panics_keeps_the_last_word_from_no_other() {
        let [first, second] = [ScriptedBus::default(), ScriptedBus::default()];
        first.script().panics = true;
        let place = |bus, at| JointPlace { bus, at, id: at as u8 };
        let layout =
            Layout { places: vec![place(0, 0), place(0, 1), place(1, 0), place(1, 1)], ..Layout::single([]) };
        let buses = [&first, &second].map(|bus| Box::new(bus.clone()) as Box<dyn MotorBus>);
        let mut motors = Motors::new(buses.into(), &layout, 20);
        assert_eq!((motors.switch_off(0, 1), motors.switch_off(0, 2)), (1, 0));
        motors.release();
        let off =
            second.script().commands.iter().all(|(it, ..)| !it.enable && it.torque == [0.0; MAX_JOINTS]);
        assert!(off && second.script().commands.len() == 2 && second.script().released == 1);
        // It is not released, so its helper process, if any, writes the last word.
        assert_eq!(first.script().released, 0);
    }
}
