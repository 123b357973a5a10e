//! Before the first tick, and when a line is back: who is there, whether each axis is set up so
//! that a torque may be asked of it, and that its watchdog stops it.

use hbot_config::rig::Protocol as Name;

use super::axis::{mark, may_be_booted};
use super::message::{Command, Question, error, state};
use super::talk::{Met, Talk};
use crate::bus::{Expected, Found, MeetError, Remedy, field};
use crate::line::Line;

/// How long axes are listened to before anything is said of them, ms: longer than the time between
/// two heartbeats of an axis that is not set up.
const LISTEN_MS: u64 = 120;
/// How long an answer, or a change of state, is waited for, ms.
const ANSWER_MS: u64 = 1000;
/// A question is asked again after this time, ms.
const AGAIN_MS: u64 = 50;
/// The longest time that an axis may go on without a command, ms.
const WATCHDOG_MS: u64 = 120;
/// The longest times between positions and between heartbeats, ms.
const ESTIMATES_MS: u64 = 4;
const HEARTBEAT_MS: u64 = 20;
/// Time between two messages that feed a watchdog, ms.
const FEED_MS: u64 = 2;
/// The oldest firmware that has these messages.
const FIRMWARE: [u8; 2] = [0, 6];
/// The most axes of a line: their last word fits 255 bytes.
const MOST_AXES: usize = 11;

/// The vendor's command that enables a watchdog.
const ENABLE: &str = "odrv0.axis0.config.watchdog_timeout = 0.02; odrv0.axis0.config.enable_watchdog = True";

/// Meets the axes: they are all there and no others, motors are off, and each has shown that its
/// watchdog expires.
pub(super) fn meet(line: &mut dyn Line, expected: &Expected) -> Result<(), MeetError> {
    let wrong = |reason| MeetError::Setting { port: expected.port().to_owned(), reason };
    if expected.joints() > MOST_AXES {
        return Err(wrong(format!(
            "{} ODrives are too many for one line: at most {MOST_AXES}",
            expected.joints()
        )));
    }
    let counts = Name::Odrive.counts_per_turn().unwrap_or_default();
    if let Some(at) = expected.first_wrong_counts((0..expected.joints()).map(|_| counts)) {
        return Err(expected.wrong_counts(at, counts));
    }
    let ids = ids(expected);
    let mut talk = Talk::open(line, expected)?;
    talk.say_all(&ids, Command::AxisState(state::IDLE))?;
    who_is_there(&mut talk, &ids)?;
    if let Some(reason) = crowd(&talk, expected) {
        return Err(wrong(reason));
    }
    let said = |id: u8, remedy: &Remedy| {
        wrong(format!("{}: {}: {}", name(expected, id), remedy.what, remedy.command))
    };
    for id in &ids {
        if let Some(remedy) = settings(talk.of(*id), talk.now_ms).first() {
            return Err(said(*id, remedy));
        }
    }
    let refused = match watchdogs(&mut talk, &ids)? {
        None => marks(&mut talk, expected)?,
        refused => refused,
    };
    refused.map_or(Ok(()), |(id, remedy)| Err(said(id, &remedy)))
}

/// Switches the motors off. Returns whether an axis may have lost power since it was met.
pub(super) fn switch_off(line: &mut dyn Line, expected: &Expected) -> Result<bool, MeetError> {
    let ids = ids(expected);
    let mut talk = Talk::open(line, expected)?;
    let is_off = |met: &Met| met.heartbeats > 0 && met.state != state::CLOSED_LOOP && met.position.is_some();
    for _ in 0..ANSWER_MS / AGAIN_MS {
        talk.say_all(&ids, Command::AxisState(state::IDLE))?;
        if talk.until(AGAIN_MS, &ids, is_off)?.is_none() {
            let booted =
                |met: &Met| met.position.is_none_or(may_be_booted) || met.error & error::INITIALIZING != 0;
            return Ok(ids.iter().any(|id| booted(talk.of(*id))));
        }
    }
    Err(MeetError::Silent { port: talk.port() })
}

