//! One simulated ODrive axis: its state, errors, watchdog, and its messages of CANSimple.

use core::f64::consts::TAU;

use hbot_config::rig::Protocol;

use super::super::Lags;
use super::super::joints::{Joints, Truth};

/// Firmware version that each axis reports: major, minor, revision.
const FIRMWARE: [u8; 3] = [0, 6, 10];
/// Temperature that a motor reports normally, in degrees Celsius.
const TEMPERATURE: f32 = 25.0;
/// Temperature that an overheated motor reports, in degrees Celsius.
const HOT: f32 = 155.0;
/// Torque constant of the simulated motors, in N m/A. It only affects the currents that an axis
/// reports.
const TORQUE_CONSTANT: f64 = 0.05;
/// Supply voltage that each axis reports, in V.
const SUPPLY: f32 = 24.0;

const MS: u64 = 1_000_000;

const IDLE: u8 = 1;
const CLOSED_LOOP: u8 = 8;

const DRV_FAULT: u32 = 1 << 5;
const WATCHDOG_TIMER_EXPIRED: u32 = 1 << 24;
const ESTOP_REQUESTED: u32 = 1 << 25;

/// The settings of an axis that the simulation uses. The vendor's tools can change them.
#[derive(Debug, Clone, Copy)]
struct Settings {
    /// Whether the watchdog runs.
    enable_watchdog: bool,
    /// Time without a message after which the watchdog expires, in ns.
    watchdog_timeout: u64,
    /// Time between two positions, in ns; 0 means none are sent.
    encoder_msg_rate: u64,
    /// Time between two heartbeats, in ns; 0 means none are sent.
    heartbeat_msg_rate: u64,
    /// Natural frequency of the filter of position and velocity, rad/s.
    encoder_bandwidth: f64,
    /// Whether the watchdog counts only while the motor is on. Firmware 0.5.6 counts always.
    counts_only_armed: bool,
    /// Whether only messages that set a position, a velocity or a torque restart the watchdog. In
    /// firmware 0.5.6 every message does.
    fed_only_by_inputs: bool,
    /// Minor version of the firmware that the axis reports.
    firmware_minor: u8,
}

/// State of one simulated axis.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    pub(super) id: u8,
    settings: Settings,
    state: u8,
    error: u32,
    disarm_reason: u32,
    /// Result of the last change of state, as in a heartbeat; 0 means success.
    result: u8,
    torque_mode: bool,
    /// Commanded torque of the motor, in N m.
    input_torque: f32,
    /// Time at which the watchdog expires, in ns.
    deadline: u64,
    /// Time of the next position, in ns.
    next_estimate: u64,
    /// Time of the next heartbeat, in ns.
    next_heartbeat: u64,
    /// Last encoder count.
    count: i32,
    /// Last encoder count, continued without wrapping around.
    total: i64,
    /// Turns that are added to those of the encoder, because the host has set the position.
    offset: f64,
    /// Whether a failed power stage is simulated.
    failed: bool,
    /// True if the axis ignores all messages and sends none.
    pub(super) deaf: bool,
}

impl Axis {
    /// Returns the axis of joint `j` after power-on, with the settings that the driver requires.
    pub(super) fn new(j: usize, lags: Lags) -> Self {
        let settings = Settings {
            enable_watchdog: true,
            watchdog_timeout: 50 * MS,
            encoder_msg_rate: MS,
            heartbeat_msg_rate: 10 * MS,
            encoder_bandwidth: 2.0 / lags.rate.unwrap_or(Protocol::Odrive.rate_lag()),
            counts_only_armed: false,
            fed_only_by_inputs: false,
            firmware_minor: FIRMWARE[1],
        };
        Self {
            id: j as u8,
            settings,
            state: IDLE,
            error: 0,
            disarm_reason: 0,
            result: 0,
            torque_mode: false,
            input_torque: 0.0,
            deadline: settings.watchdog_timeout,
            next_estimate: MS,
            // The heartbeats of the axes are one millisecond apart.
            next_heartbeat: (1 + j as u64) * MS,
            count: 0,
            total: 0,
            offset: 0.0,
            failed: false,
            deaf: false,
        }
    }

