//! Bring-up of a line of ODrives, before the first tick and after a lost line has been reopened. It
//! checks which axes are on the line, whether each is set up so that it can be commanded a torque,
//! and whether its watchdog switches its motor off.

use std::sync::atomic::Ordering;

use hbot_config::rig::Protocol as Name;

use super::axis::{mark, may_be_booted};
use super::message::{Command, Question, error, state};
use super::proof::{EXPIRED_MS, PROVED_ARMED, no_watchdog_idle, watchdogs};
use super::talk::{Met, Talk};
use crate::bus::{Expected, Filtering, Found, MeetError, Remedy, field};
use crate::line::Line;

/// Shortest time for which the driver counts positions and heartbeats before it judges the settings
/// of the axes, in ms. It is longer than the time between two heartbeats at the vendor's default
/// setting, 100 ms.
const LISTEN_MS: u64 = 120;
/// Longest wait for an answer or for a change of state, in ms.
pub(super) const ANSWER_MS: u64 = 1000;
/// Time after which a question is repeated, in ms.
pub(super) const AGAIN_MS: u64 = 50;
/// Longest accepted average time between two positions of an axis, in ms.
const ESTIMATES_MS: u64 = 4;
/// Longest accepted average time between two heartbeats of an axis, in ms.
pub(super) const HEARTBEAT_MS: u64 = 20;
/// Oldest firmware that has the messages that the driver needs, as major and minor version.
const FIRMWARE: [u8; 2] = [0, 6];
/// Largest number of axes on a line. With more of them, the last word would exceed 255 bytes.
const MOST_AXES: usize = 11;

/// Brings up the axes of a line. Checks that all axes of the rig answer and no others, that their
/// motors are off, that their settings are right, and that the watchdog of each expires.
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
    let armed = match watchdogs(&mut talk, &ids)? {
        Ok(armed) => armed,
        Err((id, remedy)) => return Err(said(id, &remedy)),
    };
    for (at, id) in ids.iter().enumerate() {
        let is_armed = armed.contains(id);
        expected.note(PROVED_ARMED + at).store(i64::from(is_armed), Ordering::Relaxed);
        if let Some([major, minor, revision]) = talk.of(*id).firmware {
            let proof = if is_armed { "armed at zero torque" } else { "idle" };
            let name = format!("ODrive {major}.{minor}.{revision}, watchdog seen to expire {proof}");
            expected.set_firmware(at, name);
        }
    }
    if let Some(refused) = marks(&mut talk, expected)? {
        return Err(said(refused.0, &refused.1));
    }
    let chatty = ids.iter().find_map(|id| Some((*id, unasked(talk.of(*id))?)));
    chatty.map_or(Ok(()), |(id, remedy)| Err(said(id, &remedy)))
}

/// Switches the motors off. Returns whether an axis may have restarted since its last bring-up.
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

/// Lists all axes on a line, with each setting that is wrong. Changes nothing. To find out whether
/// the watchdogs work, it sends nothing at the end until each must have expired.
pub(super) fn scan(line: &mut dyn Line, expected: &Expected) -> Result<Vec<Found>, MeetError> {
    let mut talk = Talk::open(line, expected)?;
    who_is_there(&mut talk, &ids(expected))?;
    let listened_ms = talk.now_ms;
    let said = talk.met;
    talk.listen(EXPIRED_MS)?;
    let mut found = Vec::new();
    for id in talk.there() {
        let met = &said[usize::from(id)];
        let mut remedies = settings(met, listened_ms);
        if talk.of(id).error & error::WATCHDOG_TIMER_EXPIRED == 0 {
            remedies.push(no_watchdog_idle());
        }
        remedies.extend(unasked(talk.of(id)));
        let others = talk.of(id).error & !error::WATCHDOG_TIMER_EXPIRED;
        if others != 0 {
            remedies.push(Remedy {
                what: format!("it has the errors {others:#x}"),
                command: "dump_errors(odrv0), then odrv0.clear_errors()".to_owned(),
            });
        }
        let [board, minor, variant] = met.hardware;
        let firmware = met.firmware.map_or("unknown".to_owned(), |[a, b, c]| format!("{a}.{b}.{c}"));
        let one = Found {
            id,
            model: format!("ODrive (board {board}.{minor}, variant {variant})"),
            firmware: format!("{firmware}, CANSimple"),
            supply_v: met.supply,
            zero: None,
            filtering: Filtering::default(),
            remedies,
        };
        let twice = met.answered > met.asked;
        found.extend(std::iter::repeat_n(one, if twice { 2 } else { 1 }));
    }
    Ok(found)
}

