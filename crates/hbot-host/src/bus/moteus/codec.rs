//! Frames to the servos and what their answers say. Commands are made by the vendor's crate.
//! Answers are read here, because its parser shifts a number too far, and panics, where a damaged
//! answer holds an integer of more than three bytes.

use moteus_protocol::command::{OutputNearestCommand, PositionCommand, PositionFormat, StopCommand};
use moteus_protocol::query::QueryFormat;
use moteus_protocol::{
    CanFdFrame, Register, Resolution, WRITE_FLOAT, WriteCanData, calculate_arbitration_id,
    parse_arbitration_id,
};

use super::BROADCAST;

/// Bits of the tick that the watchdog time of a command carries.
const TICK_BITS: u32 = 0xfff;
/// The registers that hold how long a command lasts, and the time since power-on in ms.
const WATCHDOG: u16 = 0x027;
const UPTIME: u16 = 0x070;

/// The watchdog time of the command of `tick`, s: the lowest 12 bits of its mantissa carry the
/// tick. It is within 0.05 % of the time asked for.
#[must_use]
pub(super) fn stamp(watchdog_ms: u16, tick: u32) -> f32 {
    let time = f32::from(watchdog_ms) * 1e-3;
    f32::from_bits(time.to_bits() & !TICK_BITS | tick & TICK_BITS)
}

/// The newest tick not after `last` whose command may have had this watchdog time. `None` where no
/// command for `watchdog_ms` has it.
#[must_use]
pub(super) fn stamped(echo: f32, watchdog_ms: u16, last: u32) -> Option<u32> {
    let bits = echo.to_bits();
    let right = bits & !TICK_BITS == stamp(watchdog_ms, 0).to_bits();
    right.then(|| last.wrapping_sub(last.wrapping_sub(bits) & TICK_BITS))
}

/// A frame to the servo `id` that asks for an answer, or does not.
#[must_use]
pub(super) fn frame_to(id: u8, answered: bool) -> CanFdFrame {
    let mut frame = CanFdFrame::new();
    frame.arbitration_id = calculate_arbitration_id(0, id as i8, 0, answered);
    frame
}

/// The resolutions of a torque command: what is 0 or none takes a byte.
#[must_use]
pub(super) fn torque_format() -> PositionFormat {
    let mut format = PositionFormat::default();
    format.position = Resolution::Int8;
    format.kp_scale = Resolution::Int8;
    format.kd_scale = Resolution::Int8;
    format.ilimit_scale = Resolution::Int8;
    format
}

/// What each command asks the servo to report: the answer has 32 bytes, a length of CAN-FD.
#[must_use]
pub(super) fn state_query() -> QueryFormat {
    let mut query = QueryFormat::default();
    (query.position, query.velocity) = (Resolution::Int32, Resolution::Int32);
    (query.torque, query.voltage) = (Resolution::Ignore, Resolution::Ignore);
    query.home_state = Resolution::Int8;
    query.add_extra(WATCHDOG, Resolution::Float);
    query.add_extra(UPTIME, Resolution::Int32);
    query
}

/// A frame that has the servo give `torque` (N m at its output) alone, within `most`, for
/// `watchdog` s.
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

/// A frame that switches the motor off; the watchdog time is there for the tick that it carries.
#[must_use]
pub(super) fn stop_frame(id: u8, watchdog: f32) -> CanFdFrame {
    let mut frame = frame_to(id, true);
    StopCommand::serialize(&mut frame);
    write_watchdog(&mut frame, watchdog);
    frame
}

/// Appends a watchdog time. Without a mode in its frame it commands nothing.
pub(super) fn write_watchdog(frame: &mut CanFdFrame, watchdog: f32) {
    let mut data = WriteCanData::new(frame);
    data.write_u8(WRITE_FLOAT | 1);
    data.write_varuint(u32::from(WATCHDOG));
    data.write_f32(watchdog);
}

/// Appends what takes whole turns off the position: it becomes the one nearest to 0 with the rotor
/// where it is.
pub(super) fn write_nearest_zero(frame: &mut CanFdFrame) {
    OutputNearestCommand::new(0.0).serialize(frame);
}

/// A frame that switches all motors of a line off and asks nobody for an answer.
#[must_use]
pub(super) fn stop_all() -> CanFdFrame {
    let mut frame = frame_to(BROADCAST, false);
    StopCommand::serialize(&mut frame);
    frame
}

/// What a servo reports.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct State {
    pub(super) mode: Option<i8>,
    /// Steps of 1e-5 turns; the least is none.
    pub(super) position: Option<i32>,
    /// Steps of 1e-5 turns a second; the least is none.
    pub(super) velocity: Option<i32>,
    pub(super) home: Option<i8>,
    /// Half volts.
    pub(super) voltage: Option<i8>,
    /// Degrees Celsius; the least is none.
    pub(super) temperature: Option<i8>,
    pub(super) fault: Option<i8>,
    /// The watchdog time of the command that is answered, s.
    pub(super) watchdog: Option<f32>,
    /// Time since power-on, ms.
    pub(super) uptime_ms: Option<i32>,
    pub(super) model: Option<i32>,
    pub(super) firmware: Option<i32>,
    pub(super) register_map: Option<i32>,
    /// The first register that the servo could not read or write.
    pub(super) refused: Option<u16>,
}

/// The servo that a frame is from, if it is an answer to this program.
#[must_use]
pub(super) fn sender(frame: &CanFdFrame) -> Option<u8> {
    // The bit that marks an extended frame is none of the id.
    let (source, destination, prefix) = parse_arbitration_id(frame.arbitration_id & 0x1fff_ffff);
    (destination == 0 && prefix == 0 && source > 0).then_some(source as u8)
}

/// What an answer says. `None` where it is malformed.
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
            0x30 | 0x31 => {
                let register = rest.register()?;
                rest.register()?;
                state.refused = state.refused.or(Some(register));
            }
            _ => return None,
        }
    }
    Some(state)
}

/// Takes the value of a register. One in another type than it is asked for in is none.
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

/// What of an answer is still to be read.
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

    /// A number of one or two bytes, which all registers have.
    fn register(&mut self) -> Option<u16> {
        let low = self.byte()?;
        if low & 0x80 == 0 {
            return Some(u16::from(low));
        }
        let high = self.byte().filter(|high| high & 0x80 == 0)?;
        Some(u16::from(low & 0x7f) | u16::from(high) << 7)
    }
}
