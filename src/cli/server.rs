//! `hbot server`: runs the loop and the TCP service until they are stopped.

use std::collections::BTreeMap;
use std::future::poll_fn;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::task::Poll;
use std::time::Duration;

use anyhow::{Context as _, bail};
use clap::builder::{PathBufValueParser, TypedValueParser as _};
use clap::{Args, ValueEnum};
use hbot_config::advice::Abilities;
use hbot_config::rig::Port;
use hbot_config::{Override, RigConfig, SceneFile};
use hbot_host::commission::expectation::{self, Expectation};
use hbot_host::rig::host::uncalibrated;
use hbot_host::rig::last_word::Program;
use hbot_host::run_loop::signals;
use hbot_host::run_loop::stop_signal::StopSignal;
use hbot_server::recording::{Limit, RecordOptions, is_file, try_to_make, unsuitable};
use hbot_server::server::{Server, ServerOptions, Time};
use hbot_server::service::Status;
use hbot_server::web::{AllowedHosts, WebOptions, url};
use serde_json::json;
use tokio::net::TcpListener;
use tokio::signal::unix::{SignalKind, signal};

use super::console::Console;
use super::numbers::{positive, processor, rate, seconds};
use super::out::{self, WrongLine, make_folder};
use super::record::file_or_folder;
use super::sockets::Web;
use super::{own_folder, secrets, sockets, status, style};

/// Exit code of a server whose run was good and whose recording was not: a file could not be
/// written to its end.
const RECORDING_FAILED: u8 = 3;

/// What the exit codes mean, for the help.
const EXIT_CODES: &str = "\
Exit codes:
  0  the server was stopped, or its --duration is over
  1  it could not start, or a part of it crashed
  2  the command line is wrong
  3  the run was good, but a file of --record could not be written to its end";

