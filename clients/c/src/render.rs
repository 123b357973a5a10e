//! The loop that calls the program for each state.

use std::ffi::c_void;
use std::time::Duration;

use hbot_api::{LatePolicy, Mode, RenderEnd, RenderOptions};

use crate::boundary::{Out, input};
use crate::client::{HbotClient, with};
use crate::state::HbotState;
use crate::status::{Failure, HbotStatus};

/// What hbot_render() does if several states have arrived, because the program was late.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub enum HbotLate {
    /// Only the newest state is rendered; the others are counted as missed.
    Newest = 0,
    /// Every state is rendered, in order. The server refuses torques that are too old.
    Each = 1,
}

/// Why hbot_render() ended without an error.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HbotRenderEnd {
    /// The callback returned false.
    Asked = 0,
    /// The duration is over.
    Duration = 1,
    /// The rig is in a fault.
    Fault = 2,
    /// The rig is in an emergency stop.
    Estop = 3,
    /// The rig was disabled.
    Disabled = 4,
    /// This client has lost the lease.
    LeaseLost = 5,
    /// The server is stopping.
    ServerStopping = 6,
}

/// Options of hbot_render(). A field that is 0 has its default.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct HbotRenderOptions {
    /// Number of ticks from one state to the next. Default: 1.
    pub every: u64,
    /// Time until a torque expires, ms, 1 to 1000. Default: 20.
    pub valid_ms: u32,
    /// One of hbot_late. Default: newest.
    pub late: u32,
    /// Time after which the loop ends, s. Default (0): it does not end by itself.
    pub duration: f64,
}

/// What hbot_render() has done.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct HbotRenderReport {
    /// Why the loop ended.
    pub end: HbotRenderEnd,
    /// Number of states from which a torque was computed and sent.
    pub rendered: u64,
    /// Number of states that were passed over because a newer one had arrived.
    pub missed: u64,
    /// Number of torques that the server refused, as far as it has reported them.
    pub refused: u64,
}

/// Computes a torque in frame N, N m, from a state. `torque` has three elements, which are zero
/// before the call. `user` is the
/// pointer that was given to hbot_render(). Returns false to end the loop; its torque is then not
/// sent. It must not throw, and must not use the client that calls it.
pub type HbotRenderCallback =
    Option<unsafe extern "C" fn(state: *const HbotState, torque: *mut f64, user: *mut c_void) -> bool>;

/// Subscribes to states, calls `callback` for each, and streams the torque that it computes, until
/// something ends the loop. Needs the lease, and a rig that is enabled. `options` and `report` can
/// be NULL. At the end the torque goes to zero and the subscription ends.
/// Each torque carries the tick of its state. If yours comes from an older state, send it with
/// hbot_torque() and that state's tick instead, or the age in states is too low.
///
/// A callback that takes longer than `valid_ms` loses its torque until it returns. If no state
/// comes within the client's timeout, the status is HBOT_STATUS_TIMEOUT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_render(
    client: *mut HbotClient,
    options: *const HbotRenderOptions,
    callback: HbotRenderCallback,
    user: *mut c_void,
    report: *mut HbotRenderReport,
) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let options =
                if options.is_null() { RenderOptions::default() } else { legal(input(options, "options")?)? };
            let Some(callback) = callback else {
                return Err(Failure::new(HbotStatus::NullPointer, "callback is NULL"));
            };
            let mut wrong = None;
            let result = inner.client.render(&options, |state| {
                let state = HbotState::of(state).map_err(|failure| wrong = Some(failure)).ok()?;
                let mut torque = [0.0; 3];
                callback(&raw const state, torque.as_mut_ptr(), user).then_some(torque)
            });
            if let Some(failure) = wrong {
                return Err(failure);
            }
            let done = result?;
            if let Ok(out) = Out::new(report, "report") {
                out.write(HbotRenderReport {
                    end: end(done.end),
                    rendered: done.rendered,
                    missed: done.missed,
                    refused: done.refused,
                });
            }
            Ok(HbotStatus::Ok)
        })
    }
}

fn legal(given: &HbotRenderOptions) -> Result<RenderOptions, Failure> {
    let default = RenderOptions::default();
    if !(0.0..=1e9).contains(&given.duration) {
        return Err(Failure::argument(format!("duration is {} s; legal: 0 to 1e9 s", given.duration)));
    }
    Ok(RenderOptions {
        every: if given.every == 0 { default.every } else { given.every },
        valid_ms: if given.valid_ms == 0 { default.valid_ms } else { given.valid_ms.into() },
        late: match given.late {
            0 => LatePolicy::Newest,
            1 => LatePolicy::Each,
            other => return Err(Failure::argument(format!("late is {other}; legal: 0 and 1"))),
        },
        duration: (given.duration > 0.0).then(|| Duration::from_secs_f64(given.duration)),
    })
}

const fn end(end: RenderEnd) -> HbotRenderEnd {
    match end {
        RenderEnd::Asked => HbotRenderEnd::Asked,
        RenderEnd::Duration => HbotRenderEnd::Duration,
        RenderEnd::Stopped(Mode::Fault) => HbotRenderEnd::Fault,
        RenderEnd::Stopped(Mode::Estop) => HbotRenderEnd::Estop,
        RenderEnd::Stopped(_) => HbotRenderEnd::Disabled,
        RenderEnd::LeaseLost => HbotRenderEnd::LeaseLost,
        RenderEnd::ServerStopping => HbotRenderEnd::ServerStopping,
    }
}