    /// Changes the setting that the vendor's tools call `name`. Returns false if no setting has
    /// this name.
    pub(super) fn set(&mut self, name: &str, value: f64) -> bool {
        let ms = (value * MS as f64) as u64;
        let settings = &mut self.settings;
        match name {
            "config.enable_watchdog" => settings.enable_watchdog = value != 0.0,
            "config.watchdog_timeout" => settings.watchdog_timeout = (value * 1e9) as u64,
            "config.can.encoder_msg_rate_ms" => settings.encoder_msg_rate = ms,
            "config.can.heartbeat_msg_rate_ms" => settings.heartbeat_msg_rate = ms,
            // These two are not settings, but what another firmware could do.
            "watchdog counts only while armed" => settings.counts_only_armed = value != 0.0,
            "only Set_Input_* feeds the watchdog" => settings.fed_only_by_inputs = value != 0.0,
            "config.encoder_bandwidth" => settings.encoder_bandwidth = value,
            "fw_version_minor" => settings.firmware_minor = value as u8,
            _ => return false,
        }
        true
    }

    /// Returns the natural frequency of the filter of position and velocity, rad/s.
    pub(super) fn filter(&self) -> f64 {
        self.settings.encoder_bandwidth
    }

    /// Restarts the watchdog if a message with this number does.
    pub(super) fn feed(&mut self, now_ns: u64, message: u16) {
        // Set_Input_Pos, Set_Input_Vel and Set_Input_Torque.
        if !self.settings.fed_only_by_inputs || matches!(message, 0x0c..=0x0e) {
            self.deadline = now_ns + self.settings.watchdog_timeout;
        }
    }

    /// Returns whether the watchdog counts and has not expired yet.
    fn is_watched(&self) -> bool {
        self.settings.enable_watchdog
            && self.error & WATCHDOG_TIMER_EXPIRED == 0
            && (self.is_on() || !self.settings.counts_only_armed)
    }

    /// Lets the watchdog expire if its time is over. The firmware checks it in every cycle, so an
    /// error that is cleared while the time is over returns at once.
    pub(super) fn watch(&mut self, now_ns: u64) {
        if self.is_watched() && now_ns >= self.deadline {
            self.disarm(WATCHDOG_TIMER_EXPIRED);
        }
    }

    fn is_on(&self) -> bool {
        self.state == CLOSED_LOOP
    }

    /// Makes the motor of joint `j` give the commanded torque, or none if it is off.
    pub(super) fn push(&self, j: usize, joints: &mut Joints) {
        let gear = joints.axes[j].joint.gear;
        let torque = if self.is_on() && self.torque_mode { f64::from(self.input_torque) * gear } else { 0.0 };
        let given = joints.within_peak(j, torque as f32);
        joints.ask(j, given);
    }

    /// Sets error bits. If the motor is on, switches it off and stores the reason.
    fn disarm(&mut self, error: u32) {
        self.error |= error;
        if self.is_on() {
            (self.state, self.disarm_reason, self.result) = (IDLE, error, 3);
        }
    }

    /// Returns the position of joint `j` in turns of its encoder.
    fn position(&mut self, j: usize, joints: &Joints, truth: &Truth<'_>) -> f64 {
        let count = joints.count_at(j, truth);
        self.total += i64::from(count.wrapping_sub(self.count));
        self.count = count;
        self.total as f64 / f64::from(joints.axes[j].joint.counts_per_turn) + self.offset
    }

    /// Carries out a command from the host. `message` is its number and `bytes` its data.
    pub(super) fn hear(&mut self, j: usize, message: u16, bytes: &[u8], joints: &Joints, truth: &Truth<'_>) {
        let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
        match (message, word(0)) {
            (0x02, _) => self.disarm(ESTOP_REQUESTED),
            (0x07, Some(state)) if state == u32::from(IDLE) => (self.state, self.result) = (IDLE, 0),
            (0x07, Some(state)) if state == u32::from(CLOSED_LOOP) => {
                if self.error == 0 {
                    (self.state, self.result) = (CLOSED_LOOP, 0);
                } else {
                    self.result = 3;
                }
            }
            (0x0b, Some(mode)) => self.torque_mode = mode == 1 && word(4) == Some(1),
            (0x0e, Some(torque)) if f32::from_bits(torque).is_finite() => {
                self.input_torque = f32::from_bits(torque)
            }
            (0x18, _) => self.error = if self.failed { DRV_FAULT } else { 0 },
            (0x19, Some(position)) => {
                let there = f64::from(f32::from_bits(position));
                self.offset += there - self.position(j, joints, truth);
            }
            _ => {}
        }
    }

