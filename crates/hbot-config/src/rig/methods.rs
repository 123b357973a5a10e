//! The keys of a rig file that name methods: accuracy, joint rates, passivity.

use hbot_core::device::Device;
use hbot_core::rig::{self as core, legal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::document::Report;

/// A preset of methods, or a table that names each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum Accuracy {
    Preset(Preset),
    Methods(MethodTable),
}

/// A preset of methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Preset {
    /// The least time a tick: odometry euler.
    Fast,
    /// The default: odometry midpoint.
    Balanced,
    /// The least error: odometry magnus4, path cubic.
    Exact,
}

/// The methods one by one; those of `balanced` where absent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct MethodTable {
    /// How orientation is integrated from one reading to the next.
    pub(crate) odometry: core::OdometryMethod,
    /// What way the joints are taken to have gone between two readings.
    pub(crate) path: core::PathFit,
    /// How a torque on the sphere becomes joint torques.
    pub(crate) allocation: core::AllocationMethod,
}

impl Default for MethodTable {
    fn default() -> Self {
        let core::Methods { odometry, path, allocation, .. } = core::Methods::BALANCED;
        Self { odometry, path, allocation }
    }
}

impl Accuracy {
    /// The name of the preset, `custom` for a table.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Preset(Preset::Fast) => "fast",
            Self::Preset(Preset::Balanced) => "balanced",
            Self::Preset(Preset::Exact) => "exact",
            Self::Methods(_) => "custom",
        }
    }

    /// The methods of the preset or table; rates and passivity are those of the default.
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

/// Where joint rates come from: a method, or a table that names it with its parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum RateEstimate {
    Method(RateMethod),
    Table(RateTable),
}

/// Where joint rates come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum RateMethod {
    /// As the motor controllers report them.
    Controller,
    /// The difference of the last two readings.
    Difference,
    /// The same through a low pass of first order.
    LowPass,
    /// The longest chord through the last readings.
    AdaptiveWindow,
    /// A Kalman filter of angle, rate and acceleration.
    Kalman,
}

/// A method with its parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RateTable {
    /// Which one.
    pub(crate) method: RateMethod,
    /// Of `low_pass`: its corner; 30 where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(min = legal::CUTOFF_HZ.least, max = legal::CUTOFF_HZ.most), extend("unit" = legal::CUTOFF_HZ.unit))]
    pub(crate) cutoff_hz: Option<f64>,
    /// Of `adaptive_window`: how far a reading may be off the chord, counts; 1 where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "u32", range(min = legal::TOLERANCE_COUNTS.least as u32, max = legal::TOLERANCE_COUNTS.most as u32))]
    pub(crate) tolerance_counts: Option<u32>,
    /// Of `adaptive_window`: how far back the chord may reach, ticks; 32 where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "u32", range(min = legal::LONGEST_TICKS.least as u32, max = legal::LONGEST_TICKS.most as u32))]
    pub(crate) longest_ticks: Option<u32>,
    /// Of `kalman`: root mean square of a joint's acceleration; 100 where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(min = legal::ACCELERATION.least, max = legal::ACCELERATION.most), extend("unit" = legal::ACCELERATION.unit))]
    pub(crate) acceleration: Option<f64>,
}

impl RateEstimate {
    /// Reports the parameters that the method does not have.
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

    /// The core's estimate, with defaults for what is absent.
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
            RateMethod::Controller => core::RateEstimate::Controller,
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

/// Whether energy given out is held within what came in, or a table that says how.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum Passivity {
    Switch(bool),
    Table(PassivityTable),
}

/// How energy given out is held within what came in.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct PassivityTable {
    /// Energy that may be given out beyond what came in; 0.001 where absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(min = legal::ALLOWANCE.least, max = legal::ALLOWANCE.most), extend("unit" = legal::ALLOWANCE.unit))]
    pub(crate) allowance: Option<f64>,
    /// The most that is remembered of energy that came in: no less than springs hold when they are wound; 0.5 where absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(min = legal::STORE.least, max = legal::STORE.most), extend("unit" = legal::STORE.unit))]
    pub(crate) store: Option<f64>,
    /// The most damping that is added; a quarter of the sphere's inertia over the loop's period (1 ms at least) where absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(max = legal::DAMPING.most), extend("exclusiveMinimum" = legal::DAMPING.least, "unit" = legal::DAMPING.unit))]
    pub(crate) damping: Option<f64>,
}

impl Passivity {
    pub(crate) fn compile(self, device: &Device, period_s: f64) -> Option<core::PassivityLimit> {
        let usual = core::PassivityLimit::of(device, period_s);
        match self {
            Self::Switch(on) => on.then_some(usual),
            Self::Table(table) => Some(core::PassivityLimit {
                allowance: table.allowance.unwrap_or(usual.allowance),
                store: table.store.unwrap_or(usual.store),
                damping: table.damping.unwrap_or(usual.damping),
            }),
        }
    }
}
