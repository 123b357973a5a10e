//! The messages of CANSimple, the protocol of an ODrive on CAN, that the driver needs.
//!
//! The id of a CAN frame consists of the id of the axis (six bits) and the number of the message
//! (five bits). Numbers are little-endian, floats are IEEE 754. Sources: the vendor's CAN protocol
//! page and the DBC of firmware 0.6.10, from which `tests/vendor/odrive.json` is made.

use super::slcan::Frame;

/// States of an axis, as numbers in a heartbeat or a command.
pub mod state {
    /// The axis has power, but its firmware has not started yet.
    pub const UNDEFINED: u8 = 0;
    /// The motor is off.
    pub const IDLE: u8 = 1;
    /// The motor is on and follows commands.
    pub const CLOSED_LOOP: u8 = 8;
}

/// Bits in the error word of an axis.
pub mod error {
    /// The firmware has not started yet.
    pub const INITIALIZING: u32 = 1;
    /// The current from the supply exceeds its limit.
    pub const DC_BUS_OVER_CURRENT: u32 = 1 << 10;
    /// The current in the motor exceeds its limit.
    pub const CURRENT_LIMIT_VIOLATION: u32 = 1 << 12;
    /// The motor is too hot.
    pub const MOTOR_OVER_TEMP: u32 = 1 << 13;
    /// The power stage is too hot.
    pub const INVERTER_OVER_TEMP: u32 = 1 << 14;
    /// No message has arrived within the time of the watchdog.
    pub const WATCHDOG_TIMER_EXPIRED: u32 = 1 << 24;
}

/// A message from an axis to the host.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Message {
    /// Versions of protocol, board and firmware.
    Version {
        /// Version of CANSimple.
        protocol: u8,
        /// Major version, minor version and variant of the board.
        hardware: [u8; 3],
        /// Major version, minor version and revision of the firmware.
        firmware: [u8; 3],
    },
    /// State and errors of the axis, sent at regular intervals.
    Heartbeat {
        /// Bits of [`error`].
        error: u32,
        /// One of the states in [`state`].
        state: u8,
        /// Result of the last change of state; 0 means success.
        result: u8,
    },
    /// Present errors, and the cause of the last switch-off.
    Errors {
        /// Bits of [`error`] that are set now.
        active: u32,
        /// Bits of [`error`] that last switched the motor off.
        disarm_reason: u32,
    },
    /// Position and velocity, sent at regular intervals.
    Estimates {
        /// Position in turns of the encoder.
        position: f32,
        /// Velocity in turns of the encoder per second.
        velocity: f32,
    },
    /// Torque-producing current of the motor, in A.
    Current {
        /// Commanded current, in A.
        setpoint: f32,
        /// Measured current, in A.
        measured: f32,
    },
    /// Temperatures, in degrees Celsius.
    Temperature {
        /// Temperature of the power stage, in degrees Celsius.
        inverter: f32,
        /// Temperature of the motor, in degrees Celsius; NaN without a sensor.
        motor: f32,
    },
    /// Voltage and current of the supply.
    Supply {
        /// Voltage of the supply, in V.
        voltage: f32,
        /// Current from the supply, in A.
        current: f32,
    },
}

/// Numbers of the messages, in the lower five bits of a CAN id.
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

/// Returns the id of the axis and the message in a frame. Returns `None` if the frame is not a
/// message that the driver needs.
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

/// Converts at most four bytes, the lowest first, to a number.
fn word(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
}

/// A command from the host to an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Switches the motor off with an error, which must be cleared before the motor can be switched
    /// on again.
    Estop,
    /// Changes the state to one of those in [`state`].
    AxisState(u8),
    /// Selects torque control, in which a commanded torque acts at once.
    TorqueMode,
    /// Sets the torque of the motor, in N m.
    InputTorque(f32),
    /// Clears the errors of the axis.
    ClearErrors,
    /// Sets the present position to this value, in turns of the encoder, without moving the motor.
    AbsolutePosition(f32),
    /// Requests the message that [`Question`] names.
    Ask(Question),
}

/// A message that an axis sends only on request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Question {
    /// Requests [`Message::Version`].
    Version,
    /// Requests [`Message::Errors`].
    Errors,
    /// Requests [`Message::Current`].
    Current,
    /// Requests [`Message::Temperature`].
    Temperature,
    /// Requests [`Message::Supply`].
    Supply,
}

/// Data bytes of [`Command::TorqueMode`]: control mode 1 (torque) and input mode 1 (passthrough).
const TORQUE_PASSTHROUGH: [u8; 8] = [1, 0, 0, 0, 1, 0, 0, 0];

impl Command {
    /// Returns the CAN frame that sends this command to the axis with id `axis`.
    #[must_use]
    pub fn frame(self, axis: u8) -> Frame {
        let at = |message: u16| u16::from(axis & 0x3f) << 5 | message;
        // The DBC gives 8 bytes to a message with one number. The bytes after the number have no
        // meaning.
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

    /// Appends to `line` the line of text that sends this command to the axis with id `axis`.
    pub fn write(self, axis: u8, line: &mut Vec<u8>) {
        self.frame(axis).write(line);
    }
}
