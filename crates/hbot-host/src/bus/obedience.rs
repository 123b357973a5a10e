//! Checks that motors are on or off as commanded.

/// Number of the most recent commands that are remembered.
const COMMANDS: usize = 64;

/// Remembers for each of the last 64 commands whether it switched the motors on, so that a bus can
/// check whether a reading agrees with the command that it answers.
#[derive(Debug, Clone)]
pub struct Obedience {
    /// The tick of each command, and whether the command switched the motors on.
    commands: [(u32, bool); COMMANDS],
}

impl Default for Obedience {
    fn default() -> Self {
        Self { commands: [(u32::MAX, false); COMMANDS] }
    }
}

impl Obedience {
    /// Remembers whether the command of `tick` switches the motors on.
    pub fn note(&mut self, tick: u32, enable: bool) {
        self.commands[tick as usize % COMMANDS] = (tick, enable);
    }

    /// Returns true if a reading contradicts the command of tick `answers`, which it answers:
    /// motors are on although the command switched them off, or off although it switched them on.
    /// `explained` is true if the reading gives a reason for motors that are off (watchdog, fault,
    /// restart). Returns false if the command is no longer remembered.
    #[must_use]
    pub fn is_broken(&self, answers: u32, motors_on: bool, explained: bool) -> bool {
        let (tick, enable) = self.commands[answers as usize % COMMANDS];
        tick == answers && motors_on != enable && !(enable && explained)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motors_that_are_on_or_off_against_the_command_are_found_for_64_commands() {
        let mut obedience = Obedience::default();
        obedience.note(100, true);
        obedience.note(101, false);
        assert!(!obedience.is_broken(100, true, false) && obedience.is_broken(100, false, false));
        assert!(!obedience.is_broken(100, false, true), "off, and they say why");
        assert!(!obedience.is_broken(101, false, false) && obedience.is_broken(101, true, false));
        assert!(obedience.is_broken(101, true, true), "nothing explains motors that are on");
        assert!(!obedience.is_broken(99, true, false), "nobody knows what command 99 said");
        obedience.note(164, false);
        assert!(!obedience.is_broken(100, false, false), "forgotten");
    }
}
