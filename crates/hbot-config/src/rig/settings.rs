//! The tables of a rig file that say how the machine is run: loop, link, limits and service.

use std::net::{Ipv4Addr, SocketAddr};
use std::ops::RangeInclusive;
use std::path::PathBuf;

use hbot_core::design::rig::{self as core, legal};
use hbot_core::inputs::OnClientLost;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::USUAL_LAG_S;
use super::compensation::Compensation;
use super::methods::{Accuracy, Lead, Passivity, Preset, RateEstimate, RateMethod};

/// The value of `wake_us` that sets no limit on the wake-up time of processors.
pub(crate) const ANY_WAKE_US: u32 = 1_000_000;

/// Settings of the control loop.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Loop {
    /// Rate of the control loop, in ticks per second.
    #[schemars(range(min = 50, max = 20_000), extend("unit" = "Hz"))]
    pub(crate) rate_hz: u32,
    /// Numerical methods: the name of a preset, or a table with one key for each method.
    pub(crate) accuracy: Accuracy,
    /// How the joint rates are estimated: the name of a method, or a table with the method and its
    /// parameters.
    pub(crate) rate_estimate: RateEstimate,
    /// Whether the energy that delay and sampling create is taken out by damping: true, false, or a
    /// table of parameters.
    pub(crate) passivity: Passivity,
    /// Whether the torque is lowered if the sphere shakes by itself.
    pub(crate) shaking_guard: bool,
    /// Whether a scene is rendered at the pose that the sphere will have when the torque acts:
    /// true, false, or a table of parameters. A lead takes the age of the reading, half a period
    /// and `torque_lag` out of the loop, so that it is stable with stiffer scenes.
    pub(crate) lead: Lead,
    /// Whether the imperfections that this file says (`friction`, `cogging`, `torque_scale`,
    /// `gear_loss`, `imbalance`) are fed forward: true, false, or a table of parameters. What the
    /// file does not say is not fed forward.
    pub(crate) compensation: Compensation,
    /// Largest lead, which is the time from the loop's wake-up to the deadline of a tick. Never
    /// more than a quarter of the period. The loop measures which lead this machine needs. Between
    /// wake-up and deadline it rehearses the tick, which keeps a processor busy. 0: the loop sleeps
    /// until the deadline.
    #[schemars(range(max = 1000), extend("unit" = "us"))]
    pub(crate) early_us: u32,
    /// Longest time that a processor can take to wake from sleep while the loop runs. The operating
    /// system keeps all processors out of deeper sleep. 0: they do not sleep at all, which uses
    /// power. 20 or more: most still sleep lightly. 1000000: no limit.
    #[schemars(range(max = ANY_WAKE_US), extend("unit" = "us"))]
    pub(crate) wake_us: u32,
    /// Index of the processor on which the loop's thread runs, counted from 0. Choose one that
    /// nothing else uses. Absent: the operating system chooses.
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
            passivity: Passivity::Switch(true),
            shaking_guard: true,
            lead: Lead::Switch(true),
            compensation: Compensation::Switch(true),
            early_us: 200,
            wake_us: 0,
            cpu: None,
        }
    }
}

/// Settings of the serial line to the motor controllers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Link {
    /// `sim` for the simulated rig, `sim:pty` for the simulated rig behind a pseudo-terminal, the
    /// path of a serial device, or a list of such paths if the motor controllers are on several
    /// serial lines.
    #[schemars(extend("legal" = "`\"sim\"`, `\"sim:pty\"`, a path, or a list of 1 to 8 paths"))]
    pub(crate) port: Ports,
    /// The protocol that the motor controllers use.
    pub(crate) protocol: Protocol,
    /// Bits per second on the line. It has no effect on a motor controller that is itself a USB
    /// device (CDC).
    #[schemars(range(min = 9600, max = 20_000_000), extend("unit" = "baud"))]
    pub(crate) baud: u32,
    /// Watchdog time: a motor controller switches its motors off if no command arrives for this
    /// time. No effect with `odrive`. At least two loop periods. If absent: 20, or 50 if the rig is
    /// simulated.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "u16", range(min = 1, max = 1000), extend("unit" = "ms"))]
    pub(crate) watchdog_ms: Option<u16>,
    /// Largest legal age of the newest reading from the motor controllers, in ticks. An older one
    /// causes the fault link_lost.
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

/// The value of the key `port`: one serial port, or a list of them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum Ports {
    One(#[schemars(length(min = 1))] String),
    Several(#[schemars(length(min = 1, max = 8), inner(length(min = 1)))] Vec<String>),
}

/// A protocol that motor controllers can use on the serial line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Protocol {
    /// hbot's own serial protocol, described in docs/link.md.
    Hbot,
    /// moteus controllers, on an fdcanusb adapter or a UART.
    Moteus,
    /// ODrive controllers that speak CANSimple, on an adapter that speaks slcan.
    Odrive,
}

