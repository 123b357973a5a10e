//! The error messages for commands that the loop refuses.

use hbot_api::{ErrorBody, ErrorCode, OpName};
use hbot_core::Rig;
use hbot_core::design::rig::Zero;
use hbot_core::outputs::Refusal;
use hbot_core::safety::mode::{Cause, Obstacle};

use super::convert;
use hbot_host::run_loop::sample::Sample;

/// Returns the error message for a client whose request `op` the loop has refused in the tick of
/// `sample`. `simulated` says whether the rig is simulated. `effect` returns the id of the effect
/// in a slot of the scene. `earlier_hand` is the name of the earlier scene whose hand still moves
/// the simulated rig, if there is one.
pub(super) fn refusal<'a>(
    op: &str,
    refusal: Refusal,
    rig: &Rig,
    (sample, simulated): (&Sample, bool),
    effect: impl FnOnce(u8) -> Option<&'a str>,
    earlier_hand: Option<&str>,
) -> ErrorBody {
    let limits = &rig.limits;
    let (code, message) = match refusal {
        Refusal::Mode(Obstacle::Faulted(cause)) => {
            let name = convert::fault(cause);
            let message = if op == OpName::Reset.as_str() {
                let remedy = still_there(cause, sample, rig, simulated);
                format!("op {op}: the cause of fault {name} is still there: {remedy}")
            } else {
                format!("op {op}: the rig is in fault {name}: remove its cause and reset first")
            };
            (ErrorCode::Faulted, message)
        }
        Refusal::Mode(Obstacle::Stopped) => {
            (ErrorCode::Faulted, format!("op {op}: the rig was stopped: reset first"))
        }
        Refusal::Mode(Obstacle::Unreferenced) => (
            ErrorCode::Faulted,
            format!("op {op}: a steering zero is not known: {}", homing(rig, simulated)),
        ),
        Refusal::TooFar { slot, angle } => {
            let id = effect(slot).unwrap_or("?");
            // Nobody can turn a simulated sphere by hand.
            let remedy = if simulated { "Set" } else { "Turn the sphere towards it, or set" };
            let mut message = format!(
                "op {op}: the reference of effect {id:?} is {angle:.3} rad from the sphere's orientation; legal: at \
                 most {} rad (limits.enable_max_angle). {remedy} its anchor to \"here\" (`hbot set {id} anchor=here`), \
                 then enable again",
                limits.enable_max_angle
            );
            if let Some(scene) = earlier_hand {
                let hand = format!(". The simulated hand of the scene {scene:?} still moves the sphere");
                message.push_str(&hand);
            }
            return ErrorBody { angle: Some(angle), ..ErrorBody::new(ErrorCode::OutOfRange, message) };
        }
        Refusal::NoReference => {
            (ErrorCode::UnknownEffect, format!("op {op}: the effect is no longer there, or has no reference"))
        }
        Refusal::TooOld { age_ticks } => (
            ErrorCode::OutOfRange,
            format!(
                "field \"tick\" is {age_ticks} ticks ago; legal: at most {} (limits.max_age_ticks)",
                limits.max_age_ticks
            ),
        ),
        Refusal::Ahead { ticks } => (
            ErrorCode::OutOfRange,
            format!(
                "field \"tick\" is {ticks} ticks in the future; legal: the tick of a state that was sent"
            ),
        ),
        Refusal::NotInHistory if op == OpName::Model.as_str() => (
            ErrorCode::OutOfRange,
            "field \"tick\" is not (or no longer) in the history; legal: one of the last 1024, or a model with \"pose\""
                .to_owned(),
        ),
        Refusal::NotInHistory => (
            ErrorCode::OutOfRange,
            "field \"t\" is not (or no longer) in the history; legal: a moment of about the last second"
                .to_owned(),
        ),
        Refusal::NotFinite => (
            ErrorCode::BadRequest,
            format!("op {op}: a number is not finite, or a quaternion not of unit norm"),
        ),
    };
    ErrorBody::new(code, message)
}

/// Says what is known in the tick of `sample` about a cause that is still there, and what removes
/// it.
fn still_there(cause: Cause, sample: &Sample, rig: &Rig, simulated: bool) -> String {
    if cause != Cause::Overspeed {
        return "remove it first".to_owned();
    }
    let limit = rig.limits.speed;
    let what = match sample.state.omega.length() {
        speed if speed > limit => {
            format!("the sphere turns at {speed:.3} rad/s; the limit is {limit} (limits.speed)")
        }
        _ => format!(
            "by its encoders' counts the sphere turned faster than {limit} rad/s (limits.speed) over 25 ms"
        ),
    };
    let remedy = if simulated {
        "If it spins on freely, let a hand hold it: `hbot scene load spring --ideal`, or a scene with `hand = {}` in [simulate]"
    } else {
        "Stop the sphere first"
    };
    format!("{what}. {remedy}")
}

