//! Injects faults into a running server in wall-clock time. Prints the result of each as a row of
//! the fault table in docs/reliability.md.
//!
//! ```text
//! cargo build --release
//! cargo run --release -p hbot-reliability -- \
//!     [--protocol P] [--quick] [--seconds N] [--minutes N] [--out FILE] [ROW...]
//! ```
//!
//! The server, the motor controllers and the clients are separate processes, so that each can be
//! stopped and killed (`bench`). The motor controllers are a simulated rig behind a
//! pseudo-terminal. Those of hbot's own link (`far`) record the commands that they receive. Those
//! of other protocols (`servos`) record the torque of their motors. Only tick numbers of the server
//! and clocks of the motor controllers are read, so no result depends on when this program runs.
//!
//! The rows in `losses` and `vendors` take something away from the server. The rows in `timing`
//! measure something in alternation with a comparison. `recording` compares servers that keep
//! flight logs or record with servers that do not; `--minutes` says for how long each of them runs
//! altogether.

mod bench;
mod clients;
mod far;
mod losses;
mod recording;
mod rigs;
mod servos;
mod timing;
mod vendors;

use std::fmt::Write as _;
use std::time::Instant;

use hbot_api::Fault;
use hbot_config::rig::Protocol;
use rustix::process::{Resource, Rlimit, Signal, getrlimit, setrlimit};

use crate::recording::Server;

/// The result of a step of a test, which can fail with any error.
pub(crate) type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// A row of the fault table: the fault, what is promised, what was found, and whether the promise
/// was kept.
pub(crate) struct Row {
    pub(crate) fault: String,
    pub(crate) promise: String,
    pub(crate) found: String,
    pub(crate) kept: bool,
}

impl Row {
    pub(crate) fn new(fault: &str, promise: impl Into<String>, found: impl Into<String>, kept: bool) -> Self {
        Self { fault: fault.to_owned(), promise: promise.into(), found: found.into(), kept }
    }
}

/// The conditions under which a test runs.
#[derive(Clone, Copy)]
pub(crate) struct Setup {
    /// Protocol of the motor controllers.
    protocol: Protocol,
    /// Duration of each measurement, s.
    seconds: u64,
    /// Duration of all measurements together of one server of the rows `flight_logs` and
    /// `recording`, s. With `None` they take a few measurements.
    total: Option<u64>,
}

/// A function that runs a test and returns its row of the table.
type Make = fn(Setup) -> Outcome<Row>;

const ALL: &[Protocol] = &[Protocol::Hbot, Protocol::Moteus, Protocol::Odrive];
const HBOT: &[Protocol] = &[Protocol::Hbot];
const MOTEUS: &[Protocol] = &[Protocol::Moteus];
/// Protocols with one controller for each joint, from other vendors.
const VENDORS: &[Protocol] = &[Protocol::Moteus, Protocol::Odrive];

/// All tests, in the order of the table: the name, the protocols and the function of each.
///
/// The rows of noise are not made for ODrives. Their lines of text have no checksum, so a damaged
/// digit is another torque, which the driver cannot detect. docs/controllers.md therefore asks for
/// an adapter on USB.
const ROWS: &[(&str, &[Protocol], Make)] = &[
    ("client_killed", ALL, |on| losses::client_lost(on.protocol, "killed", Signal::KILL)),
    ("client_stopped", ALL, |on| losses::client_lost(on.protocol, "stopped (SIGSTOP)", Signal::STOP)),
    ("peer_killed", ALL, |on| losses::peer_gone(on.protocol, "killed", Signal::KILL)),
    ("peer_stopped", ALL, |on| losses::peer_gone(on.protocol, "stopped (SIGSTOP)", Signal::STOP)),
    ("peer_mute", ALL, |on| losses::peer_troubled(on.protocol, "mute", "fall silent", None)),
    ("peer_rebooted", ALL, |on| {
        losses::peer_troubled(on.protocol, "reboot", "lose power and come back", None)
    }),
    ("peer_babbles", ALL, |on| {
        losses::peer_troubled(on.protocol, "babble", "send garbage as fast as the line takes it", None)
    }),
    ("peer_echoes", HBOT, |on| losses::peer_troubled(on.protocol, "echo", "send our own frames back", None)),
    ("one_mute", VENDORS, |on| {
        let fault = "of one joint neither hear nor answer";
        losses::peer_troubled(on.protocol, "deafen_one", fault, Some(Fault::LinkLost))
    }),
    ("one_failed", VENDORS, |on| {
        let fault = "of one joint report a fault";
        losses::peer_troubled(on.protocol, "fail_one", fault, Some(Fault::ControllerFault))
    }),
    ("one_rebooted", VENDORS, |on| {
        let fault = "of one joint lose power and come back";
        losses::peer_troubled(on.protocol, "reboot_one", fault, Some(Fault::ControllerFault))
    }),
    ("one_expired", VENDORS, |on| {
        let fault = "of one joint report an expired watchdog";
        losses::peer_troubled(on.protocol, "expire_one", fault, Some(Fault::LinkLost))
    }),
    ("noise_0", HBOT, |_| losses::noise(0.0, 10_000, true)),
    ("noise_1", HBOT, |_| losses::noise(0.01, 10_000, true)),
    ("noise_1", MOTEUS, |on| vendors::noise(on.protocol, 0.01, 10_000, true)),
    ("noise_1_virtual", HBOT, |_| losses::noise_virtual(0.01, 1000)),
    ("noise_50", HBOT, |_| losses::noise(0.5, 10_000, false)),
    ("noise_50", MOTEUS, |on| vendors::noise(on.protocol, 0.5, 10_000, false)),
    ("sigterm", HBOT, |_| losses::signalled("SIGTERM", Signal::TERM)),
    ("sigterm", VENDORS, |on| vendors::signalled(on.protocol, "SIGTERM", Signal::TERM)),
    ("sigint", HBOT, |_| losses::signalled("SIGINT", Signal::INT)),
    ("sigint", VENDORS, |on| vendors::signalled(on.protocol, "SIGINT", Signal::INT)),
    ("disk_full", HBOT, |_| losses::disk_full()),
    ("disk_read_only", HBOT, |_| losses::disk_read_only()),
    ("ping", HBOT, |on| timing::ping(on.seconds)),
    ("ping_paced", HBOT, |on| timing::ping_paced(on.seconds)),
    ("render", HBOT, |on| timing::render(on.seconds)),
    ("subscribers", HBOT, |on| timing::subscribers(on.seconds)),
    ("attack", HBOT, |on| timing::attack(on.seconds)),
    ("load", HBOT, |on| timing::load(on.seconds)),
    ("flight_logs", HBOT, |on| recording::measured(1000, Server::Flights, on)),
    ("recording", HBOT, |on| recording::measured(1000, Server::Records, on)),
    ("recording_4_khz", HBOT, |on| recording::measured(4000, Server::Records, on)),
];