impl Protocol {
    /// Returns the name of the protocol in a rig file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hbot => "hbot",
            Self::Moteus => "moteus",
            Self::Odrive => "odrive",
        }
    }

    /// Returns the ids that controllers with this protocol can have on their bus. Returns `None` if
    /// they have no ids. The joints of a line then have positions: 0 is the first joint in a frame.
    #[must_use]
    pub const fn ids(self) -> Option<RangeInclusive<u32>> {
        match self {
            Self::Hbot => None,
            Self::Moteus => Some(1..=127),
            Self::Odrive => Some(0..=63),
        }
    }

    /// Returns the id to which all controllers of a bus listen. Only a controller that is alone on
    /// its line can have it.
    #[must_use]
    pub const fn broadcast_id(self) -> Option<u32> {
        match self {
            Self::Moteus => Some(127),
            Self::Hbot | Self::Odrive => None,
        }
    }

    /// Returns how many counts the driver makes of one turn, if the protocol reports turns. Returns
    /// `None` if the controllers report counts.
    ///
    /// The number is a power of two and at least as fine as the protocol. moteus reports steps of
    /// 1e-5 turns. ODrive reports an `f32`, whose steps are at most 2^-21 turns below 8 turns.
    #[must_use]
    pub const fn counts_per_turn(self) -> Option<u32> {
        match self {
            Self::Hbot => None,
            Self::Moteus => Some(1 << 17),
            Self::Odrive => Some(1 << 21),
        }
    }

    /// Returns whether a reading names the command that it answers. ODrive sends positions by its
    /// own clock, and they are dated by their arrival.
    #[must_use]
    pub const fn names_commands(self) -> bool {
        !matches!(self, Self::Odrive)
    }

    /// Returns the time constant with which a motor's torque follows a command with the settings
    /// that the vendor of the controller chooses, s: 1 / (2 pi f), with the f = 200 Hz of
    /// `moteus_tool --calibrate`, or 1/w with the `current_control_bandwidth` of w = 1000 rad/s of
    /// an ODrive. Controllers with hbot's own protocol are taken to have a loop of about 300 Hz.
    #[must_use]
    pub const fn torque_lag(self) -> f64 {
        match self {
            Self::Hbot => USUAL_LAG_S,
            Self::Moteus => 1.0 / (std::f64::consts::TAU * 200.0),
            Self::Odrive => 1.0 / 1000.0,
        }
    }

    /// Returns the delay of the joint rates that the controllers report with the settings that
    /// their vendor chooses, s. The rate comes from a filter of second order, critically damped,
    /// with the natural frequency w, so it is 2/w late.
    ///
    /// moteus: w = 2 pi f / 2.48 with f = 200 Hz, the default of `moteus_tool --calibrate`
    /// (vendor's `fw/motor_position.h`). ODrive: w = 1000 rad/s, the default of the encoder's
    /// `bandwidth` (`Encoder::update_pll_gains` of firmware 0.5.6). Controllers with hbot's own
    /// protocol are taken to report rates without delay.
    #[must_use]
    pub const fn rate_lag(self) -> f64 {
        match self {
            Self::Hbot => 0.0,
            Self::Moteus => 2.0 * 2.48 / (std::f64::consts::TAU * 200.0),
            Self::Odrive => 2.0 / 1000.0,
        }
    }
}

