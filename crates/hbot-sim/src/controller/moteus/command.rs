//! Registers of a simulated moteus servo that hold its command.

use super::registers::{ACCELERATION, CURRENT, Mapping, POSITION, PWM, TIME, TORQUE, VELOCITY, VOLTAGE};

/// Number of the first register of a servo's command. All registers of the command follow each
/// other.
pub(super) const COMMAND: u32 = 0x020;
/// Number of registers that hold a command.
pub(super) const COMMANDS: usize = 14;
/// Positions of some registers in the command, counted from its first register: feedforward torque,
/// largest torque, watchdog time, and whether the position bounds are ignored.
pub(super) const FEEDFORWARD: usize = 2;
/// Offset of the maximum torque from [`COMMAND`].
pub(super) const MAX_TORQUE: usize = 5;
/// Offset of the watchdog time from [`COMMAND`].
pub(super) const WATCHDOG: usize = 7;
/// Offset from [`COMMAND`] of the switch that makes the servo ignore its position limits.
pub(super) const IGNORE_BOUNDS: usize = 13;
/// For each register of a command: how its value is scaled if it is sent as an integer.
pub(super) const MAPPINGS: [Mapping; COMMANDS] = [
    POSITION,
    VELOCITY,
    TORQUE,
    PWM,
    PWM,
    TORQUE,
    POSITION,
    TIME,
    VELOCITY,
    ACCELERATION,
    VOLTAGE,
    PWM,
    CURRENT,
    Mapping::Plain,
];
/// Values of the command registers after a new mode has been written. They apply unless the frame
/// also writes other values.
pub(super) const DEFAULTS: [f32; COMMANDS] = {
    let nan = f32::NAN;
    [0.0, 0.0, 0.0, 1.0, 1.0, nan, nan, 0.0, nan, nan, nan, 1.0, nan, 0.0]
};

/// Returns how the value of a register is scaled if it is written as an integer: in steps of a
/// physical quantity, or without scaling.
pub(super) fn mapping(register: u32) -> Mapping {
    let at = register.checked_sub(COMMAND).map(|at| at as usize);
    match (register, at.and_then(|at| MAPPINGS.get(at))) {
        (0x130 | 0x131, _) => POSITION,
        (_, Some(mapping)) => *mapping,
        _ => Mapping::Plain,
    }
}
