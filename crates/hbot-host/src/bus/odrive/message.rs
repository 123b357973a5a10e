//! CANSimple, the messages of an ODrive on CAN, as far as the driver needs them.
//!
//! The id of a frame is the id of the axis, six bits, and that of the message, five. Numbers are
//! little-endian, floats IEEE 754. Source: the vendor's CAN protocol page and the DBC of firmware
//! 0.6.10, from which `tests/golden/odrive.txt` is made.

use super::slcan::Frame;

/// States of an axis.
pub mod state {
    /// After power-on, before its firmware has started.
    pub const UNDEFINED: u8 = 0;
    /// The motor is off.
    pub const IDLE: u8 = 1;
    /// The motor does as commanded.
    pub const CLOSED_LOOP: u8 = 8;
}

/// Bits of an axis's errors.
pub mod error {
    /// The firmware has not started yet.
    pub const INITIALIZING: u32 = 1;
    /// More current from the supply than is allowed.
    pub const DC_BUS_OVER_CURRENT: u32 = 1 << 10;
    /// More current in the motor than is allowed.
    pub const CURRENT_LIMIT_VIOLATION: u32 = 1 << 12;
    /// The motor is too hot.
    pub const MOTOR_OVER_TEMP: u32 = 1 << 13;
    /// The power stage is too hot.
    pub const INVERTER_OVER_TEMP: u32 = 1 << 14;
    /// Nothing was heard for the time of the watchdog.
    pub const WATCHDOG_TIMER_EXPIRED: u32 = 1 << 24;
}

/// What an axis says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Message {
    /// Who it is.
    Version {
        /// Of CANSimple.
        protocol: u8,
        /// Major, minor, variant of the board.
        hardware: [u8; 3],
        /// Major, minor, revision of the firmware.
        firmware: [u8; 3],
    },
    /// How it is; sent cyclically.
    Heartbeat {
        /// Bits of [`error`].
        error: u32,
        /// One of [`state`].
        state: u8,
        /// How the last change of state ended; 0 is good.
        result: u8,
    },
    /// Its errors.
    Errors {
        /// Bits of [`error`] that hold.
        active: u32,
        /// Bits of [`error`] that have switched the motor off last.
        disarm_reason: u32,
    },
    /// Where it is; sent cyclically.
    Estimates {
        /// Turns of the encoder.
        position: f32,
        /// Turns of the encoder a second.
        velocity: f32,
    },
    /// The current that makes torque, A.
    Current {
        /// Asked for.
        setpoint: f32,
        /// Measured.
        measured: f32,
    },
    /// Temperatures, degrees Celsius.
    Temperature {
        /// Of the power stage.
        inverter: f32,
        /// Of the motor; not a number without a sensor.
        motor: f32,
    },
    /// The supply.
    Supply {
        /// V.
        voltage: f32,
        /// A.
        current: f32,
    },
}

/// The id of the message in the id of a frame.
mod id {
    pub(super) const VERSION: u16 = 0x00;
    pub(super) const HEARTBEAT: u16 = 0x01;
    pub(super) const ESTOP: u16 = 0x02;
    pub(super) const ERRORS: u16 = 0x03;
    pub(super) const AXIS_STATE: u16 = 0x07;
    pub(super) const ESTIMATES: u16 = 0x09;
    pub(super) const CONTROLLER_MODE: u16 = 0x0b;
    pub(super) const INPUT_TORQUE: u16 = 0x0e;
    pub(super) const CURRENT: u16 = 0x14;
    pub(super) const TEMPERATURE: u16 = 0x15;
    pub(super) const SUPPLY: u16 = 0x17;
    pub(super) const CLEAR_ERRORS: u16 = 0x18;
    pub(super) const ABSOLUTE_POSITION: u16 = 0x19;
}

/// The message of a frame, with the id of its axis. `None`: another message, or none of CANSimple.
#[must_use]
pub fn decode(frame: &Frame) -> Option<(u8, Message)> {
    if frame.extended || frame.remote || frame.length != 8 {
        return None;
    }
    let [low, high] = [&frame.data[..4], &frame.data[4..]];
    let float = |bytes: &[u8]| f32::from_bits(word(bytes));
    let data = frame.data;
    let message = match frame.id as u16 & 0x1f {
        id::VERSION => Message::Version {
            protocol: data[0],
            hardware: [data[1], data[2], data[3]],
            firmware: [data[4], data[5], data[6]],
        },
        id::HEARTBEAT => Message::Heartbeat { error: word(low), state: data[4], result: data[5] },
        id::ERRORS => Message::Errors { active: word(low), disarm_reason: word(high) },
        id::ESTIMATES => Message::Estimates { position: float(low), velocity: float(high) },
        id::CURRENT => Message::Current { setpoint: float(low), measured: float(high) },
        id::TEMPERATURE => Message::Temperature { inverter: float(low), motor: float(high) },
        id::SUPPLY => Message::Supply { voltage: float(low), current: float(high) },
        _ => return None,
    };
    Some(((frame.id >> 5) as u8, message))
}

fn word(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
}

/// What the host says to an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Motor off, by an error that must be cleared.
    Estop,
    /// Goes into one of [`state`].
    AxisState(u8),
    /// The motor gives the torque that is asked of it, at once.
    TorqueMode,
    /// Torque of the motor, N m.
    InputTorque(f32),
    /// Forgets its errors.
    ClearErrors,
    /// From now on it is here, turns.
    AbsolutePosition(f32),
    /// Says a message, which one of [`Question`] names.
    Ask(Question),
}

/// A message that an axis says when it is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Question {
    /// [`Message::Version`].
    Version,
    /// [`Message::Errors`].
    Errors,
    /// [`Message::Current`].
    Current,
    /// [`Message::Temperature`].
    Temperature,
    /// [`Message::Supply`].
    Supply,
}

/// Control mode torque, input mode passthrough.
const TORQUE_PASSTHROUGH: [u8; 8] = [1, 0, 0, 0, 1, 0, 0, 0];

impl Command {
    /// The frame that says it to an axis.
    #[must_use]
    pub fn frame(self, axis: u8) -> Frame {
        let at = |message: u16| u16::from(axis & 0x3f) << 5 | message;
        // The DBC has 8 bytes for messages of one number; those past it mean nothing.
        let one = |message, number: [u8; 4]| {
            let mut bytes = [0; 8];
            bytes[..4].copy_from_slice(&number);
            Frame::new(at(message), &bytes)
        };
        match self {
            Self::Estop => Frame::new(at(id::ESTOP), &[]),
            Self::AxisState(state) => one(id::AXIS_STATE, u32::from(state).to_le_bytes()),
            Self::TorqueMode => Frame::new(at(id::CONTROLLER_MODE), &TORQUE_PASSTHROUGH),
            Self::InputTorque(torque) => one(id::INPUT_TORQUE, torque.to_le_bytes()),
            Self::ClearErrors => Frame::new(at(id::CLEAR_ERRORS), &[0]),
            Self::AbsolutePosition(turns) => one(id::ABSOLUTE_POSITION, turns.to_le_bytes()),
            Self::Ask(question) => Frame::request(at(match question {
                Question::Version => id::VERSION,
                Question::Errors => id::ERRORS,
                Question::Current => id::CURRENT,
                Question::Temperature => id::TEMPERATURE,
                Question::Supply => id::SUPPLY,
            })),
        }
    }

    /// Appends the line of the frame that says it to an axis.
    pub fn write(self, axis: u8, line: &mut Vec<u8>) {
        self.frame(axis).write(line);
    }
}
