//! The tables of a rig file that say how the device is run: loop, link, limits and service.

use std::net::{Ipv4Addr, SocketAddr};
use std::ops::RangeInclusive;
use std::path::PathBuf;

use hbot_core::inputs::OnClientLost;
use hbot_core::rig::{self as core, legal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::methods::{Accuracy, Passivity, Preset, RateEstimate, RateMethod};

/// The `wake_us` that is no limit.
pub(crate) const ANY_WAKE_US: u32 = 1_000_000;

/// The control loop.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Loop {
    /// Ticks a second.
    #[schemars(range(min = 50, max = 20_000), extend("unit" = "Hz"))]
    pub(crate) rate_hz: u32,
    /// A preset of methods, or a table that names each.
    pub(crate) accuracy: Accuracy,
    /// Where joint rates come from: a method, or a table that names it with its parameters.
    pub(crate) rate_estimate: RateEstimate,
    /// Whether energy given out is held within what came in: true, false, or a table that says how.
    pub(crate) passivity: Passivity,
    /// How long before a tick's deadline the loop wakes at most, and at most a quarter of the period; it learns how early is enough on
    /// this machine, rehearses the tick and waits out the rest awake, which keeps a processor busy for that long. 0: it sleeps
    /// until the deadline.
    #[schemars(range(max = 1000), extend("unit" = "us"))]
    pub(crate) early_us: u32,
    /// How long a processor may take to wake from its sleep while the loop runs: the system keeps all of them out of deeper ones. 0: they
    /// do not sleep at all, which takes power; from 20 on most still sleep lightly; 1000000: as the system likes.
    #[schemars(range(max = ANY_WAKE_US), extend("unit" = "us"))]
    pub(crate) wake_us: u32,
    /// The processor that the loop's thread stays on, from 0; best one that nothing else uses. Absent: the system chooses.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "u32", range(max = 1023))]
    pub(crate) cpu: Option<u32>,
}

impl Default for Loop {
    fn default() -> Self {
        Self {
            rate_hz: 1000,
            accuracy: Accuracy::Preset(Preset::Balanced),
            rate_estimate: RateEstimate::Method(RateMethod::Controller),
            passivity: Passivity::Switch(false),
            early_us: 200,
            wake_us: 0,
            cpu: None,
        }
    }
}

/// The serial line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Link {
    /// `sim` for the simulated rig, the path of a serial device, or a list of such paths where controllers share the rig.
    #[schemars(extend("legal" = "`\"sim\"`, a path, or a list of 1 to 8 paths"))]
    pub(crate) port: Ports,
    /// The protocol that the controllers speak.
    pub(crate) protocol: Protocol,
    /// Line rate. A USB device of its own (CDC) does not heed it.
    #[schemars(range(min = 9600, max = 20_000_000), extend("unit" = "baud"))]
    pub(crate) baud: u32,
    /// How long a controller holds a command that no other follows, at least two loop periods; 20, and 50 where the port is
    /// `sim`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "u16", range(min = 1, max = 1000), extend("unit" = "ms"))]
    pub(crate) watchdog_ms: Option<u16>,
    /// Age of the newest reading, ticks, above which it is the fault link_lost.
    #[schemars(range(min = legal::TIMEOUT_TICKS.least as u32, max = legal::TIMEOUT_TICKS.most as u32))]
    pub(crate) timeout_ticks: u32,
}

impl Default for Link {
    fn default() -> Self {
        Self {
            port: Ports::One("sim".to_owned()),
            protocol: Protocol::Hbot,
            baud: 3_000_000,
            watchdog_ms: None,
            timeout_ticks: core::Timing::default().timeout_ticks,
        }
    }
}

/// One serial port, or several.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum Ports {
    One(#[schemars(length(min = 1))] String),
    Several(#[schemars(length(min = 1, max = 8), inner(length(min = 1)))] Vec<String>),
}

/// What the controllers speak.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Protocol {
    /// The frames of docs/link.md.
    Hbot,
    /// moteus controllers, on an fdcanusb adapter or a UART.
    Moteus,
    /// ODrive controllers that speak CANSimple, on an adapter that speaks slcan.
    Odrive,
}

impl Protocol {
    /// Its name in a rig file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hbot => "hbot",
            Self::Moteus => "moteus",
            Self::Odrive => "odrive",
        }
    }

    /// The ids that its controllers may have on their bus. `None` where they have none: the joints of
    /// a line are then numbered from 0 in the order of the frames.
    #[must_use]
    pub const fn ids(self) -> Option<RangeInclusive<u32>> {
        match self {
            Self::Hbot => None,
            Self::Moteus => Some(1..=127),
            Self::Odrive => Some(0..=63),
        }
    }

    /// The counts of a turn of the encoder where the protocol speaks of turns: the driver makes counts
    /// of them. A power of two, no coarser than the protocol: moteus sends steps of 1e-5 turns, and
    /// ODrive an `f32`, which below 8 turns has steps of at most 2^-21 turns. `None` where the
    /// controllers count themselves.
    #[must_use]
    pub const fn counts_per_turn(self) -> Option<u32> {
        match self {
            Self::Hbot => None,
            Self::Moteus => Some(1 << 17),
            Self::Odrive => Some(1 << 21),
        }
    }
}

