//! The text console of a simulated servo, which reads and writes settings by name, tells about the
//! firmware and moves the zero. Its text is carried inside CAN frames.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use hbot_config::rig::Protocol;

use super::super::{EncoderFilter, Lags};
use super::telemetry;

/// Settings of a simulated servo with their initial values. They are as docs/controllers.md
/// requires. The vendor delivers servos with `servo.timeout_mode` 12 and `servopos` limits of 0.01
/// turns.
const SETTINGS: [(&str, f64); 10] = [
    ("servo.timeout_mode", 0.0),
    ("servo.default_timeout_s", 0.1),
    ("servopos.position_min", f64::NAN),
    ("servopos.position_max", f64::NAN),
    ("motor_position.rotor_to_output_ratio", 1.0),
    ("id.id", 0.0),
    ("motor_position.output.source", 0.0),
    ("motor_position.sources.0.pll_filter_hz", 200.0),
    ("servo.pid_dq_hz", 200.0),
    (OUTPUT_OFFSET, 0.0),
];
/// Turns that are added to the angle of the encoder.
const OUTPUT_OFFSET: &str = "motor_position.output.offset";
/// The bandwidth of the current loop to which the vendor calibrates it, Hz.
const USUAL_CURRENT_HZ: f64 = 200.0;
/// Largest length of a command line that is stored, in bytes; the rest is dropped. New commands are
/// ignored while at least this many bytes of answers wait to be read.
const ROOM: usize = 128;

/// What a console command asks of the servo itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Order {
    /// Switch the motor off.
    Stop,
    /// Report the position as near to this one (turns) as whole turns allow.
    Rezero(f64),
    /// Report exactly this position (turns), also after a restart.
    SetOutput(f64),
}

/// The console of one servo: its settings, the line being received, and the answers not yet read.
#[derive(Debug, Clone)]
pub(super) struct Console {
    settings: [(&'static str, f64); SETTINGS.len()],
    /// The settings that a restart restores: those last saved with `conf write`.
    lasting: [(&'static str, f64); SETTINGS.len()],
    line: Vec<u8>,
    waiting: Vec<u8>,
    /// Orders that the servo has not taken yet.
    orders: Vec<Order>,
}

impl Console {
    pub(super) fn new(id: u8, lags: Lags) -> Self {
        let mut settings = SETTINGS;
        settings[5].1 = f64::from(id);
        settings[7].1 = EncoderFilter::moteus_hz(lags.rate.unwrap_or(Protocol::Moteus.rate_lag()));
        settings[8].1 = lags.torque.map_or(USUAL_CURRENT_HZ, |lag| 1.0 / (TAU * lag));
        Self::with(settings)
    }

    fn with(settings: [(&'static str, f64); SETTINGS.len()]) -> Self {
        Self { settings, lasting: settings, line: Vec::new(), waiting: Vec::new(), orders: Vec::new() }
    }

    /// Returns the console as it is after the servo has restarted. Settings that were changed but
    /// not saved are lost.
    pub(super) fn rebooted(&self) -> Self {
        Self::with(self.lasting)
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

    /// Returns the turns that are added to the angle of the encoder.
    pub(super) fn offset(&self) -> f64 {
        self.settings[9].1
    }

    /// Changes the turns that are added to the angle of the encoder.
    pub(super) fn set_offset(&mut self, turns: f64) {
        self.settings[9].1 = turns;
    }

    /// Removes and returns the orders to the servo.
    pub(super) fn take_orders(&mut self) -> Vec<Order> {
        std::mem::take(&mut self.orders)
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
                self.waiting.extend_from_slice(&said);
            }
        }
    }

    fn answer(&mut self, line: &str) -> Vec<u8> {
        let words: Vec<&str> = line.split_whitespace().collect();
        let mut said = String::new();
        match words.as_slice() {
            [] => {}
            ["tel", "stop"] | ["tel", "fmt", _, _] => said.push_str("OK\r\n"),
            ["tel", "schema", name] => return blob("schema", name, telemetry::schema(name, self.id())),
            ["tel", "get", name] => return blob("emit", name, telemetry::data(name, self.id())),
            ["d", "stop"] => return self.order(Some(Order::Stop)),
            ["d", "rezero"] => return self.order(Some(Order::Rezero(0.0))),
            ["d", "rezero", turns] => return self.order(turns.parse().ok().map(Order::Rezero)),
            ["d", "cfg-set-output", turns] => return self.order(turns.parse().ok().map(Order::SetOutput)),
            ["conf", "enumerate", groups @ ..] => self.enumerate(groups.first().copied(), &mut said),
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
        said.into_bytes()
    }

    fn order(&mut self, order: Option<Order>) -> Vec<u8> {
        self.orders.extend(order);
        if order.is_some() { b"OK\r\n".to_vec() } else { b"ERR invalid number\r\n".to_vec() }
    }

    /// Writes the settings of a group, or all, to `said`. The servo's unique number is "hbot" and
    /// its id.
    fn enumerate(&self, group: Option<&str>, said: &mut String) {
        let mut number = [0; 16];
        number[..4].copy_from_slice(b"hbot");
        number[15] = self.id();
        let number = number.iter().enumerate();
        let number = number.map(|(at, byte)| (format!("uuid.uuid.{at}"), f64::from(*byte)));
        let settings = self.settings.iter().map(|(name, value)| ((*name).to_owned(), *value));
        let all = number.chain(settings);
        let within = |name: &str| group.is_none_or(|group| name.split('.').next() == Some(group));
        let found: Vec<_> = all.filter(|(name, _)| within(name)).collect();
        for (name, value) in &found {
            _ = match value.is_nan() {
                true => write!(said, "{name} nan\r\n"),
                false => write!(said, "{name} {value}\r\n"),
            };
        }
        said.push_str(if found.is_empty() { "ERR unknown group\r\n" } else { "OK\r\n" });
    }

    /// Moves at most `room` bytes of the waiting console output into `answer`, as a subframe.
    pub(super) fn say(&mut self, room: usize, answer: &mut Vec<u8>) {
        let n = self.waiting.len().min(room).min(48);
        answer.extend([0x41, 1, n as u8]);
        answer.extend(self.waiting.drain(..n));
    }
}

/// Returns the bytes of a telemetry group after the line that announces them.
fn blob(word: &str, name: &str, bytes: Option<Vec<u8>>) -> Vec<u8> {
    bytes.map_or_else(
        || b"ERR unknown name\r\n".to_vec(),
        |bytes| [format!("{word} {name}\r\n").as_bytes(), &bytes].concat(),
    )
}
