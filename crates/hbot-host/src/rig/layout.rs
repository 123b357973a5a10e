//! The place of each joint of the rig on the motor buses, and the offset from its count to the
//! rig's zero.

use hbot_config::RigConfig;
use hbot_core::MAX_JOINTS;

/// The place of each joint of a rig on the motor buses, and the offset of its zero. Signs and gear
/// ratios are not part of the layout, because the control law of hbot-core applies them.
#[derive(Debug, Clone)]
pub struct Layout {
    /// The place of each joint on the motor buses, in the order of the rig: steer, then drive, of
    /// each wheel.
    pub places: Vec<JointPlace>,
    /// Number that is added to the encoder count of each joint, so that the sum is zero at the zero
    /// of the rig.
    pub offsets: [i32; MAX_JOINTS],
}

/// The place of a joint on the motor buses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct JointPlace {
    /// Number of the bus that carries the joint, from 0.
    pub bus: usize,
    /// Index of the joint among the joints of its bus, from 0.
    pub at: usize,
    /// Id of the joint's motor controller on its bus. hbot's own protocol has no ids and uses the
    /// index `at` instead.
    pub id: u8,
}

impl Layout {
    /// Returns the layout that a rig file describes.
    #[must_use]
    pub fn of(rig: &RigConfig) -> Self {
        let mut offsets = [0; MAX_JOINTS];
        for (j, offset) in offsets.iter_mut().enumerate().take(rig.rig.device.joints()).step_by(2) {
            // The rest, less than a count, is in the rig's geometry. The offset wraps at 32 bits,
            // as the controllers' own counters do.
            *offset = rig.rig.joints[j].whole_counts(rig.zero_offsets[j]) as i64 as i32;
        }
        if rig.link.port.is_simulated() {
            // The simulated controllers are on one bus, in the order of the joints.
            let first = rig.link.protocol.ids().map_or(0, |ids| *ids.start() as u8);
            return Self { offsets, ..Self::single(0..rig.controllers.len()).numbered_from(first) };
        }
        let all = || rig.ports.iter().zip(&rig.controllers);
        let place = |(bus, id): (&usize, &usize)| {
            let at = all().filter(|(other, before)| *other == bus && *before < id).count();
            JointPlace { bus: *bus, at, id: *id as u8 }
        };
        Self { places: all().map(place).collect(), offsets }
    }

    /// Returns this layout with new controller ids. On each bus, the ids count up from `first`.
    #[must_use]
    pub fn numbered_from(mut self, first: u8) -> Self {
        for place in &mut self.places {
            place.id = first + place.at as u8;
        }
        self
    }

    /// Returns a layout with all joints on one bus and without zero offsets. `places` gives each
    /// joint's index on the bus, in the order steer, drive of each wheel.
    #[must_use]
    pub fn single(places: impl IntoIterator<Item = usize>) -> Self {
        let places = places.into_iter().map(|at| JointPlace { bus: 0, at, id: at as u8 }).collect();
        Self { places, offsets: [0; MAX_JOINTS] }
    }

    /// Returns the number of motor buses.
    #[must_use]
    pub fn buses(&self) -> usize {
        self.places.iter().map(|place| place.bus + 1).max().unwrap_or(0)
    }

    /// Returns the joints on motor bus number `bus` as pairs: the joint's number in the rig, and
    /// its index on the bus.
    pub fn joints(&self, bus: usize) -> impl Iterator<Item = (usize, usize)> {
        self.on(bus).map(|(joint, place)| (joint, place.at))
    }

    /// Returns the joints on motor bus number `bus` as pairs: the joint's number in the rig, and
    /// its place on the motor buses.
    pub fn on(&self, bus: usize) -> impl Iterator<Item = (usize, &JointPlace)> {
        self.places.iter().enumerate().filter(move |(_, place)| place.bus == bus)
    }
}
