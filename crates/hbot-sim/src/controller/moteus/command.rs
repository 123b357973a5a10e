//! The registers of a command.

use super::registers::{ACCELERATION, CURRENT, Mapping, POSITION, PWM, TIME, TORQUE, VELOCITY, VOLTAGE};

/// The registers of a command, from this one on.
pub(super) const COMMAND: u32 = 0x020;
pub(super) const COMMANDS: usize = 14;
/// Of these: feedforward torque, largest torque, watchdog time, bounds that are ignored.
pub(super) const FEEDFORWARD: usize = 2;
pub(super) const MAX_TORQUE: usize = 5;
pub(super) const WATCHDOG: usize = 7;
pub(super) const IGNORE_BOUNDS: usize = 13;
/// How the registers of a command are mapped.
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
/// What they hold once a mode has been written.
pub(super) const DEFAULTS: [f32; COMMANDS] = {
    let nan = f32::NAN;
    [0.0, 0.0, 0.0, 1.0, 1.0, nan, nan, 0.0, nan, nan, nan, 1.0, nan, 0.0]
};

/// How a register is mapped when it is written.
pub(super) fn mapping(register: u32) -> Mapping {
    let at = register.checked_sub(COMMAND).map(|at| at as usize);
    match (register, at.and_then(|at| MAPPINGS.get(at))) {
        (0x130 | 0x131, _) => POSITION,
        (_, Some(mapping)) => *mapping,
        _ => Mapping::Plain,
    }
}