/// What must not be exceeded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Limits {
    /// Largest torque on the sphere (its norm).
    #[schemars(range(max = legal::TORQUE.most), extend("exclusiveMinimum" = legal::TORQUE.least, "unit" = legal::TORQUE.unit))]
    pub(crate) torque: f64,
    /// Largest change of that torque.
    #[schemars(range(max = legal::TORQUE_RATE.most), extend("exclusiveMinimum" = legal::TORQUE_RATE.least, "unit" = legal::TORQUE_RATE.unit))]
    pub(crate) torque_rate: f64,
    /// Largest angular speed of the powered sphere; above it the fault overspeed.
    #[schemars(range(max = legal::SPEED.most), extend("exclusiveMinimum" = legal::SPEED.least, "unit" = legal::SPEED.unit))]
    pub(crate) speed: f64,
    /// Largest slip of the powered sphere against its wheels; above it the fault slip.
    #[schemars(range(max = legal::SLIP.most), extend("exclusiveMinimum" = legal::SLIP.least, "unit" = legal::SLIP.unit))]
    pub(crate) slip: f64,
    /// Thermal time of the motors: where the mean square of a joint's torque over it is above that of its `continuous` torque,
    /// the fault thermal. Absent: heat is left to the controllers.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(max = legal::THERMAL_TIME.most), extend("exclusiveMinimum" = legal::THERMAL_TIME.least, "unit" = legal::THERMAL_TIME.unit))]
    pub(crate) thermal_time: Option<f64>,
    /// How much energy may go into the hand; more is the fault overtorque. Absent: as much as torque and speed allow.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Energy")]
    pub(crate) energy: Option<Energy>,
    /// What the contacts hold. Absent where nobody knows: joint torques are then not limited by it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Traction")]
    pub(crate) traction: Option<Traction>,
    /// How far a spring's reference may be from the orientation at enable.
    #[schemars(range(max = legal::ENABLE_MAX_ANGLE.most), extend("exclusiveMinimum" = legal::ENABLE_MAX_ANGLE.least, "unit" = legal::ENABLE_MAX_ANGLE.unit))]
    pub(crate) enable_max_angle: f64,
    /// How fast an orientation seen from outside corrects the odometry.
    #[schemars(range(max = legal::ALIGN_RATE.most), extend("exclusiveMinimum" = legal::ALIGN_RATE.least, "unit" = legal::ALIGN_RATE.unit))]
    pub(crate) align_rate: f64,
    /// How fast a reference moves towards where it is sent.
    #[schemars(range(max = legal::REFERENCE_RATE.most), extend("exclusiveMinimum" = legal::REFERENCE_RATE.least, "unit" = legal::REFERENCE_RATE.unit))]
    pub(crate) reference_rate: f64,
    /// A stream message that names a tick older than this is refused.
    #[schemars(range(min = legal::MAX_AGE_TICKS.least as u32, max = legal::MAX_AGE_TICKS.most as u32))]
    pub(crate) max_age_ticks: u32,
}

impl Default for Limits {
    fn default() -> Self {
        let core::Limits {
            torque,
            torque_rate,
            speed,
            slip,
            enable_max_angle,
            align_rate,
            reference_rate,
            max_age_ticks,
            ..
        } = core::Limits::default();
        Self {
            torque,
            torque_rate,
            speed,
            slip,
            thermal_time: None,
            energy: None,
            traction: None,
            enable_max_angle,
            align_rate,
            reference_rate,
            max_age_ticks,
        }
    }
}

/// Energy given out to the hand, as the passivity observer sees it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Energy {
    /// What may be given out beyond `power`, as in one push.
    #[schemars(range(max = legal::BURST.most), extend("exclusiveMinimum" = legal::BURST.least, "unit" = legal::BURST.unit))]
    pub(crate) burst: f64,
    /// What may be given out for ever.
    #[schemars(range(max = legal::POWER.most), extend("exclusiveMinimum" = legal::POWER.least, "unit" = legal::POWER.unit))]
    pub(crate) power: f64,
}

/// What the contacts hold: mu N.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Traction {
    /// Friction coefficient mu.
    #[schemars(range(max = legal::FRICTION.most), extend("exclusiveMinimum" = legal::FRICTION.least))]
    pub(crate) mu: f64,
    /// Normal force N of each wheel.
    #[schemars(range(max = legal::NORMAL_FORCE.most), extend("exclusiveMinimum" = legal::NORMAL_FORCE.least, "unit" = legal::NORMAL_FORCE.unit))]
    pub(crate) normal_force: f64,
}

/// The TCP service.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Api {
    /// Where to listen. Any address but loopback needs a token.
    pub(crate) listen: String,
    /// A file that holds the token that clients must show; relative to the rig file. Absent: no token.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "String", length(min = 1))]
    pub(crate) token_file: Option<PathBuf>,
    /// Encrypts the service; nothing else is then spoken on its port. Absent: plain TCP.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Tls")]
    pub(crate) tls: Option<Tls>,
    /// What happens to the holder's commands when its connection ends without a release.
    pub(crate) on_client_lost: OnClientLost,
}

impl Default for Api {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from((Ipv4Addr::LOCALHOST, DEFAULT_PORT)).to_string(),
            token_file: None,
            tls: None,
            on_client_lost: OnClientLost::Ramp,
        }
    }
}

/// What the service shows of itself where it is encrypted (TLS 1.3).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Tls {
    /// The server's certificate and those between it and an authority, if there are any (PEM); relative to the rig file.
    #[schemars(with = "String", length(min = 1))]
    pub(crate) certificate: PathBuf,
    /// The private key of that certificate (PEM); relative to the rig file.
    #[schemars(with = "String", length(min = 1))]
    pub(crate) key: PathBuf,
}

/// HBOT on a phone's keys.
const DEFAULT_PORT: u16 = 4268;
