//! The description of the rig as a plain struct.

use std::ffi::c_char;

use hbot_api::InfoOk;

use crate::boundary::{Out, copied};
use crate::client::{HbotClient, with};
use crate::status::HbotStatus;

/// The rig and its server. hbot_info_json() has the rest.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct HbotInfo {
    /// Name and version of the server program. A longer text is cut.
    pub server: [c_char; 64],
    /// Name of the rig. A longer text is cut.
    pub rig: [c_char; 128],
    /// Number of this connection.
    pub session: u64,
    /// Whether the rig is simulated.
    pub simulated: bool,
    /// Ticks a second.
    pub rate_hz: u32,
    /// Whether the server has told its clock, `clock_monotonic_ns` and `clock_unix_ns`.
    pub has_clock: bool,
    /// Time of tick 0 on CLOCK_MONOTONIC of the server's machine, ns.
    pub clock_monotonic_ns: u64,
    /// The same moment on CLOCK_REALTIME, ns since 1970. A state with time `t` belongs to the
    /// moment `clock_unix_ns + 1e9 t`.
    pub clock_unix_ns: u64,
    /// Number of wheels. A state has two joints for each.
    pub wheels: u32,
    /// Radius of the sphere, m.
    pub sphere_radius: f64,
    /// Mass of the sphere, kg.
    pub sphere_mass: f64,
    /// Largest torque on the sphere, N m.
    pub max_torque: f64,
    /// Largest change of the torque, N m/s.
    pub max_torque_rate: f64,
    /// Largest angular speed of the sphere with motors on, rad/s.
    pub max_speed: f64,
    /// Largest age of a stream message, ticks.
    pub max_age_ticks: u32,
    /// Stiffest spring that is stable with the damping `stable_damping`, N m/rad; 0 if unknown.
    pub stable_stiffness: f64,
    /// Damping that belongs to `stable_stiffness`, N m s/rad.
    pub stable_damping: f64,
    /// Whether the loop has told its largest torque in this posture, `capability`.
    pub has_capability: bool,
    /// Largest torque about n1, n2, n3 in this posture, N m.
    pub capability: [f64; 3],
}

/// Asks for the description of the rig.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_info_get(client: *mut HbotClient, info: *mut HbotInfo) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let out = Out::new(info, "info")?;
            let answer = inner.client.info()?;
            let hello = inner.client.hello();
            out.write(HbotInfo::of(&answer, &hello.server, hello.session));
            Ok(HbotStatus::Ok)
        })
    }
}

impl HbotInfo {
    fn of(info: &InfoOk, server: &str, session: u64) -> Self {
        let render = info.render.clone().unwrap_or_default();
        let clock = info.clock.unwrap_or_default();
        Self {
            server: copied(server),
            rig: copied(&info.rig.name),
            session,
            simulated: info.rig.simulated,
            rate_hz: info.rig.rate_hz,
            has_clock: info.clock.is_some(),
            clock_monotonic_ns: clock.monotonic_ns,
            clock_unix_ns: clock.unix_ns,
            wheels: info.rig.wheels.len() as u32,
            sphere_radius: info.rig.sphere.radius,
            sphere_mass: info.rig.sphere.mass,
            max_torque: info.limits.torque,
            max_torque_rate: info.limits.torque_rate,
            max_speed: info.limits.speed,
            max_age_ticks: info.limits.max_age_ticks,
            stable_stiffness: render.stiffness_stable,
            stable_damping: render.damping,
            has_capability: info.capability.is_some(),
            capability: info.capability.unwrap_or_default(),
        }
    }
}