    /// Appends the message that the host has requested to `reply`. `at` contains the joint and the
    /// number of the message.
    pub(super) fn say(&mut self, at: (usize, u16), joints: &Joints, truth: &Truth<'_>, reply: &mut Vec<u8>) {
        let (j, message) = at;
        let temperature = if joints.is_hot(j) || joints.derates(j) { HOT } else { TEMPERATURE };
        let current = |torque: f64| ((torque / TORQUE_CONSTANT) as f32).to_bits();
        let (low, high) = match message {
            0x00 => {
                let [major, _, revision] = FIRMWARE;
                let version = [major, self.settings.firmware_minor, revision, 0];
                (u32::from_le_bytes([2, 4, 4, 58]), u32::from_le_bytes(version))
            }
            0x03 => (self.error, self.disarm_reason),
            0x09 => {
                let gear = joints.axes[j].joint.gear;
                let velocity = f64::from(joints.rate_at(j, truth)) * gear / TAU;
                ((self.position(j, joints, truth) as f32).to_bits(), (velocity as f32).to_bits())
            }
            0x14 => {
                let asked = if self.is_on() { f64::from(self.input_torque) } else { 0.0 };
                let gear = joints.axes[j].joint.gear;
                (current(asked), current(joints.measured_torque(j) / gear))
            }
            0x15 => (temperature.to_bits(), temperature.to_bits()),
            0x17 => (SUPPLY.to_bits(), 0),
            _ => return,
        };
        put(self.id, message, low, high, reply);
    }

    /// Does everything that is due without a message from the host: the watchdog can expire, and
    /// heartbeats and positions are sent. `at` contains the joint and the time, in ns.
    pub(super) fn pass(
        &mut self,
        at: (usize, u64),
        joints: &mut Joints,
        truth: &Truth<'_>,
        reply: &mut Vec<u8>,
    ) {
        let (j, now_ns) = at;
        self.watch(now_ns);
        self.push(j, joints);
        let Settings { heartbeat_msg_rate, encoder_msg_rate, .. } = self.settings;
        if heartbeat_msg_rate > 0 && now_ns >= self.next_heartbeat {
            self.next_heartbeat = following(self.next_heartbeat, heartbeat_msg_rate, now_ns);
            if !self.deaf {
                let high = u32::from_le_bytes([self.state, self.result, 0, 0]);
                put(self.id, 0x01, self.error, high, reply);
            }
        }
        if encoder_msg_rate > 0 && now_ns >= self.next_estimate {
            self.next_estimate = following(self.next_estimate, encoder_msg_rate, now_ns);
            if !self.deaf {
                self.say((j, 0x09), joints, truth, reply);
            }
        }
    }

    /// Returns the time at which the axis next sends a heartbeat or a position, in ns.
    pub(super) fn next_word_ns(&self) -> u64 {
        let one = |period: u64, next: u64| if period == 0 { u64::MAX } else { next };
        one(self.settings.heartbeat_msg_rate, self.next_heartbeat)
            .min(one(self.settings.encoder_msg_rate, self.next_estimate))
    }

    /// Returns the time at which the axis next sends a message unasked or its watchdog expires, in
    /// ns.
    pub(super) fn next_ns(&self) -> u64 {
        self.next_word_ns().min(if self.is_watched() { self.deadline } else { u64::MAX })
    }

    /// Simulates a loss of power that ends at once. The axis loses its state, errors and position,
    /// and keeps its settings.
    pub(super) fn reboot(&mut self) {
        (self.state, self.error, self.disarm_reason, self.result) = (IDLE, 0, 0, 0);
        (self.torque_mode, self.input_torque, self.offset) = (false, 0.0, 0.0);
        (self.count, self.total) = (0, 0);
    }

    /// Simulates a power stage that fails (`on`) or works again. The error stays until it is
    /// cleared.
    pub(super) fn fail(&mut self, j: usize, on: bool, joints: &mut Joints) {
        self.failed = on;
        if on {
            self.disarm(DRV_FAULT);
            self.push(j, joints);
        }
    }
}

/// Returns the time at which a periodic event is due next, in ns, after it was due at `due_ns`. If
/// the clock has jumped over several periods, the missed events are left out.
fn following(due_ns: u64, period: u64, now_ns: u64) -> u64 {
    due_ns + period * (1 + (now_ns - due_ns) / period)
}

/// Appends the line of text of a CAN frame with two 32-bit words to `reply`.
fn put(id: u8, message: u16, low: u32, high: u32, reply: &mut Vec<u8>) {
    use std::io::Write as _;
    let id = u16::from(id) << 5 | message;
    // Writing to memory cannot fail.
    let _ = write!(reply, "t{id:03X}8{:08X}{:08X}\r", low.swap_bytes(), high.swap_bytes());
}
