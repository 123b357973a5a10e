//! The place of each joint of the rig on the motor buses, and the offset from its count to the
//! rig's zero.

use hbot_config::RigConfig;
use hbot_config::rig::Port;
use hbot_core::MAX_JOINTS;

/// The place of each joint of a rig on the motor buses, and the offset of its zero. Signs and gear
/// ratios are not part of the layout, because the control law of hbot-core applies them.
#[derive(Debug, Clone)]
pub struct Layout {
    /// Place of each joint, in the order steer, drive of each wheel.
    pub places: Vec<Place>,
    /// Encoder counts that are added to the count of each joint, so that the sum is zero at the
    /// rig's zero.
    pub offsets: [i32; MAX_JOINTS],
}

/// The place of a joint on the motor buses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Number of the bus that carries the joint, from 0.
    pub bus: usize,
    /// Place of the joint on that bus, from 0.
    pub at: usize,
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
            return Self { offsets, ..Self::single(0..rig.controllers.len()) };
        }
        let places = rig.ports.iter().zip(&rig.controllers).map(|(bus, at)| Place { bus: *bus, at: *at });
        Self { places: places.collect(), offsets }
    }

    /// Returns a layout with all joints on one bus and without offsets. `places` are in the order
    /// steer, drive of each wheel.
    #[must_use]
    pub fn single(places: impl IntoIterator<Item = usize>) -> Self {
        let places = places.into_iter().map(|at| Place { bus: 0, at }).collect();
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
        let all = self.places.iter().enumerate();
        all.filter(move |(_, place)| place.bus == bus).map(|(joint, place)| (joint, place.at))
    }
}
