//! One simulated servo: its registers, its modes and its watchdog.

use core::f64::consts::TAU;

use hbot_core::design::device::MAX_JOINTS;

use super::command::{
    COMMAND, COMMANDS, DEFAULTS, FEEDFORWARD, IGNORE_BOUNDS, MAPPINGS, MAX_TORQUE, WATCHDOG, mapping,
};
use super::console::{Console, Order};
use super::registers::{
    CURRENT, NOT_WRITABLE, OUT_OF_RANGE, POSITION, POWER, Reader, Refusal, TEMPERATURE, TORQUE, UNKNOWN,
    VELOCITY, VOLTAGE, Value, put, put_varuint,
};
use crate::controller::joints::{Joints, Truth};

const STOPPED: u8 = 0;
const FAULT: u8 = 1;
const POSITION_MODE: u8 = 10;
const TIMEOUT: u8 = 11;
/// The highest number of a mode that a command can set.
const LAST_MODE: f32 = 15.0;

/// Codes of faults and torque limits that the servo reports in register 0x00f.
const MOTOR_DRIVER: u8 = 33;
const OUTSIDE_LIMIT: u8 = 39;
const AT_MAX_CURRENT: u8 = 99;
const AT_FET_TEMPERATURE: u8 = 100;
const AT_MAX_TORQUE: u8 = 102;

/// Torque constant of the motor, N m/A, from which the reported current is computed.
const TORQUE_PER_AMPERE: f32 = 0.1;
/// Values that the simulated sensors report: the supply voltage in V, and the normal and the hot
/// temperature in degrees Celsius.
const SUPPLY: f32 = 24.0;
const WARMTH: f32 = 25.0;
const HOT: f32 = 80.0;
/// Time for which the servo has already had power when the simulation begins, ms.
const UPTIME_MS: i64 = 5000;

/// One simulated servo: its registers, mode, watchdog and console.
#[derive(Debug, Clone)]
pub(super) struct Servo {
    pub(super) id: u8,
    mode: u8,
    fault: u8,
    /// The last written values of the command registers, which begin at 0x020.
    command: [f32; COMMANDS],
    /// The mode that the frame being decoded has written, if any. The servo changes to it at the
    /// end of the frame.
    ordered: Option<u8>,
    /// Time at which the watchdog expires, ns. `None` if it is not running.
    pub(super) deadline: Option<u64>,
    /// Encoder position, in turns, at which the servo reports position 0.
    origin: f64,
    homed: i32,
    /// Time at which the servo got power, ms on the simulation's clock. Negative if this was before
    /// the start.
    powered_ms: i64,
    pub(super) console: Console,
    pub(super) deaf: bool,
    pub(super) failed: bool,
}

/// The values that a servo needs to handle a frame: the present time, its joint, and the true joint
/// angles and rates.
pub(super) struct Scene<'a, 'b> {
    pub(super) now_ns: u64,
    pub(super) joint: usize,
    pub(super) joints: &'a mut Joints,
    pub(super) truth: &'a Truth<'b>,
}

impl Servo {
    pub(super) fn new(console: Console, joint: usize, joints: &Joints, angles: &[f64; MAX_JOINTS]) -> Self {
        let mut servo = Self {
            id: console.id(),
            mode: STOPPED,
            fault: 0,
            command: DEFAULTS,
            ordered: None,
            deadline: None,
            origin: 0.0,
            homed: 0,
            powered_ms: -UPTIME_MS,
            console,
            deaf: false,
            failed: false,
        };
        servo.find_zero(joint, joints, angles);
        servo
    }

    /// Sets the zero of the position as a servo does at power-on. At power-on the encoder measures
    /// the rotor's angle only within one turn, so the zero is at the nearest whole turn.
    fn find_zero(&mut self, joint: usize, joints: &Joints, angles: &[f64; MAX_JOINTS]) {
        let offset = self.console.offset();
        self.origin = (joints.turns_at(joint, angles) + offset).round() - offset;
        self.homed = 1;
    }

    pub(super) fn reboot(
        &mut self,
        now_ns: u64,
        joint: usize,
        joints: &mut Joints,
        angles: &[f64; MAX_JOINTS],
    ) {
        let mut fresh = Self::new(self.console.rebooted(), joint, joints, angles);
        fresh.powered_ms = (now_ns / 1_000_000) as i64;
        (fresh.id, fresh.deaf, fresh.failed) = (self.id, self.deaf, self.failed);
        joints.set_filter(joint, fresh.console.filter());
        *self = fresh;
    }

    /// Switches the motor off if the watchdog has expired by `now_ns`, or if a test has made the
    /// servo fail. Then updates the torque.
    pub(super) fn watch(&mut self, now_ns: u64, joint: usize, joints: &mut Joints) {
        if self.deadline.is_some_and(|deadline| now_ns >= deadline) {
            (self.deadline, self.mode) = (None, TIMEOUT);
        }
        if self.failed && self.mode != FAULT {
            (self.deadline, self.mode, self.fault) = (None, FAULT, MOTOR_DRIVER);
        }
        self.push(joint, joints);
    }

