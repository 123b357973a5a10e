//! Four simulated joints, each with a motor, an inertia, viscous friction and an encoder.

use core::f32::consts::TAU;

use hbot_device::{Joint, JointReading, Joints};

/// Steer and drive of two wheels, as in `rig.toml`.
pub const JOINTS: [Joint; 4] = [STEER.joint, DRIVE.joint, STEER.joint, DRIVE.joint];

/// The constant properties of a simulated joint.
struct Mechanics {
    joint: Joint,
    /// Turns of the encoder in one turn of the joint.
    gear: f32,
    /// Moment of inertia at the joint, kg m².
    inertia: f32,
    /// Viscous friction, N m s/rad. It is large, so that a spring is stable even if the host's
    /// loop is late by 0.2 s on a busy machine.
    friction: f32,
}

const STEER: Mechanics = Mechanics {
    joint: Joint { counts_per_turn: 16384, peak: 0.93, max_temperature: 80.0 },
    gear: 1.0,
    inertia: 5e-3,
    friction: 5e-2,
};
const DRIVE: Mechanics = Mechanics {
    joint: Joint { counts_per_turn: 16384, peak: 0.14, max_temperature: 80.0 },
    gear: 17.0,
    inertia: 1e-3,
    friction: 2e-2,
};

/// Temperature that the motors report, in degrees Celsius.
const TEMPERATURE: f32 = 25.0;
/// Longest time by which the joints move on at once, µs. A longer gap, such as a halt in a
/// debugger, does not move them.
const LONGEST_STEP_US: u32 = 20_000;

/// One joint: its torque, N m, its rate, rad/s, and its encoder.
#[derive(Clone, Copy)]
struct Axis {
    torque: f32,
    rate: f32,
    count: i32,
    /// Part of a count by which the encoder is further than `count`, from 0 to 1.
    fraction: f32,
}

impl Axis {
    /// Moves the joint on by `h` seconds.
    fn advance(&mut self, h: f32, it: &Mechanics) {
        self.rate += h * (self.torque - it.friction * self.rate) / it.inertia;
        let turns = h * self.rate * it.gear / TAU;
        let counts = self.fraction + turns * it.joint.counts_per_turn as f32;
        // The cast rounds towards zero, the encoder rounds down.
        let mut whole = counts as i32;
        if whole as f32 > counts {
            whole -= 1;
        }
        self.fraction = counts - whole as f32;
        self.count = self.count.wrapping_add(whole);
    }
}

/// The simulated joints.
pub struct Plant {
    axes: [Axis; 4],
    now_us: u32,
}

impl Plant {
    /// Creates joints at rest, whose encoders read zero.
    pub const fn new(now_us: u32) -> Self {
        Self { axes: [Axis { torque: 0.0, rate: 0.0, count: 0, fraction: 0.0 }; 4], now_us }
    }

    /// Moves the joints on to the time `now_us`, under the torques that they have.
    pub fn advance(&mut self, now_us: u32) {
        let step_us = now_us.wrapping_sub(self.now_us).min(LONGEST_STEP_US);
        self.now_us = now_us;
        let h = step_us as f32 * 1e-6;
        for (axis, mechanics) in self.axes.iter_mut().zip([STEER, DRIVE, STEER, DRIVE]) {
            axis.advance(h, &mechanics);
        }
    }
}

impl Joints for Plant {
    fn read(&mut self, readings: &mut [JointReading]) {
        for (reading, axis) in readings.iter_mut().zip(&self.axes) {
            reading.count = axis.count;
            reading.rate = axis.rate;
            reading.temperature = TEMPERATURE;
        }
    }

    fn drive(&mut self, torque: &[f32], _: bool) {
        for (axis, torque) in self.axes.iter_mut().zip(torque) {
            axis.torque = *torque;
        }
    }
}
