//! Checks that the servos on a line are those of the rig file, and that their settings allow torque
//! commands.

use std::f64::consts::TAU;

use super::REGISTER_MAP;
use super::codec::{self, Turn};
use super::talk::Talk;
use crate::bus::{Expected, Filtering, Found, Lag, MeetError, Remedy};
use crate::line::Line;
use hbot_config::rig::Protocol as Name;

/// A setting of a servo that must have a certain value, with the reason.
struct Must {
    name: &'static str,
    /// The required value, as text for the command that corrects the setting.
    value: &'static str,
    is: fn(f64) -> bool,
    why: &'static str,
}

/// The servo settings that must have certain values before torque is commanded.
const SETTINGS: [Must; 4] = [
    Must {
        name: "servo.timeout_mode",
        value: "0",
        is: |mode| mode == 0.0,
        why: "with another the motor brakes when its watchdog expires",
    },
    Must {
        name: "servopos.position_min",
        value: "nan",
        is: f64::is_nan,
        why: "beyond a limit a servo that is switched on ends in fault 39",
    },
    Must {
        name: "servopos.position_max",
        value: "nan",
        is: f64::is_nan,
        why: "beyond a limit a servo that is switched on ends in fault 39",
    },
    Must {
        name: "motor_position.rotor_to_output_ratio",
        value: "1",
        is: |ratio| ratio == 1.0,
        why: "the rig file's gear has the ratio",
    },
];

/// Checks the servos on a line before torque is commanded: each servo of the rig file answers
/// exactly once, no other servo answers, and all settings have their required values. Also switches
/// all motors off.
pub(super) fn meet(line: &mut dyn Line, expected: &Expected) -> Result<(), MeetError> {
    let counts = Name::Moteus.counts_per_turn().unwrap_or_default();
    if let Some(at) = expected.first_wrong_counts((0..expected.joints()).map(|_| counts)) {
        return Err(expected.wrong_counts(at, counts));
    }
    let mut talk = Talk::open(line, expected)?;
    talk.stop()?;
    let ids: Vec<u8> = (0..expected.joints()).filter_map(|at| Some(expected.joint(at)?.id)).collect();
    let found = found(&mut talk)?;
    if found.is_empty() {
        return Err(MeetError::Silent { port: expected.port().to_owned() });
    }
    let wrong = |reason| MeetError::Setting { port: expected.port().to_owned(), reason };
    if let Some(reason) = crowd(&found, &ids) {
        return Err(wrong(reason));
    }
    if let Some((id, remedy)) = found.iter().find_map(|it| Some((it.id, it.remedies.first()?))) {
        return Err(wrong(format!("moteus of id {id}: {}: {}", remedy.what, remedy.command)));
    }
    for (at, id) in ids.iter().enumerate() {
        echoes(&mut talk, *id, at)?;
        // All ids have been found: `crowd` has checked it.
        if let Some(it) = found.iter().find(|it| it.id == *id) {
            expected.set_firmware(at, format!("moteus {}", it.firmware));
            expected.set_filtering(at, it.filtering.clone());
        }
    }
    Ok(())
}

/// Returns all servos on a line with their settings. Changes nothing in the servos.
pub(super) fn scan(line: &mut dyn Line, expected: &Expected) -> Result<Vec<Found>, MeetError> {
    found(&mut Talk::open(line, expected)?)
}

fn found(talk: &mut Talk<'_>) -> Result<Vec<Found>, MeetError> {
    let all = talk.everybody()?;
    let port = talk.expected().port().to_owned();
    let mut found = Vec::new();
    for (id, state) in &all {
        let twice = all.iter().filter(|(other, _)| other == id).count() > 1;
        let map = state.register_map.unwrap_or_default();
        let mut remedies = Vec::new();
        let mut filtering = Filtering::default();
        let unknown = if map != REGISTER_MAP {
            Some(format!("its register map is version {map}, this program knows {REGISTER_MAP}"))
        } else if state.uptime_ms.is_none() {
            Some("it does not report its time since power-on (register 0x070)".to_owned())
        } else {
            None
        };
        if let Some(what) = unknown {
            let how = if map > REGISTER_MAP { "flash an older firmware" } else { "update the firmware" };
            let command = format!("{how}: python3 -m moteus.moteus_tool -t {id} --flash FILE");
            remedies.push(Remedy { what, command });
        } else if !twice {
            // Two servos with one id answer at once, so their settings cannot be told apart.
            for must in &SETTINGS {
                let said = talk.setting(*id, must.name)?;
                if !said.parse().is_ok_and(must.is) {
                    remedies.push(mend(&port, *id, must, &said));
                }
            }
            filtering = self::filtering(talk, *id, state.firmware.unwrap_or_default())?;
        }
        let home = ["none: relative", "known within a turn of the rotor", "known at the output"];
        found.push(Found {
            id: *id,
            model: model(state.model.unwrap_or_default()),
            firmware: format!("{:#06x}, register map {map}", state.firmware.unwrap_or_default()),
            supply_v: state.voltage.map(|half| f64::from(half) * 0.5),
            zero: state.home.and_then(|home_state| home.get(usize::try_from(home_state).ok()?)).copied(),
            filtering,
            remedies,
        });
    }
    Ok(found)
}

