//! Flight logs: keeps the samples of the last second, and has logs written on other threads.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Instant;

use tokio::sync::Notify;
use tokio::task::{JoinError, JoinSet};

use crate::flight::{Failures, Flight, FlightRecorder};
use crate::recording::{FlightNote, Notes};
use hbot_host::run_loop::sample::Sample;

/// Largest number of flight logs that are written at a time. A further log is discarded and counted
/// as failed.
const MAX_WRITING: usize = 2;

/// The outcome of writing a flight log: the log and the result of writing its file, or the error of
/// the thread that wrote it.
pub(super) type Written = Result<(Flight, io::Result<()>), JoinError>;

/// The flight recorder and the flight logs that are being written. The default value records
/// nothing.
#[derive(Default)]
pub(super) struct Flights {
    recorder: Option<FlightRecorder>,
    writing: JoinSet<(Flight, io::Result<()>)>,
    failures: Failures,
    /// Number of flight logs written so far.
    logs: u64,
    /// Number of flight logs that could not be written so far.
    failed: u64,
    /// Passes flight logs to the recorder.
    notes: Notes,
    /// Wakes the service's task when the writing of a flight log begins.
    changed: Arc<Notify>,
}

impl Flights {
    /// Creates a flight recorder for a loop with period `period_ns`, ns. Flight logs go into the
    /// folder `dir`; with `None` none are written.
    pub(super) fn new(dir: Option<PathBuf>, period_ns: u64, notes: Notes, changed: Arc<Notify>) -> Self {
        let recorder = dir.map(|dir| FlightRecorder::new(dir, period_ns));
        Self { recorder, notes, changed, ..Self::default() }
    }

    /// Records the next sample. If it completes a log, starts to write the log on another thread.
    #[inline]
    pub(super) fn record(&mut self, sample: &Sample) {
        let Some(flight) = self.recorder.as_mut().and_then(|recorder| recorder.push(sample)) else { return };
        if self.writing.len() < MAX_WRITING {
            self.write(flight);
            self.changed.notify_one();
        } else {
            let error = io::Error::other(format!("{MAX_WRITING} are still being written"));
            self.written(Ok((flight, Err(error))));
        }
    }

    /// Begins a flight log for the fault or stop `what` in `tick`. Returns the path that the log
    /// will have, or `None` if flight logs are not written.
    pub(super) fn trigger(&mut self, tick: u64, what: &str) -> Option<&Path> {
        self.recorder.as_mut().map(|recorder| recorder.trigger(tick, what))
    }

    /// Polls for the next flight log whose writing has ended. Stays pending while no log is being
    /// written.
    pub(super) fn poll_written(&mut self, context: &mut Context<'_>) -> Poll<Written> {
        match self.writing.poll_join_next(context) {
            Poll::Ready(Some(written)) => Poll::Ready(written),
            Poll::Ready(None) | Poll::Pending => Poll::Pending,
        }
    }

    /// Counts a flight log that was written or could not be written, and reports it in the
    /// program's log.
    pub(super) fn written(&mut self, written: Written) {
        match written {
            Ok((flight, Ok(()))) => {
                self.logs += 1;
                tracing::info!(path = %flight.path.display(), ticks = flight.samples.len(), "flight log written");
            }
            Ok((flight, Err(error))) => {
                self.failed += 1;
                if let Some(count) = self.failures.failed(Instant::now()) {
                    tracing::warn!(path = %flight.path.display(), %error, count, "flight logs could not be written");
                }
            }
            Err(error) => {
                self.failed += 1;
                tracing::error!(%error, "the flight log could not be written");
            }
        }
    }

    /// Returns the number of flight logs written.
    pub(super) fn logs(&self) -> u64 {
        self.logs
    }

    /// Returns the number of flight logs that could not be written.
    pub(super) fn failed(&self) -> u64 {
        self.failed
    }

    /// Writes all flight logs that have begun, complete or not, and waits until they are written.
    pub(super) async fn finish(mut self) -> Self {
        while let Some(flight) = self.recorder.as_mut().and_then(FlightRecorder::finish) {
            self.write(flight);
        }
        while let Some(written) = self.writing.join_next().await {
            self.written(written);
        }
        self
    }

    fn write(&mut self, flight: Flight) {
        let tick = |sample: Option<&Sample>| sample.map_or(0, |sample| sample.state.tick);
        let (from, until) = (tick(flight.samples.first()), tick(flight.samples.last()));
        self.notes.flight(FlightNote { path: flight.path.with_extension("mcap"), from, until });
        self.writing.spawn_blocking(move || {
            let result = flight.write();
            (flight, result)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn what_has_been_begun_is_written_at_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let mut flights =
            Flights::new(Some(folder.path().to_owned()), 1_000_000, Notes::default(), Arc::default());
        flights.record(&crate::still::still(1));
        let path = flights.trigger(1, "estop").expect("logs are kept").to_owned();
        assert_eq!(flights.logs(), 0);
        let flights = flights.finish().await;
        assert_eq!((flights.logs(), flights.failed(), path.exists()), (1, 0, true));
    }

    #[tokio::test]
    async fn without_a_folder_nothing_is_written() {
        let mut flights = Flights::new(None, 1_000_000, Notes::default(), Arc::default());
        flights.record(&crate::still::still(1));
        assert_eq!(flights.trigger(1, "estop"), None);
        let flights = flights.finish().await;
        assert_eq!((flights.logs(), flights.failed()), (0, 0));
    }
}