/// Largest torque, speed, slip, energy and rates that are allowed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Limits {
    /// Largest torque on the sphere (the norm of the vector).
    #[schemars(range(max = legal::TORQUE.most), extend("exclusiveMinimum" = legal::TORQUE.least, "unit" = legal::TORQUE.unit))]
    pub(crate) torque: f64,
    /// Largest rate of change of the torque on the sphere.
    #[schemars(range(max = legal::TORQUE_RATE.most), extend("exclusiveMinimum" = legal::TORQUE_RATE.least, "unit" = legal::TORQUE_RATE.unit))]
    pub(crate) torque_rate: f64,
    /// Largest angular speed of the sphere while the motors are on. A higher speed causes the fault
    /// overspeed.
    #[schemars(range(max = legal::SPEED.most), extend("exclusiveMinimum" = legal::SPEED.least, "unit" = legal::SPEED.unit))]
    pub(crate) speed: f64,
    /// Largest slip between a wheel and the sphere while the motors are on. A higher slip causes
    /// the fault slip.
    #[schemars(range(max = legal::SLIP.most), extend("exclusiveMinimum" = legal::SLIP.least, "unit" = legal::SLIP.unit))]
    pub(crate) slip: f64,
    /// Thermal time constant of the motors. The fault thermal occurs if the mean square of a joint
    /// torque over this time exceeds the square of its `continuous` torque. Absent: hbot does not
    /// check this; the controllers must.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(max = legal::THERMAL_TIME.most), extend("exclusiveMinimum" = legal::THERMAL_TIME.least, "unit" = legal::THERMAL_TIME.unit))]
    pub(crate) thermal_time: Option<f64>,
    /// Limit on the energy that goes into the hand. More energy causes the fault overtorque.
    /// Absent: only the limits on torque and speed apply.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Energy")]
    pub(crate) energy: Option<Energy>,
    /// Friction between wheels and sphere, which limits the joint torques. Absent: the friction is
    /// unknown and does not limit them.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Traction")]
    pub(crate) traction: Option<Traction>,
    /// Largest angle between the sphere's orientation and a spring's reference at which the motors
    /// can be enabled.
    #[schemars(range(max = legal::ENABLE_MAX_ANGLE.most), extend("exclusiveMinimum" = legal::ENABLE_MAX_ANGLE.least, "unit" = legal::ENABLE_MAX_ANGLE.unit))]
    pub(crate) enable_max_angle: f64,
    /// How fast the odometry is corrected towards an orientation that was measured from outside.
    #[schemars(range(max = legal::ALIGN_RATE.most), extend("exclusiveMinimum" = legal::ALIGN_RATE.least, "unit" = legal::ALIGN_RATE.unit))]
    pub(crate) align_rate: f64,
    /// How fast a reference moves to a new orientation that a client sends.
    #[schemars(range(max = legal::REFERENCE_RATE.most), extend("exclusiveMinimum" = legal::REFERENCE_RATE.least, "unit" = legal::REFERENCE_RATE.unit))]
    pub(crate) reference_rate: f64,
    /// Largest age of a client's stream message, in ticks since the tick that it names. An older
    /// message is refused.
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

/// Limit on the energy delivered to the hand, as measured by the passivity observer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Energy {
    /// Energy that can be delivered to the hand at once in excess of `power`, for example in one
    /// push.
    #[schemars(range(max = legal::BURST.most), extend("exclusiveMinimum" = legal::BURST.least, "unit" = legal::BURST.unit))]
    pub(crate) burst: f64,
    /// Power that can be delivered to the hand without time limit.
    #[schemars(range(max = legal::POWER.most), extend("exclusiveMinimum" = legal::POWER.least, "unit" = legal::POWER.unit))]
    pub(crate) power: f64,
}

/// Friction between each wheel and the sphere. It transmits at most the force `mu` times
/// `normal_force`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Traction {
    /// Friction coefficient between wheel and sphere.
    #[schemars(range(max = legal::FRICTION.most), extend("exclusiveMinimum" = legal::FRICTION.least))]
    pub(crate) mu: f64,
    /// Normal force of each wheel on the sphere.
    #[schemars(range(max = legal::NORMAL_FORCE.most), extend("exclusiveMinimum" = legal::NORMAL_FORCE.least, "unit" = legal::NORMAL_FORCE.unit))]
    pub(crate) normal_force: f64,
}

/// Settings of the TCP service to which clients connect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Api {
    /// Address and port at which clients connect. Any address except loopback needs a token.
    pub(crate) listen: String,
    /// File with the token that clients must present. Its path is relative to the rig file. Absent:
    /// no token is needed.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "String", length(min = 1))]
    pub(crate) token_file: Option<PathBuf>,
    /// Certificate and key for encryption. If present, every connection must be encrypted. Absent:
    /// TCP without encryption.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Tls")]
    pub(crate) tls: Option<Tls>,
    /// What happens if the connection of the lease holder (the client that can command) ends
    /// without a release. `ramp`: its streamed torque ramps to zero. `keep`: its streamed torque
    /// ends when its validity expires. `fault`: the rig goes into the fault client_lost, and all
    /// torque is zero.
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

/// Certificate and key that encrypt the service (TLS 1.3).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Tls {
    /// File with the server's certificate, followed by any intermediate certificates (PEM). Its
    /// path is relative to the rig file.
    #[schemars(with = "String", length(min = 1))]
    pub(crate) certificate: PathBuf,
    /// File with the private key of the server's certificate (PEM). Its path is relative to the rig
    /// file.
    #[schemars(with = "String", length(min = 1))]
    pub(crate) key: PathBuf,
}

/// Default TCP port: the digits of HBOT on a phone's keypad.
const DEFAULT_PORT: u16 = 4268;
