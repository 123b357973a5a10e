//! Virtual motors that speak the toy protocol. Their shafts are held: they give torque but do not
//! turn.

use hbot_host::bus::conformance::Controllers;

use super::{EXPIRED, Inbox, ON, STARTED, framed};

/// Virtual motor controllers that use the toy protocol. Their motors are held: they give torque but
/// do not turn.
pub struct HeldMotors {
    /// Encoder counts per turn of each joint.
    counts: Vec<u32>,
    inbox: Inbox,
    on: bool,
    expired: bool,
    started: bool,
    /// Time at which the watchdog expires, ns.
    deadline_ns: Option<u64>,
    /// Commanded torque of each motor, N m.
    torque: Vec<f64>,
}

impl HeldMotors {
    /// Creates virtual motors whose encoders have these `counts` per turn.
    pub fn new(counts: Vec<u32>) -> Self {
        let torque = vec![0.0; counts.len()];
        let inbox = Inbox::default();
        Self { counts, inbox, on: false, expired: false, started: true, deadline_ns: None, torque }
    }

    fn watch(&mut self, now_ns: u64) {
        self.expired |= self.deadline_ns.is_some_and(|deadline_ns| now_ns >= deadline_ns);
    }

    /// Returns the answer of the controllers to a line of text, or `None` if they do not understand
    /// the line.
    fn answer(&mut self, now_ns: u64, text: &str) -> Option<String> {
        let mut words = text.split(' ');
        match words.next()? {
            "D" => {
                self.started = false;
                let counts: String = self.counts.iter().map(|counts| format!(" {counts}")).collect();
                Some(format!("D {}{counts}", self.counts.len()))
            }
            "C" => {
                let tick: u32 = words.next()?.parse().ok()?;
                let on = words.next()? == "1";
                let watchdog_ms: u64 = words.next()?.parse().ok()?;
                let torque: Vec<f64> = words
                    .map(|word| word.parse::<i64>().ok().map(|t| t as f64 * 1e-6))
                    .collect::<Option<_>>()?;
                if torque.len() != self.counts.len() {
                    return None;
                }
                self.watch(now_ns);
                self.expired &= on;
                (self.on, self.torque) = (on, torque);
                self.deadline_ns = Some(now_ns + watchdog_ms * 1_000_000);
                let flags =
                    [(self.on && !self.expired, ON), (self.expired, EXPIRED), (self.started, STARTED)];
                let flags: u32 = flags.iter().filter(|(is, _)| *is).map(|(_, flag)| flag).sum();
                Some(format!("R {tick} {flags}{}", " 0 0".repeat(self.counts.len())))
            }
            _ => None,
        }
    }
}

impl Controllers for HeldMotors {
    fn hear(&mut self, now_ns: u64, bytes: &[u8], answer: &mut Vec<u8>) {
        for byte in bytes {
            let text = self.inbox.take(*byte).flatten().map(str::to_owned);
            if let Some(said) = text.and_then(|text| self.answer(now_ns, &text)) {
                answer.extend(framed(&said));
            }
        }
    }

    fn torque(&mut self, now_ns: u64) -> Vec<f64> {
        self.watch(now_ns);
        if self.on && !self.expired { self.torque.clone() } else { vec![0.0; self.counts.len()] }
    }

    fn lose_power(&mut self) {
        *self = Self::new(std::mem::take(&mut self.counts));
    }
}