/// Returns the ids of the rig's axes on this line, in the order of the bus.
fn ids(expected: &Expected) -> Vec<u8> {
    (0..expected.joints()).filter_map(|at| expected.joint(at)).map(|joint| joint.id).collect()
}

/// Returns the name of an axis for messages: its id, and its joint if the rig has one with this id.
fn name(expected: &Expected, id: u8) -> String {
    let joint = (0..expected.joints()).filter_map(|at| expected.joint(at)).find(|joint| joint.id == id);
    joint.map_or(format!("ODrive {id}"), |joint| format!("ODrive {id} ({})", field(joint.number)))
}

/// Asks the rig's axes and all others on the line for their version and supply, until all have
/// answered or [`ANSWER_MS`] has passed. Fails if no axis is heard.
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

/// Returns an error message if the axes on the line are not those of the rig file: two axes have
/// one id, one is missing, or one is not in the rig file. Otherwise returns `None`.
fn crowd(talk: &Talk<'_>, expected: &Expected) -> Option<String> {
    let ids = ids(expected);
    let listed = |ids: &[u8]| ids.iter().map(u8::to_string).collect::<Vec<_>>().join(", ");
    let there = talk.there();
    if let Some(id) = there.iter().find(|id| talk.of(**id).answered > talk.of(**id).asked) {
        return Some(format!(
            "two ODrives have the id {id}: disconnect one and give the other a new one \
             (odrv0.axis0.config.can.node_id = N, odrv0.save_configuration()); if there is one, it sends its version \
             unasked (odrv0.axis0.config.can.version_msg_rate_ms = 0)"
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

/// Returns the settings of an axis that are wrong, each with the command that corrects it. The
/// intervals of positions and heartbeats are computed from the numbers that arrived in
/// `listened_ms`.
fn settings(met: &Met, listened_ms: u64) -> Vec<Remedy> {
    let mut remedies = Vec::new();
    let save = "odrv0.save_configuration()";
    let mut wrong = |what: String, command: String| remedies.push(Remedy { what, command });
    match met.firmware {
        Some([major, minor, revision]) if [major, minor] < FIRMWARE => {
            let what = format!("its firmware is {major}.{minor}.{revision}, this program needs 0.6 or newer");
            wrong(what, "odrivetool dfu".to_owned());
        }
        Some(_) => {}
        None => wrong(
            "it has not said its firmware (Get_Version), which 0.6 or newer does".to_owned(),
            "check that the adapter passes remote frames; then odrivetool dfu".to_owned(),
        ),
    }
    if met.estimates > 0 && met.position.is_none() {
        wrong("its position is no number".to_owned(), "check and calibrate its encoder".to_owned());
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

/// Returns the remedy for an axis that sends its current or temperature without being asked. The
/// loop asks for them to learn how old positions are, and would take them for answers.
fn unasked(met: &Met) -> Option<Remedy> {
    let settings = ["iq_msg_rate_ms", "temperature_msg_rate_ms"];
    let (_, setting) = met.unasked.iter().zip(settings).find(|(heard, _)| **heard > 0)?;
    Some(Remedy {
        what: "it sends its current or temperature unasked, so nobody knows how old its positions are"
            .to_owned(),
        command: format!("odrv0.axis0.config.can.{setting} = 0; odrv0.save_configuration()"),
    })
}

/// The first axis that fails a check, with what is wrong and its remedy. `None` if all pass.
pub(super) type Refused = Option<(u8, Remedy)>;

/// Marks the position of each axis that has no mark: moves it away from 0, so that the driver can
/// later detect a restart. Returns the first axis that does not accept its new position.
fn marks(talk: &mut Talk<'_>, expected: &Expected) -> Result<Refused, MeetError> {
    let ids = ids(expected);
    for joint in (0..expected.joints()).filter_map(|at| expected.joint(at)) {
        let position = talk.of(joint.id).position.unwrap_or(0.0);
        if may_be_booted(position) {
            talk.say(joint.id, Command::AbsolutePosition((position + mark(joint.gear)) as f32))?;
        }
    }
    // The torque comes first, so that a watchdog that only torques feed does not expire again.
    for command in [Command::TorqueMode, Command::InputTorque(0.0), Command::ClearErrors] {
        talk.say_all(&ids, command)?;
    }
    let marked = |met: &Met| met.position.is_some_and(|position| !may_be_booted(position));
    let refused = talk.until(ANSWER_MS, &ids, marked)?;
    Ok(refused.map(|id| {
        let what = "it does not take a position (Set_Absolute_Position)".to_owned();
        (id, Remedy { what, command: "odrivetool dfu".to_owned() })
    }))
}
