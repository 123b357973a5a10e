//! The error messages for commands that the loop refuses.

use hbot_api::{ErrorBody, ErrorCode, OpName};
use hbot_core::Rig;
use hbot_core::mode::Obstacle;
use hbot_core::outputs::Refusal;

use super::convert;

/// Returns the error message for a client whose request `op` the loop has refused. `effect` returns
/// the id of the effect in a slot of the scene. `earlier_hand` is the name of the earlier scene
/// whose hand still moves the simulated rig, if there is one.
pub(super) fn refusal<'a>(
    op: &str,
    refusal: Refusal,
    rig: &Rig,
    effect: impl FnOnce(u8) -> Option<&'a str>,
    earlier_hand: Option<&str>,
) -> ErrorBody {
    let limits = &rig.limits;
    let (code, message) = match refusal {
        Refusal::Mode(Obstacle::Faulted(cause)) => {
            let cause = convert::fault(cause);
            let message = if op == OpName::Reset.as_str() {
                format!("op {op}: the cause of fault {cause} is still there: remove it first")
            } else {
                format!("op {op}: the rig is in fault {cause}: remove its cause and reset first")
            };
            (ErrorCode::Faulted, message)
        }
        Refusal::Mode(Obstacle::Stopped) => {
            (ErrorCode::Faulted, format!("op {op}: the rig was stopped: reset first"))
        }
        Refusal::Mode(Obstacle::Unreferenced) => (
            ErrorCode::Faulted,
            format!("op {op}: a steering zero is not known: turn the wheels past their index, or calibrate"),
        ),
        Refusal::TooFar { slot, angle } => {
            let id = effect(slot).unwrap_or("?");
            let mut message = format!(
                "op {op}: the reference of effect {id:?} is {angle:.3} rad from the sphere's orientation; legal: at \
                 most {} rad (limits.enable_max_angle). Turn the sphere, or set anchor = \"here\"",
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
