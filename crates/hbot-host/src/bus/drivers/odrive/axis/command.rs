//! The commands to one ODrive axis.

use super::super::message::{Command, state};
use super::super::order::Order;
use super::{Axis, STILL, Trust};

impl Axis {
    /// Appends the command of `tick` for this axis to `line`. `torque` is the torque of the joint,
    /// in N m.
    pub(in crate::bus::drivers::odrive) fn command(
        &mut self,
        tick: u32,
        order: Order,
        torque: f64,
        line: &mut Vec<u8>,
    ) {
        let age = order.age(tick);
        if age == 0 {
            self.was_on = false;
        }
        if !order.on || self.is_lost() {
            return self.command_off(tick, order, line);
        }
        Command::InputTorque((torque / self.gear) as f32).write(self.id, line);
        let waits = !self.was_on && self.state != state::CLOSED_LOOP;
        let again = waits && age < self.times.on && age.is_multiple_of(self.times.on_again);
        // The mode is sent twice before the state: without it the axis would hold its position.
        if age <= 1 || again {
            Command::TorqueMode.write(self.id, line);
        }
        if age == 1 || age > 1 && again {
            Command::AxisState(state::CLOSED_LOOP).write(self.id, line);
        }
    }

    /// Appends to `line` the command of `tick` that switches the motor off or keeps it off. A motor
    /// is only switched on to prove the watchdog of its axis, and only while the motors are
    /// commanded off.
    fn command_off(&mut self, tick: u32, order: Order, line: &mut Vec<u8>) {
        let age = order.age(tick);
        let is_off = self.state == state::IDLE && age > self.times.off;
        match self.trust {
            Trust::Proving if is_off => {
                // Nothing is sent, so that the watchdog expires.
                let since = *self.quiet_since.get_or_insert(tick);
                if self.proved_armed && !order.on && tick.wrapping_sub(since) > self.times.expired {
                    self.trust = Trust::Arming(tick);
                }
                return;
            }
            Trust::Arming(_) | Trust::Armed(_) if order.on => self.trust = Trust::Proving,
            Trust::Arming(since) if tick.wrapping_sub(since) <= self.times.on => {
                return self.arm(tick.wrapping_sub(since), line);
            }
            Trust::Armed(since) if tick.wrapping_sub(since) <= self.times.expired => return,
            Trust::Arming(_) | Trust::Armed(_) => self.trust = Trust::Unproven,
            Trust::Proving | Trust::Unproven | Trust::Marking | Trust::Met => {}
        }
        self.quiet_since = None;
        // Messages of both kinds feed the watchdog. They take turns, so that a tick takes no more
        // time on the bus than with motors on.
        if age == 0 || !is_off && tick.is_multiple_of(2) {
            Command::AxisState(state::IDLE).write(self.id, line);
        }
        if age == 0 || is_off || !tick.is_multiple_of(2) {
            Command::InputTorque(0.0).write(self.id, line);
        }
        let again = self.cleared.is_none_or(|cleared| tick.wrapping_sub(cleared) >= self.times.again);
        if self.error != 0 && self.trust != Trust::Proving && again {
            self.cleared = Some(tick);
            self.excuse(tick);
            Command::ClearErrors.write(self.id, line);
        } else if tick.wrapping_add(u32::from(self.id)).is_multiple_of(self.times.again) {
            // The axes of a line take turns.
            self.set_back(line);
        }
    }

    /// Appends to `line` the command that switches the motor on at zero torque. `age` is the number
    /// of ticks since the first of these commands. The mode and the torque are sent several times
    /// before the state, because a command can be lost.
    fn arm(&self, age: u32, line: &mut Vec<u8>) {
        let first = age < self.times.on_again;
        if age.is_multiple_of(2) {
            Command::InputTorque(0.0).write(self.id, line);
        } else {
            Command::TorqueMode.write(self.id, line);
        }
        if first && age == self.times.on_again / 2 {
            // Errors are cleared after feeding has begun, so that they do not return.
            Command::ClearErrors.write(self.id, line);
        } else if !first && age.is_multiple_of(self.times.on_again) {
            Command::AxisState(state::CLOSED_LOOP).write(self.id, line);
        }
    }

    /// Excuses an expired watchdog for a while. The watchdog may have
    /// expired while the axis got no commands.
    pub(in crate::bus::drivers::odrive) fn excuse(&mut self, tick: u32) {
        self.excused_until = Some(tick.wrapping_add(self.times.excused));
    }

    /// Moves the position by whole turns of the joint until it is near the mark, where its steps
    /// are fine and a restart can be detected. Does nothing while the motor is on or turns, or if
    /// the position is already near the mark.
    fn set_back(&mut self, line: &mut Vec<u8>) {
        self.set_back = None;
        let Some(position) = self.position else { return };
        let turns = if self.trust == Trust::Marking {
            -self.mark
        } else {
            // Whole turns of the joint keep its angle, so that a program that is started later
            // reads it too.
            ((position - self.mark) / self.gear).round() * self.gear
        };
        let near = (position - self.mark).abs() <= 0.75 * self.gear;
        let marked = self.trust == Trust::Met && near;
        if marked || self.state != state::IDLE || self.velocity.abs() > STILL {
            return;
        }
        let there = (position - turns) as f32;
        if self.trust == Trust::Met {
            self.set_back = Some(position - f64::from(there));
        } else {
            Command::TorqueMode.write(self.id, line);
        }
        Command::AbsolutePosition(there).write(self.id, line);
    }
}
