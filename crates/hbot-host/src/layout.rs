//! The place of each joint of the rig on the motor buses, and the offset from its count to the
//! rig's zero.

use hbot_config::RigConfig;
use hbot_config::rig::Port;
use hbot_core::MAX_JOINTS;

/// The place of each joint of a rig on the motor buses, and the offset of its zero. Signs and gear
/// ratios are not part of the layout, because the control law of hbot-core applies them.
#[derive(Debug, Clone)]
pub struct Layout {
    /// Bus and position of each joint of the rig. The order is steer, drive for each wheel in turn.
    pub places: Vec<JointPlace>,
    /// Encoder counts that are added to the count of each joint, so that the sum is zero at the
    /// rig's zero.
    pub offsets: [i32; MAX_JOINTS],
}

/// The place of a joint on the motor buses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct JointPlace {
    /// Number of the bus that carries the joint, from 0.
    pub bus: usize,
    /// Position of the joint among the joints of its bus, counted from 0.
    pub at: usize,
    /// Id of the motor controller on its bus. Joints that use hbot's own protocol have no ids. For
    /// them this is the position of the joint on its bus.
    pub id: u8,
}

impl Layout {
    /// Returns the layout that a rig file describes.
    #[must_use]
    pub fn of(rig: &RigConfig) -> Self {
        let mut offsets = [0; MAX_JOINTS];
        for (j, offset) in offsets.iter_mut().enumerate().take(rig.rig.device.joints()).step_by(2) {
            let counts = rig.zero_offsets[j] / rig.rig.joints[j].radians_per_count();
            // The offset wraps at 32 bits, as the controllers' own counters do.
            *offset = counts.round() as i64 as i32;
        }
        if rig.link.port == Port::Sim {
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

    /// Replaces the ids of the motor controllers by consecutive numbers. On each bus, the first
    /// controller has the id `first`. Returns the changed layout.
    #[must_use]
    pub fn numbered_from(mut self, first: u8) -> Self {
        for place in &mut self.places {
            place.id = first + place.at as u8;
        }
        self
    }

    /// Returns a layout with all joints on one bus and without offsets. `places` are in the order
    /// steer, drive of each wheel.
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

    /// Returns the joints on motor bus number `bus`: each joint's number in the rig, and its place
    /// on the bus.
    pub fn joints(&self, bus: usize) -> impl Iterator<Item = (usize, usize)> {
        self.on(bus).map(|(joint, place)| (joint, place.at))
    }

    /// Returns the joints on the bus with the number `bus`. Each joint is given as its index in the
    /// rig and its place on that bus.
    pub fn on(&self, bus: usize) -> impl Iterator<Item = (usize, &JointPlace)> {
        self.places.iter().enumerate().filter(move |(_, place)| place.bus == bus)
    }
}
