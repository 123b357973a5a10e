//! The keys of a rig file that choose numerical methods: accuracy, joint rates, passivity.

use hbot_core::design::device::Device;
use hbot_core::design::rig::{self as core, legal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::document::Report;

/// The value of the key `accuracy`: the name of a preset of numerical methods, or a table with one
/// key for each method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum Accuracy {
    Preset(Preset),
    Methods(MethodTable),
}

/// A preset that names a set of numerical methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Preset {
    /// The preset with the least computing time per tick. Its odometry is `euler`.
    Fast,
    /// The default preset. Its odometry is `midpoint`.
    Balanced,
    /// The preset with the smallest error. Its odometry is `magnus4` and its path `cubic`.
    Exact,
}

/// A table of numerical methods, with one key for each. An absent key has its value in the preset
/// `balanced`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct MethodTable {
    /// How the sphere's orientation is integrated from one reading of the joint angles to the next.
    pub(crate) odometry: core::OdometryMethod,
    /// Shape of the path that the joint angles are assumed to follow between two readings.
    pub(crate) path: core::PathFit,
    /// How the torque on the sphere is converted to joint torques.
    pub(crate) allocation: core::AllocationMethod,
}

impl Default for MethodTable {
    fn default() -> Self {
        let core::Methods { odometry, path, allocation, .. } = core::Methods::BALANCED;
        Self { odometry, path, allocation }
    }
}

impl Accuracy {
    /// Returns the name of the preset, or `custom` if the methods are given in a table.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Preset(Preset::Fast) => "fast",
            Self::Preset(Preset::Balanced) => "balanced",
            Self::Preset(Preset::Exact) => "exact",
            Self::Methods(_) => "custom",
        }
    }

    /// Returns the numerical methods that the preset or table selects. The rate estimate and the
    /// passivity limit have other keys in the rig file, so they are the defaults here.
    pub(crate) fn methods(self) -> core::Methods {
        match self {
            Self::Preset(Preset::Fast) => core::Methods::FAST,
            Self::Preset(Preset::Balanced) => core::Methods::BALANCED,
            Self::Preset(Preset::Exact) => core::Methods::EXACT,
            Self::Methods(MethodTable { odometry, path, allocation }) => {
                core::Methods { odometry, path, allocation, ..core::Methods::BALANCED }
            }
        }
    }
}

/// The value of the key `rate_estimate`: a method for the joint rates, or a table with the method
/// and its parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum RateEstimate {
    Method(RateMethod),
    Table(RateTable),
}

/// A method that estimates the joint rates from readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum RateMethod {
    /// The rates that the motor controllers report.
    Controller,
    /// The difference of the last two readings of the angle, divided by the time between them.
    Difference,
    /// The difference of the last two readings of the angle, smoothed by a first-order low-pass
    /// filter.
    LowPass,
    /// The slope of the longest straight line that fits the last readings within a tolerance.
    AdaptiveWindow,
    /// A Kalman filter that estimates angle, rate and acceleration.
    Kalman,
    /// The method with which the stiffest spring is stable on this rig and its ripple is not felt.
    Auto,
}

/// A method that estimates the joint rates, with its parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RateTable {
    /// Name of the method that estimates the joint rates.
    pub(crate) method: RateMethod,
    /// For `low_pass`: corner frequency. If absent: 30.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(min = legal::CUTOFF_HZ.least, max = legal::CUTOFF_HZ.most), extend("unit" = legal::CUTOFF_HZ.unit))]
    pub(crate) cutoff_hz: Option<f64>,
    /// For `adaptive_window`: largest distance of a reading from the fitted line, in encoder
    /// counts. If absent: 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "u32", range(min = legal::TOLERANCE_COUNTS.least as u32, max = legal::TOLERANCE_COUNTS.most as u32))]
    pub(crate) tolerance_counts: Option<u32>,
    /// For `adaptive_window`: longest time that the fitted line covers, in ticks. If absent: 32.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "u32", range(min = legal::LONGEST_TICKS.least as u32, max = legal::LONGEST_TICKS.most as u32))]
    pub(crate) longest_ticks: Option<u32>,
    /// For `kalman`: expected root mean square of a joint's acceleration. If absent: 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(min = legal::ACCELERATION.least, max = legal::ACCELERATION.most), extend("unit" = legal::ACCELERATION.unit))]
    pub(crate) acceleration: Option<f64>,
}

impl RateEstimate {
    /// Adds a mistake to the report for each parameter that the chosen method does not use.
    pub(crate) fn check(&self, report: &mut Report) {
        let Self::Table(table) = self else { return };
        let given = [
            ("cutoff_hz", "low_pass", RateMethod::LowPass, table.cutoff_hz.is_some()),
            (
                "tolerance_counts",
                "adaptive_window",
                RateMethod::AdaptiveWindow,
                table.tolerance_counts.is_some(),
            ),
            ("longest_ticks", "adaptive_window", RateMethod::AdaptiveWindow, table.longest_ticks.is_some()),
            ("acceleration", "kalman", RateMethod::Kalman, table.acceleration.is_some()),
        ];
        for (key, owner, method, present) in given {
            if present && table.method != method {
                report.push(
                    &format!("loop.rate_estimate.{key}"),
                    "another method has this key",
                    format!("with method = {owner:?} alone"),
                );
            }
        }
    }