    /// Sets the motor's torque from the mode and the last command. Also stores the code of a torque
    /// limit that was reached.
    fn push(&mut self, joint: usize, joints: &mut Joints) {
        if self.mode != POSITION_MODE {
            joints.ask(joint, 0.0);
            return;
        }
        let gear = joints.axes[joint].joint.gear as f32;
        let most = if self.command[MAX_TORQUE].is_nan() { f32::INFINITY } else { self.command[MAX_TORQUE] };
        let asked = self.command[FEEDFORWARD];
        let asked = if asked.is_nan() { 0.0 } else { asked };
        let within = asked.clamp(-most, most);
        let given = joints.within_peak(joint, within * gear);
        self.fault = match () {
            () if joints.is_hot(joint) || joints.derates(joint) => AT_FET_TEMPERATURE,
            () if (within * gear).abs() > joints.axes[joint].peak => AT_MAX_CURRENT,
            () if within != asked => AT_MAX_TORQUE,
            () => 0,
        };
        joints.ask(joint, given);
    }

    /// Handles the data of a CAN frame, which is a sequence of subframes: commands, queries and
    /// console text. If the frame asks for an answer, appends it to `answer`.
    pub(super) fn hear(&mut self, scene: &mut Scene<'_, '_>, data: &[u8], answer: Option<&mut Vec<u8>>) {
        self.watch(scene.now_ns, scene.joint, scene.joints);
        self.subframes(scene, data, answer);
        if let Some(mode) = self.ordered.take() {
            self.obey(scene, mode);
        }
    }

    /// Handles the subframes of a frame in order. Returns `None` at the first malformed or unknown
    /// subframe; the rest of the frame is then ignored.
    fn subframes(
        &mut self,
        scene: &mut Scene<'_, '_>,
        data: &[u8],
        mut answer: Option<&mut Vec<u8>>,
    ) -> Option<()> {
        let mut frame = Reader(data);
        while let Some(code) = frame.byte() {
            match code {
                0x50 => {}
                0x00..=0x0f => self.write_all(scene, code, &mut frame, answer.as_deref_mut())?,
                // Without a request for an answer, the vendor's firmware does not read what
                // follows.
                0x10..=0x1f => {
                    if let Some(answer) = answer.as_deref_mut() {
                        self.read_all(scene, code, &mut frame, answer)?;
                    }
                }
                0x40 | 0x42 => {
                    let (channel, size) = (frame.varuint()?, frame.varuint()?);
                    if channel != 1 {
                        return None;
                    }
                    let room = if code == 0x40 {
                        self.console.hear(&frame.bytes(size as usize)?);
                        scene.joints.set_filter(scene.joint, self.console.filter());
                        self.obey_console(scene);
                        48
                    } else {
                        size as usize
                    };
                    if let Some(answer) = answer.as_deref_mut() {
                        self.console.say(room, answer);
                    }
                }
                _ => return None,
            }
        }
        Some(())
    }

    fn write_all(
        &mut self,
        scene: &mut Scene<'_, '_>,
        code: u8,
        frame: &mut Reader<'_>,
        mut answer: Option<&mut Vec<u8>>,
    ) -> Option<()> {
        let (kind, first, count) = frame.registers(code)?;
        for register in first..first.saturating_add(count) {
            let value = frame.value(kind, mapping(register))?;
            if let (Err(error), Some(answer)) = (self.write(scene, register, value), answer.as_deref_mut()) {
                answer.push(0x30);
                put_varuint(answer, register);
                answer.push(error);
            }
        }
        Some(())
    }

    fn write(&mut self, scene: &Scene<'_, '_>, register: u32, value: f32) -> Result<(), Refusal> {
        match register {
            0x000 => {
                if !(0.0..=LAST_MODE).contains(&value) {
                    return Err(OUT_OF_RANGE);
                }
                self.command = DEFAULTS;
                self.ordered = Some(value as u8);
            }
            0x130 => self.rezero(scene, f64::from(value)),
            0x131 => {
                self.origin += self.position(scene) - f64::from(value);
                self.homed = 2;
            }
            _ if (COMMAND..COMMAND + COMMANDS as u32).contains(&register) => {
                self.command[(register - COMMAND) as usize] = value;
            }
            _ => return Err(if self.read(scene, register).is_some() { NOT_WRITABLE } else { UNKNOWN }),
        }
        Ok(())
    }

    fn read_all(
        &self,
        scene: &Scene<'_, '_>,
        code: u8,
        frame: &mut Reader<'_>,
        answer: &mut Vec<u8>,
    ) -> Option<()> {
        let (kind, first, count) = frame.registers(code)?;
        let start = answer.len();
        answer.push(0x20 | code & 0x0f);
        if code & 3 == 0 {
            put_varuint(answer, count);
        }
        put_varuint(answer, first);
        for register in first..first.saturating_add(count) {
            let read = self.read(scene, register).is_some_and(|value| put(answer, value, kind));
            if !read {
                answer.truncate(start);
                answer.push(0x31);
                put_varuint(answer, register);
                answer.push(UNKNOWN);
                return Some(());
            }
        }
        Some(())
    }

