//! Encodes the frames to the servos and decodes their answers. The vendor's crate encodes the
//! commands. Answers are decoded here, because the vendor's parser panics (it shifts a number too
//! far) if a damaged answer holds an integer of more than three bytes.

use moteus_protocol::command::{OutputNearestCommand, PositionCommand, PositionFormat, StopCommand};
use moteus_protocol::query::QueryFormat;
use moteus_protocol::{
    CanFdFrame, Register, Resolution, WRITE_FLOAT, WriteCanData, calculate_arbitration_id,
    parse_arbitration_id,
};

use super::BROADCAST;

/// Mask of the lowest 12 bits of a tick number. These bits replace the lowest bits of the watchdog
/// time in each command, so that an answer shows which command it belongs to.
const TICK_BITS: u32 = 0xfff;
/// Numbers of two registers of a servo. The first holds the watchdog time of a command (s), the
/// second the time since power-on (ms).
const WATCHDOG: u16 = 0x027;
const UPTIME: u16 = 0x070;

/// Returns the watchdog time to send with the command of tick `tick`, in s. Its lowest 12 bits are
/// replaced by those of the tick number, so that an answer, which repeats the watchdog time, shows
/// which command it belongs to. This changes the time by less than 0.05 %.
#[must_use]
pub(super) fn stamp(watchdog_ms: u16, tick: u32) -> f32 {
    let time = f32::from(watchdog_ms) * 1e-3;
    f32::from_bits(time.to_bits() & !TICK_BITS | tick & TICK_BITS)
}

/// Returns the tick of the command that an answer belongs to. `echo` is the watchdog time that the
/// answer repeats. Several ticks can have the lowest 12 bits that it contains; the result is the
/// newest one that is not after the tick `last`. Returns `None` if `echo` is not a watchdog time of
/// `watchdog_ms` (ms).
#[must_use]
pub(super) fn stamped(echo: f32, watchdog_ms: u16, last: u32) -> Option<u32> {
    let bits = echo.to_bits();
    let right = bits & !TICK_BITS == stamp(watchdog_ms, 0).to_bits();
    right.then(|| last.wrapping_sub(last.wrapping_sub(bits) & TICK_BITS))
}

/// Returns a frame to the servo `id` that contains no data yet. If `answered` is true, the frame
/// asks the servo for an answer.
#[must_use]
pub(super) fn frame_to(id: u8, answered: bool) -> CanFdFrame {
    let mut frame = CanFdFrame::new();
    frame.arbitration_id = calculate_arbitration_id(0, id as i8, 0, answered);
    frame
}

/// Returns the number type in which each value of a torque command is sent. Values that are always
/// 0 or NaN are sent as one byte.
#[must_use]
pub(super) fn torque_format() -> PositionFormat {
    let mut format = PositionFormat::default();
    format.position = Resolution::Int8;
    format.kp_scale = Resolution::Int8;
    format.kd_scale = Resolution::Int8;
    format.ilimit_scale = Resolution::Int8;
    format
}

/// The registers that take turns in the queries. With all of them, an answer would have more than
/// 36 bytes of data and be sent as 48, because CAN-FD has no length between 32 and 48.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Turn {
    /// The home state and the temperature.
    Home,
    /// The time since power-on.
    Uptime,
    /// The motor current, to show it to people. It takes the place of [`Turn::Home`] in the command
    /// to one servo from time to time.
    Current,
}

impl Turn {
    /// Returns which registers the query in the command of tick `tick` contains, if it does not ask
    /// for the current.
    #[must_use]
    pub(super) fn of(tick: u32) -> Self {
        if tick.is_multiple_of(2) { Self::Home } else { Self::Uptime }
    }
}

