//! Injects faults into a running server in wall-clock time and prints what came of each, as the rows of docs/reliability.md.
//!
//! ```text
//! cargo build --release && cargo run --release -p hbot-reliability -- [--quick] [--seconds N] [--out FILE] [ROW...]
//! ```
//!
//! The server, the motor controllers (`far`: a simulated rig at the far end of a pseudo-terminal that keeps what it hears) and the
//! clients are processes of their own, so that each can be stopped and killed (`bench`). Only tick stamps of the server and
//! clocks of the controllers are read, so nothing depends on when this program runs. `losses` are the rows in which something is
//! taken away, `timing` those in which something is measured beside what it is compared with, turn by turn.

mod bench;
mod clients;
mod far;
mod losses;
mod timing;

use std::fmt::Write as _;
use std::time::Instant;

use rustix::process::{Resource, Rlimit, Signal, getrlimit, setrlimit};

/// What may go wrong on the way to a row.
pub(crate) type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// A row of the table.
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

/// How a row is made; what is measured takes so many seconds a turn.
type Make = fn(u64) -> Outcome<Row>;

/// The rows by name, in the order of the table.
const ROWS: &[(&str, Make)] = &[
    ("client_killed", |_| losses::client_lost("killed", Signal::KILL)),
    ("client_stopped", |_| losses::client_lost("stopped (SIGSTOP)", Signal::STOP)),
    ("peer_killed", |_| losses::peer_gone("killed", Signal::KILL)),
    ("peer_stopped", |_| losses::peer_gone("stopped (SIGSTOP)", Signal::STOP)),
    ("peer_mute", |_| losses::peer_troubled("mute", "says nothing more")),
    ("peer_rebooted", |_| losses::peer_troubled("reboot", "loses power and is back")),
    ("peer_babbles", |_| losses::peer_troubled("babble", "sends garbage as fast as the line takes it")),
    ("peer_echoes", |_| losses::peer_troubled("echo", "sends our own frames back")),
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

/// Seconds of each turn of what is measured, and those of a quick look.
const SECONDS: u64 = 8;
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
    // A thousand connections are held at once.
    let limit = getrlimit(Resource::Nofile);
    setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit })?;
    table(seconds, &wanted, out.as_deref())
}

/// Makes the rows that are wanted, all where none is named, and prints them as they come.
fn table(seconds: u64, wanted: &[String], out: Option<&str>) -> Outcome<()> {
    let mut table = "| fault | promise | found | |\n|---|---|---|---|\n".to_owned();
    print!("{table}");
    let (start, mut failed) = (Instant::now(), Vec::new());
    for (name, make) in ROWS {
        if !wanted.is_empty() && !wanted.iter().any(|row| row == name) {
            continue;
        }
        eprintln!("{:5.0} s  {name}", start.elapsed().as_secs_f64());
        // A row that could not be made is no reason to leave out the others.
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