/// Returns what makes the zeros of all steer joints known.
fn homing(rig: &Rig, simulated: bool) -> String {
    let has = |zero| (0..rig.device.joints()).step_by(2).any(|joint| rig.joints[joint].zero == zero);
    let assumed = if simulated {
        "start the server again"
    } else {
        "switch the controllers off, set the wheels to their zeros, switch the controllers on, then start the \
         server again"
    };
    let remedies = [
        (Zero::Index, "turn the wheels past their index"),
        (Zero::Calibrate, "run `hbot rig calibrate`, then give the joint another `zero` in the rig file"),
        (Zero::Assume, assumed),
    ];
    let needed: Vec<_> = remedies.iter().filter(|(zero, _)| has(*zero)).map(|(_, what)| *what).collect();
    if needed.is_empty() { "wait for the first reading".to_owned() } else { needed.join("; ") }
}

#[cfg(test)]
mod tests {
    use hbot_config::RigConfig;
    use hbot_core::Vec3;
    use hbot_core::design::rig::RigParts;

    use super::*;

    #[test]
    fn a_reset_that_overspeed_prevents_says_how_fast_the_sphere_turns() {
        let rig = RigConfig::prototype().rig;
        let told = |cause, speed, simulated| {
            let mut sample = crate::still::still(7);
            sample.state.omega = Vec3::new(0.0, speed, 0.0);
            let refused = Refusal::Mode(Obstacle::Faulted(cause));
            refusal("reset", refused, &rig, (&sample, simulated), |_| None, None).message
        };
        let fast = told(Cause::Overspeed, 45.25, true);
        assert!(fast.contains("fault overspeed is still there: the sphere turns at 45.250 rad/s"), "{fast}");
        assert!(fast.contains(&format!("the limit is {} (limits.speed)", rig.limits.speed)), "{fast}");
        assert!(fast.ends_with("let a hand hold it: `hbot scene load spring --ideal`, or a scene with `hand = {}` in [simulate]"), "{fast}");
        let real = told(Cause::Overspeed, 45.25, false);
        assert!(real.ends_with("Stop the sphere first") && !real.contains("scene"), "{real}");
        assert!(told(Cause::Overspeed, 0.0, false).contains("by its encoders' counts"));
        assert!(told(Cause::Thermal, 45.25, true).ends_with("is still there: remove it first"));
    }

    #[test]
    fn a_zero_that_is_not_known_is_found_as_the_rig_file_says() {
        let told = |first, second, simulated| {
            let set = |parts: &mut RigParts| {
                (parts.joints[0].zero, parts.joints[2].zero) = (first, second);
            };
            let rig = RigConfig::prototype().rig.with(set).expect("each zero is legal");
            let sample = crate::still::still(7);
            let refused = Refusal::Mode(Obstacle::Unreferenced);
            refusal("enable", refused, &rig, (&sample, simulated), |_| None, None).message
        };
        let index = "op enable: a steering zero is not known: turn the wheels past their index";
        assert_eq!(told(Zero::Absolute, Zero::Index, false), index);
        let assumed = told(Zero::Assume, Zero::Assume, false);
        assert!(assumed.contains("set the wheels to their zeros") && !assumed.contains("index"), "{assumed}");
        let simulated = told(Zero::Assume, Zero::Assume, true);
        assert!(simulated.ends_with("not known: start the server again"), "{simulated}");
        let both = told(Zero::Index, Zero::Calibrate, false);
        assert!(both.starts_with(index) && both.contains("; run `hbot rig calibrate`"), "{both}");
    }

    #[test]
    fn a_reference_that_is_too_far_is_anchored_or_the_sphere_turned_if_somebody_can() {
        let rig = RigConfig::prototype().rig;
        let told = |simulated, hand| {
            let sample = crate::still::still(7);
            let refused = Refusal::TooFar { slot: 0, angle: 1.25 };
            refusal("enable", refused, &rig, (&sample, simulated), |_| Some("spring"), hand).message
        };
        let anchor = "et its anchor to \"here\" (`hbot set spring anchor=here`), then enable again";
        let simulated = told(true, None);
        assert!(simulated.contains("is 1.250 rad from the sphere's orientation"), "{simulated}");
        assert!(simulated.ends_with(&format!("(limits.enable_max_angle). S{anchor}")), "{simulated}");
        let hand = told(true, Some("Held"));
        assert!(hand.contains(anchor) && hand.ends_with("of the scene \"Held\" still moves the sphere"));
        let real = told(false, None);
        assert!(real.ends_with(&format!(". Turn the sphere towards it, or s{anchor}")), "{real}");
    }
}