/// Returns the query that a command contains: the registers that the servo must report. Every query
/// contains mode, position, velocity, torque, fault and the watchdog time, and those of `turn`. The
/// answer has at most 32 bytes, which is a valid length of a CAN-FD frame.
#[must_use]
pub(super) fn state_query(turn: Turn) -> QueryFormat {
    let mut query = QueryFormat::default();
    // A torque of 32 bits has steps of 0.001 N m. In 16 bits the steps are 0.01 N m, which is more
    // than the largest torque of a small motor.
    (query.position, query.velocity, query.torque) =
        (Resolution::Int32, Resolution::Int32, Resolution::Int32);
    query.voltage = Resolution::Ignore;
    query.add_extra(WATCHDOG, Resolution::Float);
    match turn {
        Turn::Home => query.home_state = Resolution::Int8,
        Turn::Current => {
            query.temperature = Resolution::Ignore;
            query.q_current = Resolution::Int32;
        }
        Turn::Uptime => {
            query.temperature = Resolution::Ignore;
            query.add_extra(UPTIME, Resolution::Int32);
        }
    }
    query
}

/// Returns a frame that commands the servo to apply only a torque, without position control.
/// `torque` (N m) acts at the servo's output shaft, and `most` (N m) is the largest torque allowed
/// there. The command expires after `watchdog` seconds.
#[must_use]
pub(super) fn torque_frame(
    id: u8,
    torque: f32,
    most: f32,
    watchdog: f32,
    format: &PositionFormat,
) -> CanFdFrame {
    let mut frame = frame_to(id, true);
    PositionCommand::new()
        .position(f32::NAN)
        .feedforward_torque(torque)
        .kp_scale(0.0)
        .kd_scale(0.0)
        .maximum_torque(most)
        .watchdog_timeout(watchdog)
        .ilimit_scale(0.0)
        .serialize(&mut frame, format);
    frame
}

/// Returns a frame that switches the motor of servo `id` off. It contains a watchdog time only
/// because the number of the tick is stored in that time.
#[must_use]
pub(super) fn stop_frame(id: u8, watchdog: f32) -> CanFdFrame {
    let mut frame = frame_to(id, true);
    StopCommand::serialize(&mut frame);
    write_watchdog(&mut frame, watchdog);
    frame
}

/// Appends a watchdog time (s) to a frame. In a frame that sets no mode, the watchdog time has no
/// effect on the motor.
pub(super) fn write_watchdog(frame: &mut CanFdFrame, watchdog: f32) {
    let mut data = WriteCanData::new(frame);
    data.write_u8(WRITE_FLOAT | 1);
    data.write_varuint(u32::from(WATCHDOG));
    data.write_f32(watchdog);
}

/// Appends a request that the servo add or subtract whole turns of the rotor, so that its position
/// becomes the one nearest to `turns`. The rotor does not move.
pub(super) fn write_nearest(frame: &mut CanFdFrame, turns: f32) {
    OutputNearestCommand::new(turns).serialize(frame);
}

/// Returns a frame that switches off all motors of a line. No servo answers it.
#[must_use]
pub(super) fn stop_all() -> CanFdFrame {
    let mut frame = frame_to(BROADCAST, false);
    StopCommand::serialize(&mut frame);
    frame
}

/// The state that a servo reports. A field is `None` if the answer does not contain it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct State {
    pub(super) mode: Option<i8>,
    /// Position in steps of 1e-5 turns. `i32::MIN` means that the servo has no valid position.
    pub(super) position: Option<i32>,
    /// Velocity in steps of 1e-5 turns per second. `i32::MIN` means that the servo has no valid
    /// velocity.
    pub(super) velocity: Option<i32>,
    /// Torque at the output shaft that the servo computes from its motor current, in steps of 0.001
    /// N m. `i32::MIN` means that the servo has no valid torque.
    pub(super) torque: Option<i32>,
    /// Motor current that makes torque (q current), in steps of 0.001 A. `i32::MIN` means that the
    /// servo has no valid current.
    pub(super) current: Option<i32>,
    pub(super) home: Option<i8>,
    /// Supply voltage in steps of 0.5 V.
    pub(super) voltage: Option<i8>,
    /// Temperature in degrees Celsius. `i8::MIN` means that the servo has no valid temperature.
    pub(super) temperature: Option<i8>,
    pub(super) fault: Option<i8>,
    /// The watchdog time of the command that this state answers, in s.
    pub(super) watchdog: Option<f32>,
    /// Time since power-on, ms.
    pub(super) uptime_ms: Option<i32>,
    pub(super) model: Option<i32>,
    pub(super) firmware: Option<i32>,
    pub(super) register_map: Option<i32>,
}

