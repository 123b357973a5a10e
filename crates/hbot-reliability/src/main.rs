//! Injects faults into a running server in wall-clock time. Prints the result of each as a row of
//! the fault table in docs/reliability.md.
//!
//! ```text
//! cargo build --release
//! cargo run --release -p hbot-reliability -- [--quick] [--seconds N] [--out FILE] [ROW...]
//! ```
//!
//! The server, the motor controllers and the clients are separate processes, so that each can be
//! stopped and killed (`bench`). The motor controllers (`far`) are a simulated rig behind a
//! pseudo-terminal that records the commands it receives. Only tick numbers of the server and
//! clocks of the motor controllers are read, so no result depends on when this program runs.
//!
//! The rows in `losses` take something away from the server. The rows in `timing` measure something
//! in alternation with a comparison.

mod bench;
mod clients;
mod far;
mod losses;
mod timing;

use std::fmt::Write as _;
use std::time::Instant;

use rustix::process::{Resource, Rlimit, Signal, getrlimit, setrlimit};

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

/// A function that runs a test and returns its row of the table. Its argument is the duration of
/// each measurement, s.
type Make = fn(u64) -> Outcome<Row>;

/// All tests, in the order of the table: the name and the function of each.
const ROWS: &[(&str, Make)] = &[
    ("client_killed", |_| losses::client_lost("killed", Signal::KILL)),
    ("client_stopped", |_| losses::client_lost("stopped (SIGSTOP)", Signal::STOP)),
    ("peer_killed", |_| losses::peer_gone("killed", Signal::KILL)),
    ("peer_stopped", |_| losses::peer_gone("stopped (SIGSTOP)", Signal::STOP)),
    ("peer_mute", |_| losses::peer_troubled("mute", "fall silent")),
    ("peer_rebooted", |_| losses::peer_troubled("reboot", "lose power and come back")),
    ("peer_babbles", |_| losses::peer_troubled("babble", "send garbage as fast as the line takes it")),
    ("peer_echoes", |_| losses::peer_troubled("echo", "send our own frames back")),
    ("noise_0", |_| losses::noise(0.0, 10_000, true)),
    ("noise_1", |_| losses::noise(0.01, 10_000, true)),
    ("noise_1_virtual", |_| losses::noise_virtual(0.01, 1000)),
    ("noise_50", |_| losses::noise(0.5, 10_000, false)),
    ("sigterm", |_| losses::signalled("SIGTERM", Signal::TERM)),
    ("sigint", |_| losses::signalled("SIGINT", Signal::INT)),
    ("disk_full", |_| losses::disk_full()),
    ("disk_read_only", |_| losses::disk_read_only()),
    ("ping", timing::ping),
    ("ping_paced", timing::ping_paced),
    ("render", timing::render),
    ("subscribers", timing::subscribers),
    ("attack", timing::attack),
    ("load", timing::load),
];

/// Duration of each measurement, s.
const SECONDS: u64 = 8;
/// Duration of each measurement with `--quick`, s.
const QUICK_SECONDS: u64 = 2;

fn main() -> Outcome<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["peer"] => return far::run(),
        ["push", address] => return clients::push(address),
        ["render", address, seconds] => return clients::render(address, seconds.parse()?),
        ["echo"] => return clients::echo(),
        _ => {}
    }
    let (mut seconds, mut out, mut wanted) = (SECONDS, None, Vec::new());
    let mut args = args.into_iter();
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or(format!("{arg} needs a value"));
        match arg.as_str() {
            "--quick" => seconds = QUICK_SECONDS,
            "--seconds" => seconds = value()?.parse()?,
            "--out" => out = Some(value()?),
            name if ROWS.iter().any(|(row, _)| *row == name) => wanted.push(name.to_owned()),
            _ => {
                let names: Vec<_> = ROWS.iter().map(|(name, _)| *name).collect();
                return Err(format!(
                    "{arg}: legal are --quick, --seconds N, --out FILE, and the rows {}",
                    names.join(", ")
                )
                .into());
            }
        }
    }
    // Up to a thousand connections are open at once.
    let limit = getrlimit(Resource::Nofile);
    setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit })?;
    table(seconds, &wanted, out.as_deref())
}

/// Runs the tests named in `wanted`, or all if none are named. Prints the row of each test when it
/// is done, and writes the table to the file `out`, if given.
fn table(seconds: u64, wanted: &[String], out: Option<&str>) -> Outcome<()> {
    let mut table = "| fault | promise | found | |\n|---|---|---|---|\n".to_owned();
    print!("{table}");
    let (start, mut failed) = (Instant::now(), Vec::new());
    for (name, make) in ROWS {
        if !wanted.is_empty() && !wanted.iter().any(|row| row == name) {
            continue;
        }
        eprintln!("{:5.0} s  {name}", start.elapsed().as_secs_f64());
        // A row that fails does not stop the others.
        let Row { fault, promise, found, kept } = make(seconds)
            .unwrap_or_else(|error| Row::new(name, "", format!("could not be made: {error}"), false));
        if !kept {
            failed.push(*name);
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