/// All axes on a line, as they are. Changes nothing: it asks, and then leaves them alone.
pub(super) fn scan(line: &mut dyn Line, expected: &Expected) -> Result<Vec<Found>, MeetError> {
    let mut talk = Talk::open(line, expected)?;
    who_is_there(&mut talk, &ids(expected))?;
    let listened_ms = talk.now_ms;
    let said = talk.met;
    talk.listen(WATCHDOG_MS + HEARTBEAT_MS)?;
    let mut found = Vec::new();
    for id in talk.there() {
        let met = &said[usize::from(id)];
        let mut remedies = settings(met, listened_ms);
        if talk.of(id).error & error::WATCHDOG_TIMER_EXPIRED == 0 {
            remedies.push(no_watchdog());
        }
        let others = talk.of(id).error & !error::WATCHDOG_TIMER_EXPIRED;
        if others != 0 {
            remedies.push(Remedy {
                what: format!("it has the errors {others:#x}"),
                command: "dump_errors(odrv0), then odrv0.clear_errors()".to_owned(),
            });
        }
        let [board, minor, variant] = met.hardware;
        let [major, middle, revision] = met.firmware.unwrap_or_default();
        let one = Found {
            id,
            model: format!("ODrive (board {board}.{minor}, variant {variant})"),
            firmware: format!("{major}.{middle}.{revision}, CANSimple"),
            supply_v: met.supply,
            zero: None,
            remedies,
        };
        let twice = met.answered > met.asked;
        found.extend(std::iter::repeat_n(one, if twice { 2 } else { 1 }));
    }
    Ok(found)
}

/// The ids of the rig's axes, in the order of the bus.
fn ids(expected: &Expected) -> Vec<u8> {
    (0..expected.joints()).filter_map(|at| expected.joint(at)).map(|joint| joint.id).collect()
}

/// An axis in messages.
fn name(expected: &Expected, id: u8) -> String {
    let joint = (0..expected.joints()).filter_map(|at| expected.joint(at)).find(|joint| joint.id == id);
    joint.map_or(format!("ODrive {id}"), |joint| format!("ODrive {id} ({})", field(joint.number)))
}

/// Asks the rig's axes, and then all that have been heard, for what they are.
fn who_is_there(talk: &mut Talk<'_>, ids: &[u8]) -> Result<(), MeetError> {
    let started = talk.now_ms;
    while talk.now_ms - started < ANSWER_MS {
        let mut asked = ids.to_vec();
        asked.extend(talk.there().iter().filter(|id| !ids.contains(id)));
        asked.retain(|id| talk.of(*id).firmware.is_none() || talk.of(*id).supply.is_none());
        for id in &asked {
            talk.met[usize::from(*id)].asked += 1;
            talk.say(*id, Command::Ask(Question::Version))?;
            talk.say(*id, Command::Ask(Question::Supply))?;
        }
        if asked.is_empty() && talk.now_ms - started >= LISTEN_MS {
            return Ok(());
        }
        talk.listen(AGAIN_MS)?;
    }
    if talk.there().is_empty() { Err(MeetError::Silent { port: talk.port() }) } else { Ok(()) }
}

/// Why the axes that are there are not those of the rig.
fn crowd(talk: &Talk<'_>, expected: &Expected) -> Option<String> {
    let ids = ids(expected);
    let listed = |ids: &[u8]| ids.iter().map(u8::to_string).collect::<Vec<_>>().join(", ");
    let there = talk.there();
    if let Some(id) = there.iter().find(|id| talk.of(**id).answered > talk.of(**id).asked) {
        return Some(format!(
            "two ODrives have the id {id}: disconnect one and give the other a new one \
             (odrv0.axis0.config.can.node_id = N, odrv0.save_configuration())"
        ));
    }
    let missing: Vec<u8> = ids.iter().copied().filter(|id| talk.of(*id).firmware.is_none()).collect();
    if let Some(first) = missing.first() {
        return Some(format!(
            "no answer from {}; the ids {} were heard: check power, wiring and the bus's ends, or `controller` in the \
             rig file",
            name(expected, *first),
            listed(&there)
        ));
    }
    let others: Vec<u8> = there.iter().copied().filter(|id| !ids.contains(id)).collect();
    (!others.is_empty()).then(|| {
        format!(
            "ODrives of id {} are on the line and not in the rig file, which has {}: disconnect them, or name them",
            listed(&others),
            listed(&ids)
        )
    })
}

