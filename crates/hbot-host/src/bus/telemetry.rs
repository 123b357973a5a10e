//! Slow data of a joint's motor controller: current, temperature and complaints. People look at
//! them; the control law does not use them.

use hbot_core::inputs::Complaints;

/// Time without any message from a joint's controller after which it counts as silent, ns.
const SILENT_NS: u64 = 200_000_000;
/// Time for which a current, a temperature or a restart is shown after it was reported, ns. It is
/// longer than the time in which a driver asks all joints of a line in turn.
const KEPT_NS: u64 = 5_000_000_000;

/// What the motor controller of one joint last reported about itself.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Telemetry {
    /// Motor current that makes torque, A, with the controller's own sign. `None` if it is not
    /// reported.
    pub current: Option<f32>,
    /// The highest temperature that the controller reports, °C: of the motor or of the power stage.
    /// `None` if it is not reported.
    pub temperature: Option<f32>,
    /// The complaints in the newest message from the controller.
    pub complaints: Complaints,
    /// True if the controller may have lost its zero within the last 5 s, because it lost power or
    /// was replaced.
    pub restarted: bool,
    /// True if nothing has arrived from the controller for 0.2 s.
    pub silent: bool,
}

/// Collects the telemetry of one joint from the messages of its controller, and forgets values that
/// have become old. Does not allocate memory.
#[derive(Debug, Clone, Copy, Default)]
pub struct TelemetryLog {
    /// The last current, A, and the time at which it arrived, ns.
    current: Option<(f32, u64)>,
    /// The last temperature, °C, and the time at which it arrived, ns.
    temperature: Option<(f32, u64)>,
    complaints: Complaints,
    /// Time at which the last message arrived, ns.
    heard_ns: u64,
    /// Time at which the controller was last seen without its zero, ns.
    restarted_ns: Option<u64>,
}

impl TelemetryLog {
    /// Records that a message from the controller has arrived at `now_ns`, with these complaints.
    pub fn hear(&mut self, now_ns: u64, complaints: Complaints) {
        (self.heard_ns, self.complaints) = (now_ns, complaints);
    }

    /// Records that at `now_ns` the controller may have lost its zero. The driver trusts it again
    /// within a fraction of a second, which is too short for people to see.
    pub fn restarted(&mut self, now_ns: u64) {
        self.restarted_ns = Some(now_ns);
    }

    /// Records a current that arrived at `now_ns`, in A. A value that is not finite counts as not
    /// reported.
    pub fn current(&mut self, now_ns: u64, current: f32) {
        self.current = Some((current, now_ns)).filter(|_| current.is_finite());
    }

    /// Records a temperature that arrived at `now_ns`, in °C. A value that is not finite counts as
    /// not reported.
    pub fn temperature(&mut self, now_ns: u64, temperature: f32) {
        self.temperature = Some((temperature, now_ns)).filter(|_| temperature.is_finite());
    }

    /// Returns the telemetry at `now_ns`. The values of a silent controller, and values older than
    /// 5 s, are not in it.
    #[must_use]
    pub fn at(&self, now_ns: u64) -> Telemetry {
        let silent = now_ns.saturating_sub(self.heard_ns) > SILENT_NS;
        let restarted = self.restarted_ns.is_some_and(|seen_ns| now_ns.saturating_sub(seen_ns) <= KEPT_NS);
        let kept = |value: Option<(f32, u64)>| {
            let (value, arrived_ns) = value.filter(|_| !silent)?;
            (now_ns.saturating_sub(arrived_ns) <= KEPT_NS).then_some(value)
        };
        Telemetry {
            current: kept(self.current),
            temperature: kept(self.temperature),
            complaints: self.complaints,
            restarted,
            silent,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_end_with_their_time_and_with_the_messages_of_their_controller() {
        let (mut log, ms) = (TelemetryLog::default(), 1_000_000);
        assert_eq!(log.at(200 * ms), Telemetry::default(), "nothing is expected at the start");
        assert!(log.at(201 * ms).silent);
        log.hear(1000 * ms, Complaints { watchdog: true, ..Complaints::default() });
        log.current(1000 * ms, -1.5);
        log.temperature(1000 * ms, 31.0);
        log.restarted(1200 * ms);
        let now = log.at(1200 * ms);
        assert_eq!((now.current, now.temperature), (Some(-1.5), Some(31.0)));
        assert!(now.complaints.watchdog && now.restarted && !now.silent, "{now:?}");
        let silent = log.at(1201 * ms);
        assert_eq!((silent.current, silent.temperature, silent.silent), (None, None, true));
        log.hear(6000 * ms, Complaints::default());
        log.temperature(6000 * ms, 32.0);
        assert_eq!(log.at(6000 * ms).current, Some(-1.5));
        let later = log.at(6001 * ms);
        assert_eq!((later.current, later.temperature), (None, Some(32.0)), "the current is 5 s old");
        assert!(!later.complaints.watchdog && later.restarted);
        assert!(log.at(6200 * ms).restarted && !log.at(6201 * ms).restarted);
    }

    #[test]
    fn a_value_that_is_no_number_is_not_reported() {
        let mut log = TelemetryLog::default();
        log.current(0, 2.0);
        log.current(1, f32::NAN);
        log.temperature(1, f32::INFINITY);
        let now = log.at(2);
        assert_eq!((now.current, now.temperature), (None, None));
    }
}
