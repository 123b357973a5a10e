//! One function for each op. Each waits for the answer, except for the streams.

#![allow(rustdoc::broken_intra_doc_links, reason = "annotations for cbindgen look like links")]

use std::ffi::{CString, c_char};

use hbot_api::{Align, Client, ClientError, Encoding, Mode, Op, ReferenceCommand, Request, TorqueCommand};
use serde_json::Value;

use crate::boundary::{Out, input, text};
use crate::client::{HbotClient, Inner, with};
use crate::state::{HbotMode, HbotState};
use crate::status::{Failure, HbotStatus};

/// Takes the lease, which is the right to command. With `steal` also if another client has it;
/// otherwise the status is then HBOT_STATUS_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_acquire(client: *mut HbotClient, steal: bool) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { with(client, |inner| done(inner.client.acquire(steal))) }
}

/// Gives the lease back, and ends the stream.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_release(client: *mut HbotClient) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { with(client, |inner| done(inner.client.release())) }
}

/// Subscribes to one state every `every` ticks, 1 to 1000000. This replaces an earlier
/// subscription.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_subscribe(client: *mut HbotClient, every: u64) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { with(client, |inner| done(inner.client.subscribe(every))) }
}

/// Ends the subscription.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_unsubscribe(client: *mut HbotClient) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { with(client, |inner| done(inner.client.unsubscribe())) }
}

/// Begins to render the scene; the torque rises within 0.5 s. `mode` can be NULL; it receives the
/// mode from the next tick on.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_enable(client: *mut HbotClient, mode: *mut HbotMode) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { change(client, mode, Client::enable) }
}

/// Ends rendering; the torque falls within 50 ms. Needs no lease. `mode` as for hbot_enable().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_disable(client: *mut HbotClient, mode: *mut HbotMode) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { change(client, mode, Client::disable) }
}

/// Leaves a fault or an emergency stop after its cause is gone. `mode` as for hbot_enable().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_reset(client: *mut HbotClient, mode: *mut HbotMode) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { change(client, mode, Client::reset) }
}

/// Emergency stop: zero torque in the next tick. Needs no lease. `mode` as for hbot_enable().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_estop(client: *mut HbotClient, mode: *mut HbotMode) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { change(client, mode, Client::estop) }
}

/// Calls a method of the client that changes the mode.
///
/// # Safety
/// The contract of the crate holds for both pointers.
unsafe fn change(
    client: *mut HbotClient,
    mode: *mut HbotMode,
    act: fn(&mut Client) -> Result<Mode, ClientError>,
) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let changed = act(&mut inner.client)?;
            if let Ok(out) = Out::new(mode, "mode") {
                out.write(changed.into());
            }
            Ok(HbotStatus::Ok)
        })
    }
}

/// Makes a simulated rig in virtual time run `ticks` ticks and then wait. `*state` receives the
/// state of the last of them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_advance(
    client: *mut HbotClient,
    ticks: u64,
    state: *mut HbotState,
) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let out = Out::new(state, "state")?;
            out.write(HbotState::of(&inner.client.advance(ticks)?)?);
            Ok(HbotStatus::Ok)
        })
    }
}

/// Asks whether the server answers. `tick` and `t` receive the number and the time, s, of its last
/// tick; both can be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_ping(client: *mut HbotClient, tick: *mut u64, t: *mut f64) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let answer = inner.client.ping(Value::Null)?;
            if let Ok(out) = Out::new(tick, "tick") {
                out.write(answer.tick);
            }
            if let Ok(out) = Out::new(t, "t") {
                out.write(answer.t);
            }
            Ok(HbotStatus::Ok)
        })
    }
}

/// Writes to `*json` the server's statistics as JSON text (docs/api.md, `stats`). The text belongs
/// to the client and is valid until the next call that returns a text, or until hbot_close().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_stats_json(client: *mut HbotClient, json: *mut *const c_char) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { with(client, |inner| inner.answer_text(Op::Stats, Out::new(json, "json")?)) }
}

/// Writes to `*json` what the motor controllers report about themselves as JSON text (docs/api.md,
/// `controllers`). The text lives as that of hbot_stats_json().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_controllers_json(
    client: *mut HbotClient,
    json: *mut *const c_char,
) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { with(client, |inner| inner.answer_text(Op::Controllers, Out::new(json, "json")?)) }
}

/// Writes to `*json` the answer to `info` as JSON text (docs/api.md), with the schemas of all
/// effects and the running scene. The text lives as that of hbot_stats_json().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_info_json(client: *mut HbotClient, json: *mut *const c_char) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { with(client, |inner| inner.answer_text(Op::Info, Out::new(json, "json")?)) }
}