/// Returns the id of the servo that sent a frame, or `None` if the frame is not addressed to this
/// program.
#[must_use]
pub(super) fn sender(frame: &CanFdFrame) -> Option<u8> {
    // Bit 31 marks an extended frame and is not part of the id.
    let (source, destination, prefix) = parse_arbitration_id(frame.arbitration_id & 0x1fff_ffff);
    (destination == 0 && prefix == 0 && source > 0).then_some(source as u8)
}

/// Decodes the data of an answer. Returns `None` if the data is malformed.
#[must_use]
pub(super) fn state(data: &[u8]) -> Option<State> {
    let mut state = State::default();
    let mut rest = Rest(data);
    while let Some(code) = rest.byte() {
        match code {
            0x50 => {}
            0x20..=0x2f => {
                let count = match code & 3 {
                    0 => rest.register()?,
                    count => u16::from(count),
                };
                let first = rest.register()?;
                for register in first..first.checked_add(count)? {
                    take(&mut state, register, code >> 2 & 3, &mut rest)?;
                }
            }
            // A register that the servo could not write or read, and why. The state then lacks its
            // value, which is how the driver notices.
            0x30 | 0x31 => {
                rest.register()?;
                rest.register()?;
            }
            _ => return None,
        }
    }
    Some(state)
}

/// Decodes one register value from the beginning of `rest` and stores it in `state`. `kind` is the
/// number type of the value: 0 to 3 for int8, int16, int32 and float. The value is dropped if the
/// driver did not ask for this type. Returns `None` if the data ends too early.
fn take(state: &mut State, register: u16, kind: u8, rest: &mut Rest<'_>) -> Option<()> {
    let whole = match kind {
        0 => i32::from(rest.byte()? as i8),
        1 => i32::from(i16::from_le_bytes(rest.array()?)),
        _ => i32::from_le_bytes(rest.array()?),
    };
    let (byte, word) = ((kind == 0).then_some(whole as i8), (kind == 2).then_some(whole));
    let is = |known: Register| register == known.address();
    match register {
        WATCHDOG if kind == 3 => state.watchdog = Some(f32::from_bits(whole as u32)),
        UPTIME => state.uptime_ms = word,
        _ if is(Register::Mode) => state.mode = byte,
        _ if is(Register::Position) => state.position = word,
        _ if is(Register::Velocity) => state.velocity = word,
        _ if is(Register::Torque) => state.torque = word,
        _ if is(Register::QCurrent) => state.current = word,
        _ if is(Register::HomeState) => state.home = byte,
        _ if is(Register::Voltage) => state.voltage = byte,
        _ if is(Register::Temperature) => state.temperature = byte,
        _ if is(Register::Fault) => state.fault = byte,
        _ if is(Register::ModelNumber) => state.model = word,
        _ if is(Register::FirmwareVersion) => state.firmware = word,
        _ if is(Register::RegisterMapVersion) => state.register_map = word,
        _ => {}
    }
    Some(())
}

/// The part of an answer that has not been decoded yet.
struct Rest<'a>(&'a [u8]);

impl Rest<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*taken)
    }

    /// Decodes a register number of one or two bytes. Returns `None` if the number is longer or
    /// incomplete.
    fn register(&mut self) -> Option<u16> {
        let low = self.byte()?;
        if low & 0x80 == 0 {
            return Some(u16::from(low));
        }
        let high = self.byte().filter(|high| high & 0x80 == 0)?;
        Some(u16::from(low & 0x7f) | u16::from(high) << 7)
    }
}