/// What of an axis's settings is not as it must be, as far as it shows in `listened_ms` of
/// listening.
fn settings(met: &Met, listened_ms: u64) -> Vec<Remedy> {
    let mut remedies = Vec::new();
    let save = "odrv0.save_configuration()";
    let mut wrong = |what: String, command: String| remedies.push(Remedy { what, command });
    let [major, minor, revision] = met.firmware.unwrap_or_default();
    if [major, minor] < FIRMWARE {
        let what = format!("its firmware is {major}.{minor}.{revision}, this program needs 0.6 or newer");
        wrong(what, "odrivetool dfu".to_owned());
    }
    let apart = |count: u32| listened_ms / u64::from(count.max(1));
    if apart(met.estimates) > ESTIMATES_MS {
        let what = format!("it has said its position {} times in {listened_ms} ms", met.estimates);
        wrong(what, format!("odrv0.axis0.config.can.encoder_msg_rate_ms = 1; {save}"));
    }
    if apart(met.heartbeats) > HEARTBEAT_MS {
        let what = format!("it has said its state {} times in {listened_ms} ms", met.heartbeats);
        wrong(what, format!("odrv0.axis0.config.can.heartbeat_msg_rate_ms = 10; {save}"));
    }
    remedies
}

fn no_watchdog() -> Remedy {
    Remedy {
        what: format!(
            "left alone for {WATCHDOG_MS} ms it does not say that its watchdog has expired: it is off, or slow"
        ),
        command: format!("{ENABLE}; odrv0.save_configuration()"),
    }
}

/// An axis that is not as it must be.
type Refused = Option<(u8, Remedy)>;

/// Leaves the axes alone until the watchdog of each has expired. A setting would tell less, and
/// none can be read by a name that is the same in every firmware.
fn watchdogs(talk: &mut Talk<'_>, ids: &[u8]) -> Result<Refused, MeetError> {
    let expired = |met: &Met| met.error & error::WATCHDOG_TIMER_EXPIRED != 0;
    talk.say_all(ids, Command::AxisState(state::IDLE))?;
    if let Some(id) = talk.until(ANSWER_MS, ids, |met| met.state == state::IDLE)? {
        let what = format!("it is in state {} and does not become idle", talk.of(id).state);
        return Ok(Some((id, Remedy { what, command: "dump_errors(odrv0)".to_owned() })));
    }
    // Fed until heartbeats say that it has not expired: one that is on its way may be older than
    // the clearing.
    talk.say_all(ids, Command::ClearErrors)?;
    let before = talk.met;
    let mut fed = false;
    for _ in 0..ANSWER_MS / FEED_MS {
        talk.say_all(ids, Command::InputTorque(0.0))?;
        talk.listen(FEED_MS)?;
        let clear = |id: &u8| {
            talk.of(*id).heartbeats >= before[usize::from(*id)].heartbeats + 2 && !expired(talk.of(*id))
        };
        fed = ids.iter().all(clear);
        if fed {
            break;
        }
    }
    if !fed && let Some(id) = ids.iter().copied().find(|id| expired(talk.of(*id))) {
        let what = format!("its watchdog expires although it is fed every {FEED_MS} ms");
        return Ok(Some((id, Remedy { what, command: format!("{ENABLE}; odrv0.save_configuration()") })));
    }
    let refused = talk.until(WATCHDOG_MS + HEARTBEAT_MS, ids, expired)?;
    Ok(refused.map(|id| (id, no_watchdog())))
}

/// Sets positions so that a restart shows, where one did not since they were set.
fn marks(talk: &mut Talk<'_>, expected: &Expected) -> Result<Refused, MeetError> {
    let ids = ids(expected);
    for joint in (0..expected.joints()).filter_map(|at| expected.joint(at)) {
        let position = talk.of(joint.id).position.unwrap_or(0.0);
        if may_be_booted(position) {
            talk.say(joint.id, Command::AbsolutePosition((position + mark(joint.gear)) as f32))?;
        }
    }
    for command in [Command::TorqueMode, Command::ClearErrors, Command::InputTorque(0.0)] {
        talk.say_all(&ids, command)?;
    }
    let marked = |met: &Met| met.position.is_some_and(|position| !may_be_booted(position));
    let refused = talk.until(ANSWER_MS, &ids, marked)?;
    Ok(refused.map(|id| {
        let what = "it does not take a position (Set_Absolute_Position)".to_owned();
        (id, Remedy { what, command: "odrivetool dfu".to_owned() })
    }))
}