    fn read(&self, scene: &Scene<'_, '_>, register: u32) -> Option<Value> {
        let whole = |whole| Value::Whole(i32::from(whole));
        let gear = scene.joints.axes[scene.joint].joint.gear;
        // The torque at the shaft with the encoder.
        let torque = || (scene.joints.measured_torque(scene.joint) / gear) as f32;
        Some(match register {
            0x000 => whole(self.mode),
            0x001 => Value::Quantity(self.position(scene) as f32, POSITION),
            0x002 => {
                let rate = f64::from(scene.joints.rate_at(scene.joint, scene.truth));
                Value::Quantity((rate * gear / TAU) as f32, VELOCITY)
            }
            0x003 => Value::Quantity(torque(), TORQUE),
            0x004 => Value::Quantity(torque() / TORQUE_PER_AMPERE, CURRENT),
            0x005 => Value::Quantity(0.0, CURRENT),
            0x007 => Value::Quantity(0.0, POWER),
            0x00b => whole(1),
            0x00c => Value::Whole(self.homed),
            0x00d => Value::Quantity(SUPPLY, VOLTAGE),
            0x00e => {
                let hot = scene.joints.is_hot(scene.joint);
                Value::Quantity(if hot { HOT } else { WARMTH }, TEMPERATURE)
            }
            0x00f => whole(self.fault),
            0x070 => Value::Whole(((scene.now_ns / 1_000_000) as i64 - self.powered_ms) as i32),
            0x100 => Value::Word(MODEL),
            0x101 => Value::Word(FIRMWARE),
            0x102 => Value::Word(REGISTER_MAP),
            0x120..=0x122 => Value::Word(i32::from(self.id) << 8 | (register - 0x120) as i32),
            _ => {
                let at = register.checked_sub(COMMAND)? as usize;
                Value::Quantity(*self.command.get(at)?, MAPPINGS[at])
            }
        })
    }

    /// Returns the position that the servo measures: turns of its encoder since the zero.
    fn position(&self, scene: &Scene<'_, '_>) -> f64 {
        scene.joints.turns_at(scene.joint, scene.truth.angles) - self.origin
    }

    /// Changes to the mode that a frame has set. If the servo is in a fault or its watchdog has
    /// expired, it only obeys the stop mode.
    fn obey(&mut self, scene: &mut Scene<'_, '_>, mode: u8) {
        match mode {
            STOPPED => (self.mode, self.fault, self.deadline) = (STOPPED, 0, None),
            // Only a stop ends these modes.
            _ if matches!(self.mode, FAULT | TIMEOUT) => return,
            POSITION_MODE => self.run(scene),
            other => (self.mode, self.deadline) = (other, None),
        }
        self.watch(scene.now_ns, scene.joint, scene.joints);
    }

    /// Carries out what the console's commands have asked for.
    fn obey_console(&mut self, scene: &mut Scene<'_, '_>) {
        for order in self.console.take_orders() {
            match order {
                Order::Stop => self.obey(scene, STOPPED),
                Order::Rezero(turns) => self.rezero(scene, turns),
                Order::SetOutput(turns) => {
                    let away = self.position(scene) - turns;
                    self.origin += away;
                    self.console.set_offset((self.console.offset() - away) % 1.0);
                }
            }
        }
    }

    /// Moves the zero by whole turns, so that the position is the nearest to `turns`.
    fn rezero(&mut self, scene: &Scene<'_, '_>, turns: f64) {
        self.origin += (self.position(scene) - turns).round();
        self.homed = 2;
    }

    fn run(&mut self, scene: &Scene<'_, '_>) {
        let at = self.position(scene);
        let outside = self.console.bounds().is_some_and(|(least, most)| !(least..=most).contains(&at));
        let starts = self.mode != POSITION_MODE;
        if starts && outside && self.command[IGNORE_BOUNDS] == 0.0 {
            (self.mode, self.fault, self.deadline) = (FAULT, OUTSIDE_LIMIT, None);
            return;
        }
        let watchdog = match self.command[WATCHDOG] {
            0.0 => Some(self.console.default_timeout()),
            time => Some(f64::from(time)).filter(|time| time.is_finite()),
        };
        self.mode = POSITION_MODE;
        self.deadline = watchdog.map(|time| scene.now_ns.saturating_add((time.max(0.0) * 1.0e9) as u64));
    }
}

/// Values that registers 0x100 to 0x102 contain: the model (moteus r4.11), the firmware version,
/// and version 5 of the register map.
pub(super) const MODEL: i32 = 4;
pub(super) const FIRMWARE: i32 = 0x010f;
const REGISTER_MAP: i32 = 5;