/// Returns the names and functions of the tests for `protocol`.
fn rows(protocol: Protocol) -> impl Iterator<Item = (&'static str, Make)> {
    let of = move |(_, protocols, _): &&(_, &[Protocol], _)| protocols.contains(&protocol);
    ROWS.iter().filter(of).map(|(name, _, make)| (*name, *make))
}

/// Duration of each measurement, s.
const SECONDS: u64 = 8;
/// Duration of each measurement with `--quick`, s.
const QUICK_SECONDS: u64 = 2;

fn main() -> Outcome<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["peer", "hbot"] => return far::run(),
        ["peer", name] => return servos::run(rigs::protocol(name)?),
        ["push", address] => return clients::push(address),
        ["render", address, seconds] => return clients::render(address, seconds.parse()?),
        ["echo"] => return clients::echo(),
        _ => {}
    }
    let mut on = Setup { protocol: Protocol::Hbot, seconds: SECONDS, total: None };
    let (mut out, mut wanted) = (None, Vec::new());
    let mut args = args.into_iter();
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or(format!("{arg} needs a value"));
        match arg.as_str() {
            "--quick" => on.seconds = QUICK_SECONDS,
            "--seconds" => on.seconds = value()?.parse()?,
            "--minutes" => on.total = Some(60 * value()?.parse::<u64>()?),
            "--out" => out = Some(value()?),
            "--protocol" => on.protocol = rigs::protocol(&value()?)?,
            _ => wanted.push(arg),
        }
    }
    let names: Vec<_> = rows(on.protocol).map(|(name, _)| name).collect();
    if let Some(unknown) = wanted.iter().find(|name| !names.contains(&name.as_str())) {
        let (protocol, names) = (on.protocol.name(), names.join(", "));
        return Err(format!(
            "{unknown}: legal are --protocol P, --quick, --seconds N, --minutes N, --out FILE, and for {protocol} the rows {names}"
        )
        .into());
    }
    // Up to a thousand connections are open at once.
    let limit = getrlimit(Resource::Nofile);
    setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit })?;
    table(on, &wanted, out.as_deref())
}

/// Runs the tests named in `wanted`, or all if none are named. Prints the row of each test when it
/// is done, and writes the table to the file `out`, if given.
fn table(on: Setup, wanted: &[String], out: Option<&str>) -> Outcome<()> {
    let mut table = "| fault | promise | found | |\n|---|---|---|---|\n".to_owned();
    print!("{table}");
    let (start, mut failed) = (Instant::now(), Vec::new());
    for (name, make) in rows(on.protocol) {
        if !wanted.is_empty() && !wanted.iter().any(|row| row == name) {
            continue;
        }
        eprintln!("{:5.0} s  {name}", start.elapsed().as_secs_f64());
        // A row that fails does not stop the others.
        let Row { fault, promise, found, kept } =
            make(on).unwrap_or_else(|error| Row::new(name, "", format!("could not be made: {error}"), false));
        if !kept {
            failed.push(name);
        }
        let mut line = String::new();
        writeln!(line, "| {fault} | {promise} | {found} | {} |", if kept { "kept" } else { "**not kept**" })?;
        print!("{line}");
        table += &line;
    }
    eprintln!("{:5.0} s  done", start.elapsed().as_secs_f64());
    if let Some(out) = out {
        std::fs::write(out, &table)?;
    }
    if failed.is_empty() { Ok(()) } else { Err(format!("not kept: {}", failed.join(", ")).into()) }
}