/// The first firmware whose setting `pll_filter_hz` is the 3 dB bandwidth of the filter. In older
/// firmware it is the natural frequency (`set_encoder_filter` of the vendor's `moteus_tool` 1.1.1).
const BANDWIDTH_SINCE: i32 = 0x010c;

/// Reads the settings of servo `id` that make its torque and its rate late. Both bandwidths are
/// chosen by `moteus_tool --calibrate --cal-bw-hz`. A setting that the firmware does not have gives
/// `None`. `firmware` is the version of the firmware.
fn filtering(talk: &mut Talk<'_>, id: u8, firmware: i32) -> Result<Filtering, MeetError> {
    let source = talk.setting(id, "motor_position.output.source")?;
    let mut lag = |setting: String, at_1_hz: f64| {
        let said: Option<f64> = talk.setting(id, &setting)?.parse().ok();
        let hz = said.filter(|hz| *hz > 0.0);
        Ok::<_, MeetError>(hz.map(|hz| Lag { setting, hz, seconds: at_1_hz / hz }))
    };
    // The filter is a critically damped one of second order with the natural frequency w, so the
    // rate is 2/w late. w is 2 pi f / 2.48 (`HandleConfigUpdate` in the vendor's
    // `fw/motor_position.h`).
    let ratio = if firmware >= BANDWIDTH_SINCE { 2.48 } else { 1.0 };
    let torque = lag("servo.pid_dq_hz".to_owned(), 1.0 / TAU)?;
    let rate = lag(format!("motor_position.sources.{source}.pll_filter_hz"), 2.0 * ratio / TAU)?;
    Ok(Filtering { torque, rate })
}

fn model(number: i32) -> String {
    // The upper byte of the model number is the family.
    let name = ["r4", "n1", "c1", "x1"].get(usize::try_from(number >> 8).unwrap_or(usize::MAX));
    format!("moteus {} (model {number:#06x})", name.unwrap_or(&"of another family"))
}

fn mend(port: &str, id: u8, must: &Must, said: &str) -> Remedy {
    let Must { name, value, why, .. } = must;
    Remedy {
        what: format!("{name} is {said}, must be {value}: {why}"),
        command: format!(
            "printf 'conf set {name} {value}\\nconf write\\n' > set.cfg; python3 -m moteus.moteus_tool --fdcanusb '{port}' -t {id} --write-config set.cfg"
        ),
    }
}

/// Compares the servos that answered, `found`, with the ids in the rig file, `ids`. Returns an
/// error text if a servo is missing, is not in the rig file, or has the id of another servo.
/// Returns `None` if all ids match.
fn crowd(found: &[Found], ids: &[u8]) -> Option<String> {
    let listed = |ids: &[u8]| ids.iter().map(u8::to_string).collect::<Vec<_>>().join(", ");
    let there: Vec<u8> = found.iter().map(|it| it.id).collect();
    if let Some(pair) = there.windows(2).find(|pair| pair[0] == pair[1]) {
        return Some(format!(
            "two servos have the id {}: disconnect one and give the other a new one (conf set id.id N, conf write)",
            pair[0]
        ));
    }
    let missing: Vec<u8> = ids.iter().copied().filter(|id| !there.contains(id)).collect();
    if !missing.is_empty() {
        return Some(format!(
            "no answer from id {}; there are {}: check power and wiring, or `controller` in the rig file",
            listed(&missing),
            listed(&there)
        ));
    }
    let others: Vec<u8> = there.iter().copied().filter(|id| !ids.contains(id)).collect();
    (!others.is_empty()).then(|| {
        format!(
            "servos of id {} are on the line and not in the rig file, which has {}: disconnect them, or name them",
            listed(&others),
            listed(ids)
        )
    })
}

/// Checks that the answer of servo `id` repeats the watchdog time of a command bit for bit, because
/// the driver stores the number of the command in this time. Also records the time at which the
/// servo got power. `at` is the joint's index on the bus.
fn echoes(talk: &mut Talk<'_>, id: u8, at: usize) -> Result<(), MeetError> {
    let watchdog = codec::stamp(20, 0xabc);
    let mut frame = codec::frame_to(id, true);
    // This frame sets no mode, so the watchdog time has no effect on the servo.
    codec::write_watchdog(&mut frame, watchdog);
    codec::state_query(Turn::Uptime).serialize(&mut frame);
    let state = talk.state(id, &frame)?;
    if state.watchdog.map(f32::to_bits) != Some(watchdog.to_bits()) {
        let reason = format!(
            "moteus of id {id}: register 0x027 does not read back what was written to it: the age of a reading would not be known; \
             update its firmware"
        );
        return Err(MeetError::Setting { port: talk.expected().port().to_owned(), reason });
    }
    talk.note_power(at, state.uptime_ms.unwrap_or_default());
    Ok(())
}
