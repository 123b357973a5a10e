//! The op `stats`.

use super::{Op, OpRow, Who};
use crate::{Client, ClientError, CountsByName, ErrorCode, Fault, finite};
use serde::{Deserialize, Serialize};

pub(super) const ROW: OpRow = OpRow::new(Who::Any, &[]).weighing(100);

/// The answer to the op `stats`: distributions of times and counts of events since the server
/// started. A field that the server does not send is read as 0.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StatsOk {
    /// Number of ticks whose records the service has received from the control loop.
    pub ticks: u64,
    /// Time for which the control loop was awake before a tick's deadline, waiting for the
    /// deadline, us.
    pub awake_us: Distribution,
    /// Time from a tick's deadline to its start, us.
    pub lateness_us: Distribution,
    /// Computing time of the control law in a tick, us.
    pub compute_us: Distribution,
    /// Time spent on the serial line in a tick: reading, decoding, encoding and writing, us.
    pub link_us: Distribution,
    /// Time from the measurement of the joints to the sending of the torque computed from it, us.
    pub age_us: Distribution,
    /// Number of late ticks: those that started more than a quarter period after their deadline.
    pub late_ticks: u64,
    /// Number of skipped ticks: those whose deadline passed before the tick before them ended.
    pub skipped_ticks: u64,
    /// Number of missed ticks: those without a new reading from the motor controllers.
    pub missed_ticks: u64,
    /// Number of damaged frames received on the serial line.
    pub corrupt_frames: u64,
    /// Number of undamaged frames received that were not meant for this rig.
    pub foreign_frames: u64,
    /// Number of commands that the serial line did not accept completely.
    pub send_failures: u64,
    /// Number of times that a serial line was lost and opened again.
    pub reopened_ports: u64,
    /// Number of ticks whose records were lost because the service did not fetch them in time.
    pub dropped_samples: u64,
    /// Number of faults since the server started, for each cause.
    pub faults: CountsByName<Fault>,
    /// Number of emergency stops since the server started.
    pub estops: u64,
    /// Number of requests that the server read, including those that it refused.
    pub requests: u64,
    /// Number of requests refused for each error code, including stream messages.
    pub refused: CountsByName<ErrorCode>,
    /// Number of stream messages (repeated torques, references and orientations) that the server
    /// refused.
    pub refused_streams: u64,
    /// Number of state messages dropped because a client read too slowly.
    pub dropped_states: u64,
    /// Number of connections that the server accepted.
    pub connections: u64,
    /// Number of connections refused because there were too many.
    pub connections_turned_away: u64,
    /// Number of connections to an encrypted port that did not complete the TLS handshake.
    pub handshakes_failed: u64,
    /// Number of connections that the server closed because the client did not read.
    pub connections_cut: u64,
    /// Number of flight logs written to disk.
    pub flight_logs: u64,
    /// Number of flight logs that could not be written to disk.
    pub flight_logs_failed: u64,
    /// Number of ticks that were written to recordings (`hbot server --record`).
    pub recorded_ticks: u64,
    /// Number of ticks that are missing in recordings, because the recorder or the disk was too
    /// slow, or because no recording could be written.
    pub unrecorded_ticks: u64,
    /// Number of recordings that could not be begun or not be written to their end.
    pub recordings_failed: u64,
    /// Number of messages dropped because a live viewer (`hbot server --foxglove`) read too slowly.
    pub dropped_live: u64,
}

/// A summary of measured durations: percentiles and maximum, in us, and how many were measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Distribution {
    /// Median: 50 % of the times are at most this long, us.
    #[serde(serialize_with = "finite::scalar")]
    pub p50: f64,
    /// 90th percentile: 90 % of the times are at most this long, us.
    #[serde(serialize_with = "finite::scalar")]
    pub p90: f64,
    /// 99th percentile: 99 % of the times are at most this long, us.
    #[serde(serialize_with = "finite::scalar")]
    pub p99: f64,
    /// 99.9th percentile: 99.9 % of the times are at most this long, us.
    #[serde(serialize_with = "finite::scalar")]
    pub p99_9: f64,
    /// 99.99th percentile: 99.99 % of the times are at most this long, us.
    #[serde(serialize_with = "finite::scalar")]
    pub p99_99: f64,
    /// Longest time of all, us.
    #[serde(serialize_with = "finite::scalar")]
    pub max: f64,
    /// Number of measured values.
    pub count: u64,
}

impl Client {
    /// Asks for the statistics and counters of the control loop and the service.
    pub fn stats(&mut self) -> Result<StatsOk, ClientError> {
        self.ask(Op::Stats)
    }
}