/// Options of `hbot server`. Values that are not given come from the rig file.
#[derive(Debug, Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct ServerArgs {
    /// Rig file (TOML) [default: the prototype, built in]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// Build the simulated rig as this rig file says, while the loop believes --rig: a device that
    /// is not as drawn (simulated rig only)
    #[arg(long, value_name = "FILE")]
    built: Option<PathBuf>,
    /// Scene file (TOML), or the name of a ready-made scene [default: spring]
    #[arg(long, value_name = "FILE|NAME")]
    scene: Option<PathBuf>,
    /// `sim` for the simulated rig, `sim:pty` for the same behind a pseudo-terminal, or a serial
    /// device
    #[arg(long, value_name = "sim|sim:pty|DEVICE", value_parser = device)]
    port: Option<String>,
    /// Address to listen on; addresses other than loopback need a token
    #[arg(long, value_name = "ADDR:PORT", value_parser = sockets::address)]
    listen: Option<SocketAddr>,
    /// Ticks a second, 50 to 20000
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, value_parser = rate)]
    rate: Option<u32>,
    /// Processor that the loop's thread is pinned to, 0 to 1023
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = processor)]
    cpu: Option<u32>,
    /// Preset of methods
    #[arg(long, value_enum)]
    accuracy: Option<Accuracy>,
    /// Use the cheapest methods whose error is at most this (above 0) in 10 s of brisk motion, as
    /// measured at start
    #[arg(long, value_name = "RAD", value_parser = positive("rad"), allow_negative_numbers = true, conflicts_with = "accuracy")]
    accuracy_target: Option<f64>,
    /// Wall-clock time, or as fast as the machine allows (simulated rig only)
    #[arg(long, value_enum, default_value_t = TimeArg::Wall)]
    time: TimeArg,
    /// Stop after this time of the loop, above 0 and at most 1e9 s, or with a unit, as in 5min
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    duration: Option<f64>,
    /// Record everything the loop does: a file that ends in .mcap, or a folder in which each run
    /// gets a file; `hbot replay` runs it again
    #[arg(long, value_name = "PATH", value_parser = PathBufValueParser::new().try_map(file_or_folder))]
    record: Option<PathBuf>,
    /// Begin a new file in the folder after this size or time, such as 500MB or 10min
    #[arg(long, value_name = "SIZE|TIME", requires = "record")]
    record_limit: Option<Limit>,
    /// Show the run live in Foxglove, Lichtblick or PlotJuggler, over WebSocket [default address:
    /// 127.0.0.1:8765]; without a token, and nothing can be commanded there
    #[arg(long, value_name = "ADDR:PORT", value_parser = sockets::address, num_args = 0..=1, default_missing_value = "127.0.0.1:8765")]
    foxglove: Option<SocketAddr>,
    /// Serve the page for browsers and the API over WebSocket at http://ADDR:PORT, or not [default:
    /// 127.0.0.1:4269 with a simulated rig, otherwise off]; addresses other than loopback need a
    /// token and encryption
    #[arg(long, value_name = "ADDR:PORT|off", value_parser = sockets::web)]
    web: Option<Web>,
    /// Name of this machine that a browser may use, besides `localhost` and its address; can be
    /// given several times
    #[arg(long, value_name = "NAME", value_parser = sockets::host_name)]
    allowed_host: Vec<String>,
    /// File with the token that clients must present
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Offer metrics for Prometheus at http://ADDR:PORT/metrics; addresses other than loopback need
    /// a token for the page
    #[arg(long, value_name = "ADDR:PORT", value_parser = sockets::address)]
    metrics: Option<SocketAddr>,
    /// File with the token that requests for metrics must present; must not be the clients' token
    #[arg(long, value_name = "FILE", requires = "metrics")]
    metrics_token_file: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Accuracy {
    /// Shortest computing time
    Fast,
    /// More accurate than usual encoders
    Balanced,
    /// Smallest error with fine encoders
    Exact,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum TimeArg {
    /// Ticks at deadlines of the system clock
    Wall,
    /// Ticks in lock-step with the simulated rig
    Virtual,
}

impl ServerArgs {
    /// Returns the values of the command line that replace those of the rig file.
    fn overrides(&self) -> Vec<Override> {
        let mut list = Vec::new();
        let mut put = |path, from, value: Option<serde_json::Value>| {
            list.extend(value.map(|value| Override { path, value, from }));
        };
        put("link.port", "--port", self.port.as_ref().map(|p| json!(p)));
        put("api.listen", "--listen", self.listen.map(|a| json!(a.to_string())));
        put("loop.rate_hz", "--rate", self.rate.map(|r| json!(r)));
        put("loop.cpu", "--cpu", self.cpu.map(|n| json!(n)));
        let accuracy = self.accuracy.and_then(|a| a.to_possible_value()).map(|a| json!(a.get_name()));
        put("loop.accuracy", "--accuracy", accuracy);
        put("api.token_file", "--token-file", self.token_file.as_ref().map(|p| json!(p)));
        list
    }
}

pub(crate) fn run(args: ServerArgs) -> anyhow::Result<ExitCode> {
    let console = Console::start()?;
    let ended = start(args, &console);
    console.end();
    ended
}

fn start(args: ServerArgs, console: &Console) -> anyhow::Result<ExitCode> {
    if args.record_limit.is_some() && args.record.as_deref().is_some_and(is_file) {
        bail!(WrongLine("--record-limit needs --record FOLDER".to_owned()));
    }
    let mut rig = super::rig_file::load(args.rig.as_deref(), &args.overrides())?;
    let built = built(&args, &rig)?;
    let scene = match &args.scene {
        Some(path) => super::scene::scene(path)?,
        None => SceneFile::default_scene(),
    };
    if args.metrics.is_some() {
        hbot_server::metrics::built().context("--metrics")?;
    }
    if args.foxglove.is_some() {
        hbot_server::live::built().context("--foxglove")?;
    }
    let token = secrets::token(&rig)?;
    let metrics_token = match args.metrics {
        None => None,
        Some(at) => secrets::metrics_token(at, args.metrics_token_file.as_deref(), token.as_deref())?,
    };
    let expected = expected(&mut rig, args.accuracy_target)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(serve(args, (rig, built), scene, [token, metrics_token], &expected, console))
}

/// Returns the rig file from which the simulated rig is built, if the command line names one.
fn built(args: &ServerArgs, rig: &RigConfig) -> anyhow::Result<Option<RigConfig>> {
    let Some(path) = &args.built else { return Ok(None) };
    let built = super::rig_file::load(Some(path), &[])?;
    hbot_host::rig::built::check(rig, &built).with_context(|| format!("--built {}", path.display()))?;
    Ok(Some(built))
}

async fn serve(
    args: ServerArgs,
    (rig, built): (RigConfig, Option<RigConfig>),
    scene: SceneFile,
    [token, metrics_token]: [Option<String>; 2],
    expected: &Expectation,
    console: &Console,
) -> anyhow::Result<ExitCode> {
    let stop_signal = StopSignal::listen()?;
    let listener = sockets::bind(rig.api.listen, "--listen").await?;
    let address = listener.local_addr()?;
    let metrics = sockets::bind_if(args.metrics, "--metrics").await?;
    let live = sockets::bind_if(args.foxglove, "--foxglove").await?;
    let (live, live_at) = live.unzip();
    let hosts = Arc::new(AllowedHosts::new(args.allowed_host.clone()));
    let port = |listener: TcpListener| {
        listener.into_std().map(|listener| WebOptions { listener, hosts: Arc::clone(&hosts) })
    };
    let simulated = rig.link.port.is_simulated();
    let (web, no_web) = sockets::bind_web(args.web, simulated, &rig.api).await?;
    let (web, web_at) = web.unzip();
    let web_at = web_at.map(|at| url(at, rig.api.tls.is_some()));
    let mut stopping = Vec::new();
    for number in signals::STOPPING {
        stopping.push(signal(SignalKind::from_raw(number))?);
    }

    let time = if args.time == TimeArg::Virtual { Time::Virtual } else { Time::Wall };
    let mut secrets = secrets::notices(&rig, args.metrics_token_file.as_deref());
    secrets.extend(live_at.and_then(secrets::live_notice));
    let banner = banner(&rig, scene.name(), (address, web_at), time, expected);
    let mut warnings = uncalibrated(&rig);
    warnings.extend(Abilities::of(&rig).warnings(&scene).iter().map(ToString::to_string));
    let recording = recording(&args, &rig)?;
    let flight_dir = flight_dir();
    let nowhere = flight_dir.is_none();
    let server = Server::start(ServerOptions {
        rig,
        built,
        scene,
        time,
        duration: args.duration.map(Duration::from_secs_f64),
        token,
        buses: None,
        last_word: Some(Program::this(super::LAST_WORD)),
        flight_dir,
        recorder: None,
        recording,
        live: live.map(&port).transpose()?,
        web: web.map(&port).transpose()?,
    })?;
    stop_signal.obey(server.emergency_stop())?;
    if let Some((_, at)) = &metrics {
        console.say(format!("metrics http://{at}/metrics"));
    }
    if let Some(at) = live_at {
        console.say(format!("viewers ws://{at}"));
    }
    if let Some(file) = server.recording_file() {
        console.say(format!("recording to {}", file.display()));
    }
    console.say(out::banner(&banner));
    let nowhere = nowhere.then(|| {
        "no flight logs are written: neither XDG_STATE_HOME nor HOME is an absolute path".to_owned()
    });
    for warning in warnings {
        console.say(format!("  {}warning{}  {warning}", style::WARN, style::OFF));
    }
    for notice in server.notices().iter().chain(&nowhere).chain(&secrets).chain(&no_web) {
        console.say(format!("  {}note{}     {notice}", style::WARN, style::OFF));
    }

    let (control_in, control) = tokio::sync::mpsc::channel(8);
    if let Some((listener, _)) = metrics {
        tokio::spawn(hbot_server::metrics::serve(listener, control_in, metrics_token));
    }
    let (status_in, status) = tokio::sync::watch::channel(Status::default());
    console.status(Some(status));
    let shutdown = poll_fn(move |context| {
        if stopping.iter_mut().any(|signal| signal.poll_recv(context).is_ready()) {
            Poll::Ready(())
        } else {
            Poll::Pending
        }
    });
    let finished = server.serve(listener, control, status_in, shutdown).await;
    console.status(None);
    console.say(status::summary(&finished));
    let incomplete = finished.recorded.is_some_and(|recorded| recorded.failed_files > 0);
    Ok(match finished.failed {
        Some(_) => ExitCode::FAILURE,
        None if incomplete => ExitCode::from(RECORDING_FAILED),
        None => ExitCode::SUCCESS,
    })
}

/// Returns what to record. The metadata of a recording name the rig file and the command line's
/// changes to it, the port, the rig's certificate, and this machine.
fn recording(args: &ServerArgs, rig: &RigConfig) -> anyhow::Result<RecordOptions> {
    if let Some((path, why)) = args.record.as_deref().and_then(|path| Some((path, unsuitable(path)?))) {
        bail!("--record {}: {why}. Name a new file that ends in .mcap, or a folder", path.display());
    }
    match &args.record {
        Some(path) if is_file(path) => {
            anyhow::ensure!(
                !path.exists(),
                "--record {}: the file exists already. Name another one, or a folder, in which each run gets a file",
                path.display()
            );
        }
        _ => {}
    }
    if let Some(path) = &args.record {
        let folder = if is_file(path) { path.parent().unwrap_or(path) } else { path };
        make_folder(folder).and_then(|()| try_to_make(path)).with_context(|| {
            format!(
                "--record {}: no file can be made there. Name a place where you may write",
                path.display()
            )
        })?;
    }
    let mut about = BTreeMap::new();
    about.extend(rig.certificate.clone().map(|name| ("certificate".to_owned(), name)));
    about.insert("port".to_owned(), rig.link.port.to_string());
    if let Some(path) = &args.rig {
        about.insert("rig_file".to_owned(), hbot_config::read_text(path)?);
    }
    let changes = args.overrides().into_iter().map(|change| format!("{} = {}", change.path, change.value));
    about.insert("overrides".to_owned(), changes.collect::<Vec<_>>().join("\n"));
    if let Ok(machine) = std::fs::read_to_string("/proc/sys/kernel/hostname") {
        about.insert("machine".to_owned(), machine.trim().to_owned());
    }
    let (path, limit) = (args.record.clone(), args.record_limit);
    Ok(RecordOptions { path, limit, about })
}

/// Measures what the rig's methods cost on this machine and how large their error is. With a
/// `target`, rad, it selects the cheapest methods whose error is at most that and sets them in
/// `rig`. It runs before the loop starts, so that neither disturbs the other.
fn expected(rig: &mut RigConfig, target: Option<f64>) -> anyhow::Result<Expectation> {
    let Some(target) = target else { return Ok(expectation::of(&rig.rig)) };
    match expectation::cheapest(&rig.rig, target) {
        Ok(choice) => {
            rig.rig = rig.rig.with(|parts| parts.methods = choice.chosen(&parts.methods))?;
            // The preset has this name if a rig file chooses each method itself.
            rig.accuracy = "custom";
            Ok(choice)
        }
        Err(best) if best.error.is_finite() => bail!(
            "--accuracy-target {target:e}: no methods meet it on this rig at {} Hz. The best are {} with {:.1e} rad in {}; finer \
             encoders or another rate may bring more",
            rig.rate_hz,
            best.name(),
            best.error,
            best.motion()
        ),
        Err(best) => bail!("--accuracy-target {target:e}: {}", too_slow(rig, &best)),
    }
}

fn too_slow(rig: &RigConfig, expected: &Expectation) -> String {
    format!(
        "at {} Hz a joint of this rig turns by half a turn and more in a tick of {}",
        rig.rate_hz,
        expected.motion()
    )
}

/// Returns the text that the server prints at start: rig, port, rate, methods with their cost and
/// error, scene, addresses.
fn banner(
    rig: &RigConfig,
    scene: &str,
    (address, web): (SocketAddr, Option<String>),
    time: Time,
    expected: &Expectation,
) -> String {
    let (name, off) = (style::NAME, style::OFF);
    let how = match time {
        Time::Wall => "wall-clock time",
        Time::Virtual => "virtual time",
    };
    let wheels = rig.wheels.len();
    let load = 100.0 * expected.ns / rig.rig.timing.period_ns as f64;
    let error = if expected.error.is_finite() {
        format!("errs by {:.1e} rad in {}", expected.error, expected.motion())
    } else {
        too_slow(rig, expected)
    };
    let port = &rig.link.port;
    let baud = if port.is_simulated() { String::new() } else { format!(" at {} baud", rig.link.baud) };
    let cpu = rig.cpu.map_or_else(String::new, |number| format!(", on processor {number}"));
    let debug = if cfg!(debug_assertions) { " in a debug build" } else { "" };
    let web = web.map_or_else(String::new, |at| format!("\n  web      {name}{at}{off}"));
    // Without --server, a client connects to the usual address.
    let usual = address.to_string() == super::SERVER;
    let at = if usual { String::new() } else { format!(" --server {address}") };
    let tls = if rig.api.tls.is_some() { " (TLS alone)" } else { "" };
    format!(
        "{name}hbot {}{off}: {}\n  rig      {} ({wheels} wheels, {} joints)\n  port     {}{baud}\n  rate     {} Hz, {how}{cpu}, \
         accuracy {}\n  methods  {}: orientation takes {:.2} us a tick here{debug} ({load:.2} %), {error}\n  scene    {scene}{web}\n  listen{tls}   {name}{address}{off}\n  \
         Ctrl-C stops it; in another terminal, `hbot watch{at}` shows the sphere and `hbot scene show{at}` tells what `hbot set` can change",
        env!("CARGO_PKG_VERSION"),
        live_or_simulated(port),
        rig.name,
        2 * wheels,
        port,
        rig.rate_hz,
        rig.accuracy,
        expected.name(),
        expected.ns * 1.0e-3,
    )
}

/// Parses the name of a port. A TCP port is a likely slip of the pen.
fn device(text: &str) -> Result<String, String> {
    // A device under /dev can end in a number as well.
    let number = text.rsplit(':').next().filter(|_| !text.contains('/'));
    match number.and_then(|end| end.parse::<u16>().ok()) {
        None => Ok(text.to_owned()),
        Some(number) => Err(format!(
            "a serial device such as /dev/ttyACM0, or sim; clients connect to --listen 127.0.0.1:{number}"
        )),
    }
}

/// Returns the words that say whether motors can push, and how torque comes on.
fn live_or_simulated(port: &Port) -> String {
    let off = style::OFF;
    if port.is_simulated() {
        format!("{}SIMULATED{off} rig, no motors; it enables itself", style::WARN)
    } else {
        format!("{}LIVE{off} rig, motors on {port}; torque waits for `hbot enable`", style::BAD)
    }
}

/// Returns the directory for flight logs, in the user's state directory (XDG base directories).
/// Returns `None` if neither `XDG_STATE_HOME` nor `HOME` is an absolute path.
pub(crate) fn flight_dir() -> Option<PathBuf> {
    own_folder("XDG_STATE_HOME", ".local/state").map(|dir| dir.join("hbot/flight"))
}

/// Returns the flight logs of this user, the newest last: their names sort by time.
pub(crate) fn flight_logs() -> Vec<PathBuf> {
    let entries = flight_dir().and_then(|dir| std::fs::read_dir(dir).ok());
    let paths = entries.into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    let mut logs: Vec<PathBuf> = paths.filter(|path| path.extension().is_some_and(|e| e == "csv")).collect();
    logs.sort();
    logs
}
