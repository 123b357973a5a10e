//! Rows that differ for the motor controllers of other vendors.

use std::time::Duration;

use hbot_api::{Fault, Mode};
use hbot_config::rig::Protocol;
use rustix::process::Signal;
use serde_json::Value;

use crate::bench::still;
use crate::losses::{cause, pushed_rig};
use crate::{Outcome, Row, rigs};

/// Number of stop commands that each servo must receive at the end.
const STOPS: u64 = 3;
/// Share of the largest torque by which a torque may exceed its value before the noise. The torque
/// of the client is constant and a hand holds the sphere, so the joint torques hardly change.
const ALIKE: f64 = 0.1;

/// Damages the share `share` of the lines of text on the line to motor controllers of `protocol`,
/// for at most `ticks` ticks. No motor may give a torque that was not commanded. If `rides` is
/// true, the rig may stay in the mode `active`. Otherwise it must go to a fault.
pub(crate) fn noise(protocol: Protocol, share: f64, ticks: u64, rides: bool) -> Outcome<Row> {
    let (mut peer, mut bench, _client) = pushed_rig(protocol)?;
    // The sphere comes to rest against the hand.
    let tick = bench.until(|_| true)?.tick;
    bench.until(|state| state.tick > tick + 500)?;
    peer.say(&format!("noise {share}"))?;
    let from = bench.until(|_| true)?.tick;
    let state = bench.until(|state| state.mode == Mode::Fault || state.tick > from + ticks)?;
    let fault = state.mode == Mode::Fault;
    // Commands of the fault can be damaged too.
    bench.until(|later| later.tick > state.tick + 50)?;
    peer.say("report")?;
    let record: Value = serde_json::from_str(&peer.line()?)?;
    let number = |key: &str| record[key].as_f64().unwrap_or(f64::INFINITY);
    let (before, beyond, after_ms) = (number("before"), number("beyond"), number("zero_after_ms"));
    let of_line = matches!(state.fault, Some(Fault::LinkCorrupt | Fault::LinkLost));
    let stopped = fault && of_line && still(&state) && after_ms.is_finite();
    Ok(Row::new(
        &format!("{} % of lines of text damaged each way while a client commands 0.3 N m", 100.0 * share),
        format!(
            "{}link_corrupt or link_lost and all motors off; never a joint torque more than {} % beyond that before the damage",
            if rides { "no fault, or " } else { "" },
            100.0 * ALIKE
        ),
        format!(
            "mode {:?}, {} after {} ticks, {} damaged lines counted; largest joint torque {before:.3} N m before, and {beyond:.4} N m beyond it",
            state.mode,
            cause(state.fault),
            state.tick - from,
            bench.stats()?.corrupt_frames
        ),
        (stopped || rides && !fault) && before > 0.0 && beyond <= ALIKE * before,
    ))
}

/// Sends a signal that ends a program to the server while a client commands a torque. The motors
/// must be off so early that their watchdog cannot have switched them off.
pub(crate) fn signalled(protocol: Protocol, name: &str, signal: Signal) -> Outcome<Row> {
    let (mut peer, mut bench, _client) = pushed_rig(protocol)?;
    peer.say("mark")?;
    bench.server.signal(signal)?;
    let status = bench.server.0.wait()?;
    // Bytes on the line still arrive.
    std::thread::sleep(Duration::from_millis(100));
    peer.say("report")?;
    let record: Value = serde_json::from_str(&peer.line()?)?;
    let after_ms = record["zero_after_ms"].as_f64().unwrap_or(f64::INFINITY);
    // The last command of torque can have come a tick before the signal.
    let bound = rigs::on_device(protocol)?.link.watchdog_ms - 1;
    // An ODrive that is off gets no further stop commands, so these are not counted.
    let counted = protocol == Protocol::Moteus;
    let stops = record["last_stops"].as_u64().unwrap_or(0);
    let (of_stops, found_stops) = if counted {
        (
            format!(", at least {STOPS} stop commands to each servo at the end"),
            format!("; {stops} stop commands"),
        )
    } else {
        Default::default()
    };
    Ok(Row::new(
        &format!("{name} while a client commands torque"),
        format!("all motors off within {bound} ms, before their watchdog{of_stops}; exit 0"),
        format!("{status}; all motors off {after_ms:.1} ms after the signal{found_stops}"),
        status.success() && after_ms <= f64::from(bound) && (!counted || stops >= STOPS),
    ))
}