    /// Returns whether the estimate is picked for the rig.
    pub(crate) fn is_auto(self) -> bool {
        let (Self::Method(method) | Self::Table(RateTable { method, .. })) = self;
        method == RateMethod::Auto
    }

    /// Converts the table to the core's rate estimate. Absent parameters have their defaults. The
    /// estimate that is picked for the rig is not known here, and becomes `controller`.
    pub(crate) fn compile(self) -> core::RateEstimate {
        let table = match self {
            Self::Table(table) => table,
            Self::Method(method) => RateTable {
                method,
                cutoff_hz: None,
                tolerance_counts: None,
                longest_ticks: None,
                acceleration: None,
            },
        };
        match table.method {
            RateMethod::Controller | RateMethod::Auto => core::RateEstimate::Controller,
            RateMethod::Difference => core::RateEstimate::Difference,
            RateMethod::LowPass => core::RateEstimate::LowPass { cutoff_hz: table.cutoff_hz.unwrap_or(30.0) },
            RateMethod::AdaptiveWindow => core::RateEstimate::AdaptiveWindow {
                tolerance_counts: table.tolerance_counts.unwrap_or(1),
                longest_ticks: table.longest_ticks.unwrap_or(32),
            },
            RateMethod::Kalman => {
                core::RateEstimate::Kalman { acceleration: table.acceleration.unwrap_or(100.0) }
            }
        }
    }
}

/// The value of the key `passivity`: true or false, or a table with the parameters of the passivity
/// controller.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum Passivity {
    Switch(bool),
    Table(PassivityTable),
}

/// Parameters of the passivity controller, which limits the energy that delay and sampling create,
/// or all energy delivered to the hand, to the energy absorbed from it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct PassivityTable {
    /// Energy that can be delivered to the hand in excess of the energy absorbed from it. If
    /// absent: 0.001.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(min = legal::ALLOWANCE.least, max = legal::ALLOWANCE.most), extend("unit" = legal::ALLOWANCE.unit))]
    pub(crate) allowance: Option<f64>,
    /// Largest amount of absorbed energy that can be delivered again later. If `strict` is true, it
    /// must be at least the energy that the scene's springs store when they are wound up. If
    /// absent:
    /// 0.005, or 0.5 if `strict` is true.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(min = legal::STORE.least, max = legal::STORE.most), extend("unit" = legal::STORE.unit))]
    pub(crate) store: Option<f64>,
    /// Largest damping that the passivity controller adds. If absent: a quarter of the sphere's
    /// inertia divided by the loop's period (or by 1 ms if the period is shorter).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(max = legal::DAMPING.most), extend("exclusiveMinimum" = legal::DAMPING.least, "unit" = legal::DAMPING.unit))]
    pub(crate) damping: Option<f64>,
    /// Whether all energy delivered to the hand counts. If false, energy that the scene or a client
    /// gives out on purpose does not count: only the energy that delay and sampling create.
    pub(crate) strict: bool,
}

impl Passivity {
    pub(crate) fn compile(self, device: &Device, period_s: f64) -> Option<core::PassivityLimit> {
        let table = match self {
            Self::Switch(false) => return None,
            Self::Switch(true) => PassivityTable::default(),
            Self::Table(table) => table,
        };
        let usual = if table.strict { core::PassivityLimit::strict } else { core::PassivityLimit::of };
        let usual = usual(device, period_s);
        Some(core::PassivityLimit {
            allowance: table.allowance.unwrap_or(usual.allowance),
            store: table.store.unwrap_or(usual.store),
            damping: table.damping.unwrap_or(usual.damping),
            ..usual
        })
    }
}

/// The value of the key `lead`: true or false, or a table with the parameters of the lead.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum Lead {
    Switch(bool),
    Table(LeadTable),
}

/// Parameters of the lead, which is the time from a reading to the pose at which the scene is
/// rendered.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct LeadTable {
    /// Ratio of the lead to the delay, which is the age of the reading plus half a period plus the
    /// largest `torque_lag`. If absent: 1.1.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(max = legal::LEAD_FACTOR.most), extend("exclusiveMinimum" = legal::LEAD_FACTOR.least))]
    pub(crate) factor: Option<f64>,
    /// Longest lead, which bounds the lead of late readings. If absent: 10.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(max = 1.0e3 * legal::LEAD_LONGEST.most), extend("exclusiveMinimum" = legal::LEAD_LONGEST.least, "unit" = "ms"))]
    pub(crate) longest_ms: Option<f64>,
}

impl Lead {
    /// Converts the key to the core's lead. Absent parameters have their defaults.
    pub(crate) fn compile(self) -> Option<core::LeadTime> {
        let usual = core::LeadTime::default();
        match self {
            Self::Switch(on) => on.then_some(usual),
            Self::Table(table) => Some(core::LeadTime {
                factor: table.factor.unwrap_or(usual.factor),
                longest: table.longest_ms.map_or(usual.longest, |ms| 1.0e-3 * ms),
            }),
        }
    }
}
