//! What `stats` answers.

use crate::{CountsByName, ErrorCode, Fault, finite};
use serde::{Deserialize, Serialize};

/// The answer to `stats`: how long things took and how often something came about, since the server began. What a server does not
/// say is read as 0.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StatsOk {
    /// Ticks whose samples the service has seen.
    pub ticks: u64,
    /// Awake before a tick's deadline, waiting for it, us.
    pub awake_us: Distribution,
    /// From a tick's deadline to its start, us.
    pub lateness_us: Distribution,
    /// In the controller, us.
    pub compute_us: Distribution,
    /// On the serial line: reading, decoding, encoding, writing, us.
    pub link_us: Distribution,
    /// From a reading of the joints to the torque on the wire that was computed from it, us.
    pub age_us: Distribution,
    /// Ticks that started more than a quarter period after their deadline.
    pub late_ticks: u64,
    /// Ticks whose deadline passed before the one before them ended.
    pub skipped_ticks: u64,
    /// Ticks without a new reading.
    pub missed_ticks: u64,
    /// Damaged frames on the serial line.
    pub corrupt_frames: u64,
    /// Whole frames that were not for this rig.
    pub foreign_frames: u64,
    /// Commands that the serial line did not take whole.
    pub send_failures: u64,
    /// Times that a serial line was gone and came back.
    pub reopened_ports: u64,
    /// Samples of the loop that the service did not fetch in time.
    pub dropped_samples: u64,
    /// Faults by cause.
    pub faults: CountsByName<Fault>,
    /// Emergency stops.
    pub estops: u64,
    /// Requests read, refused ones included.
    pub requests: u64,
    /// Requests refused, by code; stream messages are among them.
    pub refused: CountsByName<ErrorCode>,
    /// Stream messages refused.
    pub refused_streams: u64,
    /// States that slow readers did not get.
    pub dropped_states: u64,
    /// Connections taken.
    pub connections: u64,
    /// Connections turned away because there were too many.
    pub connections_turned_away: u64,
    /// Connections to an encrypted port that never were encrypted.
    pub handshakes_failed: u64,
    /// Connections cut because their client did not read.
    pub connections_cut: u64,
    /// Flight logs written.
    pub flight_logs: u64,
    /// Flight logs that could not be written.
    pub flight_logs_failed: u64,
}

/// A distribution of times, us.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Distribution {
    /// Half were not longer.
    #[serde(serialize_with = "finite::scalar")]
    pub p50: f64,
    /// 90 % were not longer.
    #[serde(serialize_with = "finite::scalar")]
    pub p90: f64,
    /// 99 % were not longer.
    #[serde(serialize_with = "finite::scalar")]
    pub p99: f64,
    /// 99.9 % were not longer.
    #[serde(serialize_with = "finite::scalar")]
    pub p99_9: f64,
    /// 99.99 % were not longer.
    #[serde(serialize_with = "finite::scalar")]
    pub p99_99: f64,
    /// None was longer.
    #[serde(serialize_with = "finite::scalar")]
    pub max: f64,
    /// How many there were.
    pub count: u64,
}
