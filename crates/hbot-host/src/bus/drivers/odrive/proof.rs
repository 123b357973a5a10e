//! Proves, before the first tick, that the watchdog of each axis switches its motor off.

use super::meet::{AGAIN_MS, ANSWER_MS, HEARTBEAT_MS, Refused};
use super::message::{Command, error, state};
use super::order::ON_MS;
use super::talk::{Met, Talk};
use crate::bus::{MeetError, Remedy};

/// Longest accepted watchdog time of an axis, in ms.
const WATCHDOG_MS: u64 = 120;
/// Time after the last message within which each axis must have reported that its watchdog has
/// expired, in ms: the longest watchdog time, and the time until the next heartbeat.
pub(super) const EXPIRED_MS: u64 = WATCHDOG_MS + HEARTBEAT_MS;
/// Number of times that zero torque and torque mode are commanded before a motor is switched on to
/// prove its watchdog. The commands are repeated because one of them can be lost.
const BEFORE_ARMED: u64 = 5;
/// Time between two messages that keep a watchdog from expiring, in ms.
const FEED_MS: u64 = 2;
/// Index into the notes of an [`Expected`](crate::bus::Expected): of each axis, 1 if its watchdog
/// was seen to expire only while its motor was on.
pub(super) const PROVED_ARMED: usize = 1;
/// The commands of the vendor's console that enable a watchdog of 20 ms.
const ENABLE: &str = "odrv0.axis0.config.watchdog_timeout = 0.02; odrv0.axis0.config.enable_watchdog = True";

/// Returns the remedy for an axis whose watchdog does not expire in time. `what` tells what was
/// tried.
fn no_watchdog(what: &str) -> Remedy {
    Remedy { what: what.to_owned(), command: format!("{ENABLE}; odrv0.save_configuration()") }
}

/// Returns the remedy for an axis that was left alone and did not report an expired watchdog.
pub(super) fn no_watchdog_idle() -> Remedy {
    no_watchdog(&format!(
        "left alone for {EXPIRED_MS} ms it does not say that its watchdog has expired: it is off, or slow, or it counts \
         only while the motor is on, which a scan does not try"
    ))
}

/// Tests the watchdogs of the axes. Feeds them until none is expired, then sends nothing until all
/// have expired. Axes that have not are tested once more with their motors on, at zero torque.
/// Returns the ids of these axes, or the first axis that fails. Reading the setting of a watchdog
/// would prove less, and the number of this setting differs between firmware versions.
pub(super) fn watchdogs(talk: &mut Talk<'_>, ids: &[u8]) -> Result<Result<Vec<u8>, (u8, Remedy)>, MeetError> {
    talk.say_all(ids, Command::AxisState(state::IDLE))?;
    if let Some(id) = talk.until(ANSWER_MS, ids, |met| met.state == state::IDLE)? {
        let what = format!("it is in state {} and does not become idle", talk.of(id).state);
        return Ok(Err((id, Remedy { what, command: "dump_errors(odrv0)".to_owned() })));
    }
    if let Some(id) = feed(talk, ids)? {
        let what = format!("its watchdog expires although it is fed every {FEED_MS} ms");
        return Ok(Err((id, no_watchdog(&what))));
    }
    let Some(_) = talk.until(EXPIRED_MS, ids, expired)? else { return Ok(Ok(Vec::new())) };
    let left: Vec<u8> = ids.iter().copied().filter(|id| !expired(talk.of(*id))).collect();
    let refused = armed(talk, &left)?;
    Ok(refused.map_or(Ok(left), Err))
}

fn expired(met: &Met) -> bool {
    met.error & error::WATCHDOG_TIMER_EXPIRED != 0
}

/// Feeds the axes until two heartbeats of each have arrived since its errors were last cleared, and
/// the last one shows no expired watchdog. The first of them can be older than the clearing. The
/// errors are cleared after feeding has begun, and again if they return: a watchdog that only
/// torques feed has expired again before the first one. Returns the first axis whose watchdog stays
/// expired.
fn feed(talk: &mut Talk<'_>, ids: &[u8]) -> Result<Option<u8>, MeetError> {
    let mut before = talk.met;
    for round in 0..ANSWER_MS / FEED_MS {
        talk.say_all(ids, Command::InputTorque(0.0))?;
        if round.is_multiple_of(AGAIN_MS / FEED_MS) {
            talk.say_all(ids, Command::ClearErrors)?;
            before = talk.met;
        }
        talk.listen(FEED_MS)?;
        let clear = |id: &u8| {
            talk.of(*id).heartbeats >= before[usize::from(*id)].heartbeats + 2 && !expired(talk.of(*id))
        };
        if ids.iter().all(clear) {
            return Ok(None);
        }
    }
    Ok(ids.iter().copied().find(|id| expired(talk.of(*id))))
}

/// Tests the watchdogs of axes with their motors on, at zero torque: switches the motors on, then
/// sends nothing until each has switched itself off because its watchdog has expired. Returns the
/// first axis that fails. All motors are off afterwards.
fn armed(talk: &mut Talk<'_>, ids: &[u8]) -> Result<Refused, MeetError> {
    let is_on = |met: &Met| met.state == state::CLOSED_LOOP;
    for round in 0..u64::from(ON_MS) / FEED_MS {
        talk.say_all(ids, Command::TorqueMode)?;
        talk.say_all(ids, Command::InputTorque(0.0))?;
        if round >= BEFORE_ARMED && round.is_multiple_of(BEFORE_ARMED) {
            let off: Vec<u8> = ids.iter().copied().filter(|id| !is_on(talk.of(*id))).collect();
            talk.say_all(&off, Command::AxisState(state::CLOSED_LOOP))?;
        }
        talk.listen(FEED_MS)?;
        if ids.iter().all(|id| is_on(talk.of(*id))) {
            break;
        }
    }
    let idle = format!("left alone for {EXPIRED_MS} ms it does not say that its watchdog has expired");
    let refused = match ids.iter().copied().find(|id| !is_on(talk.of(*id))) {
        Some(id) => {
            let error = talk.of(id).error;
            let what = format!(
                "{idle}, and it does not switch its motor on to show it at zero torque (errors {error:#x})"
            );
            Some((id, no_watchdog(&what)))
        }
        None => {
            let disarmed = |met: &Met| !is_on(met) && expired(met);
            let what =
                format!("{idle}, neither idle nor with its motor on at zero torque: it is off, or slow");
            talk.until(EXPIRED_MS, ids, disarmed)?.map(|id| (id, no_watchdog(&what)))
        }
    };
    for _ in 0..ANSWER_MS / AGAIN_MS {
        talk.say_all(ids, Command::AxisState(state::IDLE))?;
        if talk.until(AGAIN_MS, ids, |met| !is_on(met))?.is_none() {
            break;
        }
    }
    Ok(refused)
}
