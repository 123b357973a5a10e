//! The messages that explain faults to clients.

use hbot_config::scene::Link;
use hbot_core::Rig;
use hbot_core::controller::{LATE_FAULT_NS, SKIPPED_FAULT};
use hbot_core::safety::mode::Cause;

use super::super::convert;
use hbot_host::run_loop::sample::Sample;

/// The explanation of a fault, for clients.
pub(super) struct Explanation {
    /// What was measured, which limit it exceeded, and on a real rig where to look.
    pub(super) message: String,
    /// The same without the speed at which the sphere was too fast, because clients show the
    /// present one beside it.
    pub(super) found: String,
    /// What to do about it on this rig.
    pub(super) remedy: String,
}

/// Explains a fault of a simulated rig. The explanation says that the rig is simulated, and names
/// causes that a simulated rig can have. `line` has the errors of its serial line, if it has any;
/// the other parameters are those of [`real`].
pub(super) fn simulated(
    cause: Cause,
    sample: &Sample,
    skipped: u64,
    rig: &Rig,
    line: Option<&Link>,
) -> Explanation {
    let (message, again) = match (cause, line) {
        (Cause::LinkLost, _) => {
            let what = format!(
                "the simulated motor controllers have not answered for {} ticks (link.timeout_ticks), or answered late",
                rig.timing.timeout_ticks
            );
            match line.and_then(delays_and_losses) {
                Some((line, key)) => (format!("{what}: {line}, or {BUSY}"), again(key)),
                None => (format!("{what}: {BUSY}"), String::new()),
            }
        }
        (Cause::LinkCorrupt, Some(Link { corrupt, .. })) if *corrupt > 0.0 => (
            format!("the scene's table [simulate.link] damages too many frames (corrupt = {corrupt})"),
            again("a smaller `corrupt`"),
        ),
        (Cause::LinkCorrupt, _) => {
            ("too many frames of the simulated serial line are damaged".to_owned(), String::new())
        }
        _ => (observed(cause, sample, skipped, rig), String::new()),
    };
    let remedy = match cause {
        Cause::Overspeed => format!("{} {HELD}", usual(cause)),
        _ if is_of_hardware(cause) => format!("{UNBROKEN}{again}"),
        _ => usual(cause).to_owned(),
    };
    Explanation { found: found(cause, sample, rig, &message), remedy, message }
}

/// Explains a fault of a real rig. `skipped` is the number of ticks that were skipped just before
/// the sample.
pub(super) fn real(cause: Cause, sample: &Sample, skipped: u64, rig: &Rig) -> Explanation {
    let message = observed(cause, sample, skipped, rig);
    let disobeys = cause == Cause::ControllerFault && !sample.restarted && !sample.complaints.fault;
    let remedy = if disobeys { DISOBEYS } else { usual(cause) };
    Explanation { found: found(cause, sample, rig, &message), remedy: remedy.to_owned(), message }
}

/// What to do about a motor that is on or off against the command.
const DISOBEYS: &str = "If a wheel still pushes, cut the supply at once. Check the motors' supply, and the controller's settings.";
const UNBROKEN: &str = "The rig is simulated and nothing is broken.";
/// What to do about a simulated sphere that is too fast and that nobody can hold.
const HELD: &str = "If it spins on freely, let a hand hold it: `hbot scene load spring --ideal`, or a scene with `hand = {}` in [simulate].";

fn usual(cause: Cause) -> &'static str {
    convert::fault(cause).words().1
}

/// Returns whether the usual remedy is one for motors, wheels and cables, which a simulated rig
/// does not have.
const fn is_of_hardware(cause: Cause) -> bool {
    match cause {
        Cause::LinkLost
        | Cause::LinkCorrupt
        | Cause::ControllerFault
        | Cause::Overtorque
        | Cause::Slip
        | Cause::ImplausibleFeedback
        | Cause::Thermal => true,
        Cause::Overspeed | Cause::NonFinite | Cause::Deadline | Cause::ClientLost => false,
    }
}

fn found(cause: Cause, sample: &Sample, rig: &Rig, message: &str) -> String {
    let limit = rig.limits.speed;
    let told = cause == Cause::Overspeed && sample.state.omega.length() > limit;
    if told { format!("faster than {limit} rad/s (limits.speed)") } else { message.to_owned() }
}

/// What a simulated rig suffers from if its line is not to blame.
const BUSY: &str = "other programs kept this machine too busy";

/// Returns what to do about a fault that the scene causes, and may cause again.
fn again(with: &str) -> String {
    format!(
        " If the fault comes back, load the scene with {with} first (`hbot scene load NAME --ideal` has none)."
    )
}

/// Returns how the scene's serial line loses and delays frames, with the keys that say so, and what
/// the scene should have instead. Returns `None` if it does neither.
fn delays_and_losses(line: &Link) -> Option<(String, &'static str)> {
    // From a command to the answer that it causes, at most.
    let delay_ms = 1.0e3 * (line.latency_s + line.command_latency_s + 2.0 * line.jitter_s);
    let loses = format!("loses frames (loss = {})", line.loss);
    let delays = format!("delays answers by up to {delay_ms:.1} ms (latency_s, command_latency_s, jitter_s)");
    let (does, instead) = match (line.loss > 0.0, delay_ms > 0.0) {
        (false, false) => return None,
        (true, false) => (loses, "a smaller `loss`"),
        (true, true) => (format!("{loses} and {delays}"), "a smaller `loss` and smaller delays"),
        (false, true) => (delays, "smaller delays"),
    };
    Some((format!("the scene's table [simulate.link] {does}"), instead))
}

