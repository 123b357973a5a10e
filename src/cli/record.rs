//! `hbot record`: records a running server from any machine.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::Context as _;
use clap::Args;
use hbot_api::{ClientError, Event, InfoOk};
use hbot_host::signals;
use hbot_record::{About, Writer};

use super::out::{note, say};
use super::{ServerAddress, orders};

/// Longest time for which states wait before they are in the file.
const FLUSH_EVERY: Duration = Duration::from_millis(500);
/// Longest time until a signal is noticed if the server sends nothing.
const LISTEN: Duration = Duration::from_millis(100);

/// Options of `hbot record`.
#[derive(Debug, Args)]
pub(crate) struct RecordArgs {
    /// File to write, which must not exist yet (MCAP)
    file: PathBuf,
    #[command(flatten)]
    address: ServerAddress,
    /// Record every N-th tick
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    every: u64,
    /// Stop after this time of the run
    #[arg(long, value_name = "SECONDS", value_parser = super::server::seconds)]
    duration: Option<f64>,
}

/// A recording in progress.
struct Session {
    writer: Writer<BufWriter<File>>,
    /// Unix time of tick 0, ns.
    unix_ns: u64,
    /// Unix time of the newest state, ns.
    newest: u64,
    /// Time of the first state, s since the start of the loop.
    begun: Option<f64>,
    states: u64,
    dropped: u64,
}

pub(crate) fn run(args: &RecordArgs) -> anyhow::Result<ExitCode> {
    let stop = signals::stop_flag()?;
    let mut client = orders::connect(&args.address, "hbot record")?;
    let info = client.info()?;
    let name = || args.file.display().to_string();
    let into = BufWriter::new(File::create_new(&args.file).with_context(name)?);
    let unix_ns = info.clock.map_or_else(now, |clock| clock.unix_ns);
    let mut writer = Writer::new(into, &about(&info, &client.hello().server)).with_context(name)?;
    let title = info.scene.get("name").and_then(|name| name.as_str()).unwrap_or_default();
    writer.scene(0, title, &info.scene.to_string(), unix_ns)?;
    client.subscribe(args.every)?;
    let mut session = Session { writer, unix_ns, newest: unix_ns, begun: None, states: 0, dropped: 0 };

    let mut flushed = Instant::now();
    while !stop.is_set() && !session.is_over(args.duration) {
        match client.next_event(LISTEN) {
            Ok(Some(event)) => {
                session.take(&event).with_context(name)?;
                if matches!(event, Event::Stopping(_)) {
                    break;
                }
            }
            Ok(None) => {}
            Err(ClientError::Closed) => {
                note!("the connection has ended");
                break;
            }
            Err(error) => return Err(error.into()),
        }
        if flushed.elapsed() >= FLUSH_EVERY {
            session.writer.flush().with_context(name)?;
            flushed = Instant::now();
        }
    }
    let dropped = session.dropped + client.events_lost();
    session.writer.finish().with_context(name)?;
    say!("{} states recorded, {dropped} lost", session.states)?;
    Ok(if dropped == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

impl Session {
    fn is_over(&self, duration: Option<f64>) -> bool {
        let since = |begun| (self.newest - self.unix_ns) as f64 * 1.0e-9 - begun;
        duration.is_some_and(|duration| self.begun.is_some_and(|begun| since(begun) >= duration))
    }

    fn take(&mut self, event: &Event) -> anyhow::Result<()> {
        match event {
            Event::State(state) => {
                self.newest = self.unix_ns + (state.t * 1.0e9).round() as u64;
                self.begun.get_or_insert(state.t);
                self.states += 1;
                self.writer.state(state, self.newest)?;
            }
            other => {
                if let Event::Dropped(dropped) = other {
                    self.dropped += dropped.count;
                }
                if let Event::Scene(scene) = other {
                    self.writer.scene(scene.tick, &scene.name, "", self.newest)?;
                }
                self.writer.event(other, self.newest)?;
            }
        }
        Ok(())
    }
}

fn now() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

fn about(info: &InfoOk, server: &str) -> About {
    let wheels =
        info.rig.wheels.iter().enumerate().map(|(k, wheel)| {
            wheel.name.clone().unwrap_or_else(|| format!("wheel {}", k + 1)).replace(' ', "_")
        });
    let joints = wheels.flat_map(|wheel| ["steer", "drive"].map(|joint| format!("{wheel}.{joint}")));
    let mut entries = BTreeMap::new();
    let mut put = |key: &str, value: String| entries.insert(key.to_owned(), value);
    put("rig_name", info.rig.name.clone());
    put("rate_hz", info.rig.rate_hz.to_string());
    put("accuracy", info.accuracy.clone());
    put("scene", info.scene.to_string());
    put("server", server.to_owned());
    About { joints: joints.collect(), entries }
}