/// Sends a request as JSON text, such as {"op": "hand", "release": true}, for ops of docs/api.md
/// that have no function here. It waits for the answer, also of a stream, and replaces the `id`.
/// `*json` receives the body of the answer as JSON text, which lives as that of hbot_stats_json().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_request_json(
    client: *mut HbotClient,
    request: *const c_char,
    json: *mut *const c_char,
) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let request = Request::read(Encoding::Json, text(request, "request")?.as_bytes());
            let op = request.map_err(|refusal| ClientError::Server(refusal.error))?.op;
            inner.answer_text(op, Out::new(json, "json")?)
        })
    }
}

impl Inner {
    /// Sends an op and gives the body of its answer to the program as JSON text.
    fn answer_text(&mut self, op: Op, out: Out<*const c_char>) -> Result<HbotStatus, Failure> {
        let text = self.client.call(op)?.to_string();
        // JSON writes a zero byte as an escape.
        self.text =
            CString::new(text).map_err(|error| Failure::new(HbotStatus::Protocol, error.to_string()))?;
        out.write(self.text.as_ptr());
        Ok(HbotStatus::Ok)
    }
}

/// What hbot_torque(), hbot_reference() and hbot_model() send with their values. Fields that are 0
/// are left out.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct HbotStream {
    /// Time from the arrival at the server until the value expires, ms, 1 to 1000. 0: 20 ms.
    pub valid_ms: u32,
    /// Tick of the state from which the value was computed. The server refuses one that is too old.
    pub tick: u64,
    /// A number of your choice. States return the last accepted one as `client_seq`.
    pub seq: u64,
}

/// Streams a torque in frame N, N m, without waiting for an answer. `stream` can be NULL. It is
/// added to the scene's torque until it expires. If the server refuses it, an event
/// HBOT_EVENT_KIND_REFUSED comes.
/// cbindgen:ptrs-as-arrays=[[torque;3]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_torque(
    client: *mut HbotClient,
    torque: *const f64,
    stream: *const HbotStream,
) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let (torque, extras) = (*input(torque.cast(), "torque")?, extras(stream));
            done(inner.client.torque(TorqueCommand {
                torque,
                valid_ms: extras.valid_ms,
                tick: extras.tick,
                seq: extras.seq,
            }))
        })
    }
}

/// Streams a reference orientation {w, x, y, z} for an effect, without waiting for an answer.
/// `omega`, its angular velocity in frame N, rad/s, can be NULL. `stream` can be NULL; its
/// `valid_ms` is that of `omega`.
/// cbindgen:ptrs-as-arrays=[[q;4], [omega;3]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_reference(
    client: *mut HbotClient,
    effect: *const c_char,
    q: *const f64,
    omega: *const f64,
    stream: *const HbotStream,
) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let (effect, extras) = (text(effect, "effect")?.to_owned(), extras(stream));
            done(inner.client.reference(ReferenceCommand {
                effect,
                q: *input(q.cast(), "q")?,
                omega: omega.cast::<[f64; 3]>().as_ref().copied(),
                valid_ms: extras.valid_ms,
                tick: extras.tick,
                seq: extras.seq,
            }))
        })
    }
}

/// Corrects the server's orientation by one that was measured from outside, {w, x, y, z}. `weight`,
/// 0 to 1, is the part of the difference that is corrected. `angle` can be NULL; it receives the
/// difference before, rad.
/// cbindgen:ptrs-as-arrays=[[q;4]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_align(
    client: *mut HbotClient,
    q: *const f64,
    weight: f64,
    angle: *mut f64,
) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let difference =
                inner.client.align(Align { q: *input(q.cast(), "q")?, weight, sigma: None, t: None })?;
            if let Ok(out) = Out::new(angle, "angle") {
                out.write(difference);
            }
            Ok(HbotStatus::Ok)
        })
    }
}

/// The options of a stream message as messages have them.
pub(crate) struct Extras {
    pub(crate) valid_ms: u64,
    pub(crate) tick: Option<u64>,
    pub(crate) seq: Option<u64>,
}

/// # Safety
/// The contract of the crate holds for the pointer.
pub(crate) unsafe fn extras(stream: *const HbotStream) -> Extras {
    // SAFETY: the caller promises that it is null or points to a stream.
    let given = unsafe { stream.as_ref() }.copied().unwrap_or(HbotStream { valid_ms: 0, tick: 0, seq: 0 });
    let some = |number: u64| (number > 0).then_some(number);
    let valid_ms = if given.valid_ms == 0 { 20 } else { given.valid_ms.into() };
    Extras { valid_ms, tick: some(given.tick), seq: some(given.seq) }
}

/// Drops the answer to a request of which only success matters.
pub(crate) fn done<T>(result: Result<T, ClientError>) -> Result<HbotStatus, Failure> {
    result.map(|_| HbotStatus::Ok).map_err(Failure::from)
}