/// Returns the observed value, the limit that it exceeded, and for a real rig where to look.
fn observed(cause: Cause, sample: &Sample, skipped: u64, rig: &Rig) -> String {
    let state = &sample.state;
    match cause {
        Cause::LinkLost => format!(
            "the motor controllers have not answered for {} ticks (link.timeout_ticks), their answers come later than that \
             or are mostly missing, or they ran out of their watchdog time: check power and cable",
            rig.timing.timeout_ticks
        ),
        Cause::LinkCorrupt => format!(
            "too many frames on the serial line are damaged ({} so far): check cable, shield and baud rate",
            sample.counters.corrupt_frames
        ),
        Cause::ControllerFault => match (sample.restarted, sample.complaints.fault) {
            (true, _) => "a motor controller has restarted, or is another than the rig file's",
            (false, true) => "a motor controller reports a fault: see its own display",
            (false, false) => {
                "a motor controller says for 20 ms that its motor is off although it is switched on, or on although it is off"
            }
        }
        .to_owned(),
        Cause::Overspeed => {
            let limit = rig.limits.speed;
            match state.omega.length() {
                speed if speed > limit => {
                    format!("the sphere turned at {speed:.3} rad/s; the limit is {limit} (limits.speed)")
                }
                _ => format!(
                    "by its encoders' counts the sphere turned faster than {limit} rad/s (limits.speed) over 25 ms; the rates that \
                     the controllers report do not show it: check how they are measured"
                ),
            }
        }
        Cause::Overtorque => match rig.limits.energy {
            None => "a motor controller reports more current than its motor may have".to_owned(),
            Some(limit) => format!(
                "more than {} J went into the hand beyond {} W (limits.energy), or a motor controller reports more current \
                 than its motor may have",
                limit.burst, limit.power
            ),
        },
        Cause::Slip => {
            let limit = rig.limits.slip;
            let what = match state.slip {
                slip if slip > limit => format!("a wheel slipped at {slip:.3} m/s"),
                _ => "by its encoder's counts a wheel slipped faster than that over 25 ms".to_owned(),
            };
            format!(
                "{what}; the limit is {limit} (limits.slip): less torque, or more normal force. A gear that crosses its play looks \
                 the same"
            )
        }
        Cause::NonFinite => "a number is not finite, in what the controllers report or in a torque".to_owned(),
        Cause::ImplausibleFeedback => {
            "a joint moved further between two readings than it can, or its counts and the rate that its controller reports \
             disagreed for 50 ms: check its encoder"
                .to_owned()
        }
        Cause::Deadline => deadline(sample.timing.lateness_ns, skipped),
        Cause::ClientLost => {
            "the client that held the lease is gone, and api.on_client_lost is \"fault\"".to_owned()
        }
        Cause::Thermal => "a motor or its controller is too hot: let it cool".to_owned(),
    }
}

/// Returns a description of a missed deadline: a tick that began too late, or ticks that were
/// skipped because the tick before them took too long.
fn deadline(lateness_ns: u64, skipped: u64) -> String {
    let late_ms = convert::seconds(lateness_ns) * 1.0e3;
    let what = if lateness_ns > LATE_FAULT_NS {
        format!("a tick came {late_ms:.1} ms late (more than {} is a fault)", LATE_FAULT_NS / 1_000_000)
    } else {
        format!(
            "{skipped} ticks in a row were skipped because the one before them took too long ({SKIPPED_FAULT} are a fault)"
        )
    };
    format!("{what}: other work on this machine, no real-time priority, or a rate too high for it")
}

#[cfg(test)]
mod tests {
    use hbot_core::inputs::Complaints;

    use super::*;
    use crate::still::still;

    #[test]
    fn a_fault_of_a_controller_says_which_one_it_is_and_what_to_do_where_a_motor_is_on() {
        let rig = hbot_config::RigConfig::prototype().rig;
        let told = |fault, restarted| {
            let complaints = Complaints { fault, disobeyed: !fault, ..Complaints::default() };
            real(Cause::ControllerFault, &Sample { complaints, restarted, ..still(7) }, 0, &rig)
        };
        for (fault, restarted, message, cut) in [
            (true, false, "reports a fault", false),
            (false, true, "has restarted", false),
            (false, false, "or on although it is off", true),
        ] {
            let Explanation { message: said, remedy, .. } = told(fault, restarted);
            assert!(said.contains(message) && remedy.contains("cut the supply") == cut, "{said} {remedy}");
        }
    }

    #[test]
    fn a_missed_deadline_is_named_by_what_was_missed() {
        let late = deadline(23_400_000, 0);
        assert!(late.starts_with("a tick came 23.4 ms late (more than 20 is a fault): "), "{late}");
        let skipped = deadline(400_000, 12);
        assert!(skipped.starts_with("12 ticks in a row were skipped because"), "{skipped}");
        assert!(!skipped.contains("ms late"), "its lateness is not what is wrong: {skipped}");
        // If both conditions hold, the late tick is named.
        assert!(deadline(20_000_001, 40).starts_with("a tick came 20.0 ms late"));
    }
}
