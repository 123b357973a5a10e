//! `hbot watch`: shows the state of a running server, live.

use std::io::{IsTerminal as _, Stdout, Write as _};
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use hbot_api::{Event, StateEvent};

use super::out::{Reader, foreign, note, say, written};
use super::{ServerAddress, orders, style};

/// Options of `hbot watch`.
#[derive(Debug, Args)]
pub(crate) struct WatchArgs {
    #[command(flatten)]
    address: ServerAddress,
    /// Print each sample as a line of JSON, for programs
    #[arg(long)]
    json: bool,
    /// Take every N-th tick (default: ten samples a second)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    every: Option<u64>,
}

pub(crate) fn run(args: &WatchArgs) -> anyhow::Result<ExitCode> {
    let mut client = orders::connect(&args.address, "hbot watch")?;
    let hello = client.hello().clone();
    let every = args.every.unwrap_or(((hello.rate_hz / 10.0) as u64).max(1));
    client.subscribe(every)?;
    let screen = std::io::stdout().is_terminal() && !args.json;
    if !args.json {
        say!(
            "{}{}{} on {} at {} Hz; Ctrl-C ends",
            style::NAME,
            foreign(&hello.rig),
            style::OFF,
            args.address.server,
            hello.rate_hz
        )?;
        // A terminal cuts the header at its right edge, like the rows below it.
        print(&header(), screen, screen)?;
        if screen {
            say!("")?;
        }
    }
    loop {
        let Some(event) = client.next_event(Duration::from_secs(3600))? else { continue };
        let line = match &event {
            Event::State(state) if args.json => serde_json::to_string(state)?,
            Event::State(state) => row(state),
            Event::Stopping(_) => {
                if screen {
                    raw(|out| out.write_all(style::CLEAR_LINE.as_bytes()))?;
                }
                note!("the server stops");
                return Ok(ExitCode::SUCCESS);
            }
            Event::Fault(fault) if !args.json => {
                let name = fault.fault.map_or_else(|| fault.mode.to_string(), |cause| cause.to_string());
                format!(
                    "{}{name}{}: {}",
                    style::of_mode(fault.mode.as_str()),
                    style::OFF,
                    foreign(&fault.message)
                )
            }
            Event::Scene(scene) if !args.json => format!("scene: {}", foreign(&scene.name)),
            Event::Dropped(dropped) if !args.json => {
                format!("{} samples lost: reading too slowly", dropped.count)
            }
            _ => continue,
        };
        if print(&line, screen, screen && matches!(event, Event::State(_)))? == Reader::Gone {
            return Ok(ExitCode::SUCCESS);
        }
    }
}

/// Prints a line. On a terminal, a state replaces the previous state.
fn print(line: &str, screen: bool, again: bool) -> anyhow::Result<Reader> {
    raw(|out| {
        if again {
            out.write_all(style::SAME_LINE.as_bytes())?;
            write!(anstream::stdout(), "{line}")?;
            out.write_all(style::LINE_END.as_bytes())
        } else {
            if screen {
                out.write_all(style::CLEAR_LINE.as_bytes())?;
            }
            writeln!(anstream::stdout(), "{line}")
        }
    })
}

/// Runs `write` on standard output, bypassing anstream, and flushes it.
fn raw(write: impl FnOnce(&mut Stdout) -> std::io::Result<()>) -> anyhow::Result<Reader> {
    let mut out = std::io::stdout();
    written(write(&mut out).and_then(|()| out.flush()))
}

fn header() -> String {
    format!(
        "{}{:>8}  {:9} {:^31}  {:^23}  {:^23}  {:>5} {:>8}{}",
        style::DIM,
        "t s",
        "mode",
        "orientation w x y z",
        "torque N m",
        "rate rad/s",
        "scale",
        "late us",
        style::OFF
    )
}

fn row(s: &StateEvent) -> String {
    let mode = s.fault.map_or_else(|| s.mode.to_string(), |fault| fault.to_string());
    let [w, x, y, z] = s.q;
    let [o1, o2, o3] = s.omega;
    let [t1, t2, t3] = s.torque;
    format!(
        "{:8.2}  {}{mode:9}{} {w:7.4} {x:7.4} {y:7.4} {z:7.4}  {t1:7.4} {t2:7.4} {t3:7.4}  {o1:7.3} {o2:7.3} {o3:7.3}  \
         {:5.2} {:8.1}",
        s.t,
        style::of_mode(s.mode.as_str()),
        style::OFF,
        s.scale,
        s.timing.lateness_us,
    )
}
