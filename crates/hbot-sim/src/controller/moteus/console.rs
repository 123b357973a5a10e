//! The text console of a simulated servo, which reads and writes settings by name. Its text is
//! carried inside CAN frames.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use hbot_config::rig::Protocol;

use super::super::{EncoderFilter, Lags};

/// Settings of a simulated servo with their initial values. They are as docs/controllers.md
/// requires. The vendor delivers servos with `servo.timeout_mode` 12 and `servopos` limits of 0.01
/// turns.
const SETTINGS: [(&str, f64); 9] = [
    ("servo.timeout_mode", 0.0),
    ("servo.default_timeout_s", 0.1),
    ("servopos.position_min", f64::NAN),
    ("servopos.position_max", f64::NAN),
    ("motor_position.rotor_to_output_ratio", 1.0),
    ("id.id", 0.0),
    ("motor_position.output.source", 0.0),
    ("motor_position.sources.0.pll_filter_hz", 200.0),
    ("servo.pid_dq_hz", 200.0),
];
/// The bandwidth of the current loop to which the vendor calibrates it, Hz.
const USUAL_CURRENT_HZ: f64 = 200.0;
/// Largest length of a command line that is stored, in bytes; the rest is dropped. New commands are
/// ignored while at least this many bytes of answers wait to be read.
const ROOM: usize = 128;

/// The console of one servo: its settings, the line being received, and the answers not yet read.
#[derive(Debug, Clone)]
pub(super) struct Console {
    settings: [(&'static str, f64); SETTINGS.len()],
    /// The settings that a restart restores: those last saved with `conf write`.
    lasting: [(&'static str, f64); SETTINGS.len()],
    line: Vec<u8>,
    waiting: Vec<u8>,
}

impl Console {
    pub(super) fn new(id: u8, lags: Lags) -> Self {
        let mut settings = SETTINGS;
        settings[5].1 = f64::from(id);
        settings[7].1 = EncoderFilter::moteus_hz(lags.rate.unwrap_or(Protocol::Moteus.rate_lag()));
        settings[8].1 = lags.torque.map_or(USUAL_CURRENT_HZ, |lag| 1.0 / (TAU * lag));
        Self { settings, lasting: settings, line: Vec::new(), waiting: Vec::new() }
    }

    /// Returns the console as it is after the servo has restarted. Settings that were changed but
    /// not saved are lost.
    pub(super) fn rebooted(&self) -> Self {
        let settings = self.lasting;
        Self { settings, lasting: settings, line: Vec::new(), waiting: Vec::new() }
    }

    /// Changes a setting as the console command `conf set` does. Returns false if there is no such
    /// setting.
    pub(super) fn set(&mut self, name: &str, value: f64) -> bool {
        let found = self.settings.iter_mut().find(|(known, _)| *known == name);
        found.map(|(_, setting)| *setting = value).is_some()
    }

    /// Returns the id of the servo when it starts.
    pub(super) fn id(&self) -> u8 {
        self.settings[5].1 as u8
    }

    /// Returns the natural frequency of the encoder's filter, rad/s.
    pub(super) fn filter(&self) -> f64 {
        EncoderFilter::of_moteus(self.settings[7].1)
    }

    /// Returns the lowest and the highest position at which the servo can be switched on, in turns.
    /// Returns `None` if neither is set.
    pub(super) fn bounds(&self) -> Option<(f64, f64)> {
        let (least, most) = (self.settings[2].1, self.settings[3].1);
        let any = least.is_finite() || most.is_finite();
        let bound = |bound: f64, none| if bound.is_nan() { none } else { bound };
        any.then(|| (bound(least, f64::NEG_INFINITY), bound(most, f64::INFINITY)))
    }

    /// Returns the watchdog time that applies if a command does not contain one, in s.
    pub(super) fn default_timeout(&self) -> f64 {
        self.settings[1].1
    }

    /// Receives a part of the console's input, which has one command per line. Carries out each
    /// command whose line is complete.
    pub(super) fn hear(&mut self, bytes: &[u8]) {
        for byte in bytes {
            if *byte != b'\n' && *byte != b'\r' {
                if self.line.len() < ROOM {
                    self.line.push(*byte);
                }
                continue;
            }
            let line = std::mem::take(&mut self.line);
            if let (Ok(line), true) = (String::from_utf8(line), self.waiting.len() < ROOM) {
                let said = self.answer(&line);
                self.waiting.extend_from_slice(said.as_bytes());
            }
        }
    }

    fn answer(&mut self, line: &str) -> String {
        let words: Vec<&str> = line.split_whitespace().collect();
        let mut said = String::new();
        match words.as_slice() {
            [] => {}
            ["conf", "get", name] => match self.settings.iter().find(|(known, _)| known == name) {
                Some((_, value)) if value.is_nan() => said.push_str("nan\r\n"),
                Some((_, value)) => _ = write!(said, "{value}\r\n"),
                None => said.push_str("ERR error reading\r\n"),
            },
            ["conf", "set", name, value] => match value.parse() {
                Ok(value) if self.set(name, value) => said.push_str("OK\r\n"),
                _ => said.push_str("ERR error setting\r\n"),
            },
            ["conf", "write"] => {
                self.lasting = self.settings;
                said.push_str("OK\r\n");
            }
            _ => said.push_str("ERR unknown command\r\n"),
        }
        said
    }

    /// Moves at most `room` bytes of the waiting console output into `answer`, as a subframe.
    pub(super) fn say(&mut self, room: usize, answer: &mut Vec<u8>) {
        let n = self.waiting.len().min(room).min(48);
        answer.extend([0x41, 1, n as u8]);
        answer.extend(self.waiting.drain(..n));
    }
}
