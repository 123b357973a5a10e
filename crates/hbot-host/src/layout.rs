//! Which joint of the rig stands where on which motor bus, and what its count is where the rig has
//! its zero.

use hbot_config::RigConfig;
use hbot_config::rig::Port;
use hbot_core::MAX_JOINTS;

/// The place of every joint of a rig. Signs and gears are not here: the controller of hbot-core works
/// in the sense of the motor controllers and knows both.
#[derive(Debug, Clone)]
pub struct Layout {
    /// For each joint, in the order steer, drive of each wheel.
    pub places: Vec<Place>,
    /// What is added to the count of each joint, so that zero is where the rig has it.
    pub offsets: [i32; MAX_JOINTS],
}

/// Where a joint stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// The bus that carries it, from 0.
    pub bus: usize,
    /// Its place on that bus, from 0: the joints of a bus stand in the order of their ids.
    pub at: usize,
    /// The id of its controller on that bus. With hbot's own protocol, whose joints have none, its place.
    pub id: u8,
}

impl Layout {
    /// The layout of a rig file.
    #[must_use]
    pub fn of(rig: &RigConfig) -> Self {
        let mut offsets = [0; MAX_JOINTS];
        for (j, offset) in offsets.iter_mut().enumerate().take(rig.rig.device.joints()).step_by(2) {
            let counts = rig.zero_offsets[j] / rig.rig.joints[j].radians_per_count();
            // Wraps as the controllers' own counter does.
            *offset = counts.round() as i64 as i32;
        }
        if rig.link.port == Port::Sim {
            // The simulated controllers stand on one bus in the order of the joints.
            let first = rig.link.protocol.ids().map_or(0, |ids| *ids.start() as u8);
            return Self { offsets, ..Self::single(0..rig.controllers.len()).numbered_from(first) };
        }
        let all = || rig.ports.iter().zip(&rig.controllers);
        let place = |(bus, id): (&usize, &usize)| {
            let at = all().filter(|(other, before)| *other == bus && *before < id).count();
            Place { bus: *bus, at, id: *id as u8 }
        };
        Self { places: all().map(place).collect(), offsets }
    }

    /// With the ids of a bus that begin at `first` and follow one another.
    #[must_use]
    pub fn numbered_from(mut self, first: u8) -> Self {
        for place in &mut self.places {
            place.id = first + place.at as u8;
        }
        self
    }

    /// All joints on one bus: `places` in the order steer, drive of each wheel.
    #[must_use]
    pub fn single(places: impl IntoIterator<Item = usize>) -> Self {
        let places = places.into_iter().map(|at| Place { bus: 0, at, id: at as u8 }).collect();
        Self { places, offsets: [0; MAX_JOINTS] }
    }

    /// How many buses there are.
    #[must_use]
    pub fn buses(&self) -> usize {
        self.places.iter().map(|place| place.bus + 1).max().unwrap_or(0)
    }

    /// The joints of the rig on one bus, each with its place there.
    pub fn joints(&self, bus: usize) -> impl Iterator<Item = (usize, usize)> {
        self.on(bus).map(|(joint, place)| (joint, place.at))
    }

    /// The joints of the rig on one bus, each with where it stands.
    pub fn on(&self, bus: usize) -> impl Iterator<Item = (usize, &Place)> {
        self.places.iter().enumerate().filter(move |(_, place)| place.bus == bus)
    }
}
