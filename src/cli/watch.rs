//! `hbot watch`: shows the state of a running server, live.

use std::io::{IsTerminal as _, Stdout, Write as _};
use std::process::ExitCode;
use std::time::{Duration, Instant, SystemTime};

use clap::Args;
use hbot_api::{Event, Mode, StateEvent, time_of_day};
use hbot_host::run_loop::{StopFlag, signals};

use super::numbers::whole;
use super::out::{Reader, foreign, note, say, written};
use super::{ServerAddress, orders, show, style, terminal};

/// Longest time after which Ctrl-C is noticed.
const ATTENTIVE: Duration = Duration::from_millis(100);
/// Time without a state after which the user is told, unless states are further apart.
const SILENT_AFTER: Duration = Duration::from_secs(2);

/// Options of `hbot watch`.
#[derive(Debug, Args)]
#[command(after_help = COLUMNS)]
pub(crate) struct WatchArgs {
    #[command(flatten)]
    address: ServerAddress,
    /// Print each sample as a line of JSON, for programs
    #[arg(long)]
    json: bool,
    /// Take every N-th tick, 1 to 1000000 (default: ten samples a second)
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole(1..=1_000_000_u64))]
    every: Option<u64>,
}

pub(crate) fn run(args: &WatchArgs) -> anyhow::Result<ExitCode> {
    let mut client = orders::connect(&args.address, "hbot watch")?;
    let hello = client.hello().clone();
    let every = args.every.unwrap_or(((hello.rate_hz / 10.0) as u64).max(1));
    client.subscribe(every)?;
    let screen = std::io::stdout().is_terminal() && !args.json;
    // A terminal that does not tell its width is taken to be wide.
    let columns = terminal::columns(std::io::stdout()).filter(|_| screen);
    let form = columns.map_or(Form::Wide, Form::fitting);
    if !args.json {
        let info = client.info().map_err(orders::remedied)?;
        say!(
            "{} {}{}{} on {} at {} Hz; Ctrl-C ends",
            show::live_or_simulated(&info),
            style::NAME,
            foreign(&hello.rig),
            style::OFF,
            args.address.server,
            hello.rate_hz
        )?;
        say!("{}{LEGEND}{}", style::DIM, style::OFF)?;
        print(&fitted(&form.header(), columns, true), screen, screen)?;
        if screen {
            say!("")?;
        }
    }
    // A program that reads the rows ends `watch` by a signal, and nothing is added then.
    let stop = if screen { signals::stop_flag()? } else { StopFlag::default() };
    let mut largest: f64 = 0.0;
    let begun = Instant::now();
    let silent_after = silent_after(every, hello.rate_hz);
    let mut newest = Instant::now();
    let mut told = false;
    while !stop.is_set() {
        let wait = if told { silent_after } else { silent_after.saturating_sub(newest.elapsed()) };
        let event = match client.next_event(wait.min(ATTENTIVE)) {
            Ok(event) => event,
            Err(error) => {
                if !args.json {
                    summary(begun, largest)?;
                }
                return Err(error.into());
            }
        };
        if matches!(event, Some(Event::State(_))) {
            newest = Instant::now();
            told = false;
        } else if !told && newest.elapsed() >= silent_after {
            told = true;
            if screen {
                raw(|out| out.write_all(style::CLEAR_LINE.as_bytes()))?;
            }
            note!("no state for {} s: what the rig does is not known", silent_after.as_secs());
        }
        let Some(event) = event else { continue };
        let line = match &event {
            Event::State(state) if args.json => serde_json::to_string(state)?,
            Event::State(state) => {
                largest = largest.max(length(state.torque));
                form.row(state)
            }
            Event::Stopping(_) => {
                if screen {
                    raw(|out| out.write_all(style::CLEAR_LINE.as_bytes()))?;
                }
                note!("the server stops");
                if !args.json {
                    summary(begun, largest)?;
                }
                return Ok(ExitCode::SUCCESS);
            }
            Event::Fault(fault) if !args.json => {
                let name = fault.fault.map_or_else(|| fault.mode.to_string(), |cause| cause.to_string());
                let remedy = fault.remedy.iter().map(|remedy| format!(" {}", foreign(remedy)));
                let more = match fault.mode {
                    Mode::Fault | Mode::Estop => {
                        let log =
                            fault.flight_log.iter().map(|path| format!(" Flight log: {}", foreign(path)));
                        let told: String = remedy.collect();
                        format!(".{told} To go on: reset, then enable.{}", log.collect::<String>())
                    }
                    _ => String::new(),
                };
                format!(
                    "{}  {}{name}{}: {}{more}",
                    time_of_day(SystemTime::now()),
                    style::of_mode(fault.mode.as_str()),
                    style::OFF,
                    foreign(&fault.message)
                )
            }
            Event::Scene(scene) if !args.json => {
                format!("{}  scene: {}", time_of_day(SystemTime::now()), foreign(&scene.name))
            }
            Event::Set(set) if !args.json => {
                let values = set.parameters.iter().map(|(name, value)| format!("{name} = {value}"));
                let values = values.collect::<Vec<_>>().join(", ");
                format!("{}  {}: {}", time_of_day(SystemTime::now()), foreign(&set.effect), foreign(&values))
            }
            Event::Dropped(dropped) if !args.json => {
                format!("{} samples lost: reading too slowly", dropped.count)
            }
            _ => continue,
        };
        let state = matches!(event, Event::State(_));
        if print(&fitted(&line, columns, state), screen, screen && state)? == Reader::Gone {
            return Ok(ExitCode::SUCCESS);
        }
    }
    summary(begun, largest)?;
    Ok(ExitCode::SUCCESS)
}

/// Prints the largest length of the torque since `begun`, N m.
fn summary(begun: Instant, largest: f64) -> anyhow::Result<()> {
    say!("\nthe largest length in {:.1} s was {largest:.3} N m", begun.elapsed().as_secs_f64())
}

/// Returns the time without a state after which the user is told: [`SILENT_AFTER`], or longer if
/// every `every`th tick of a loop at `rate_hz` is rarer than that.
fn silent_after(every: u64, rate_hz: f64) -> Duration {
    let two_states = Duration::try_from_secs_f64((2.0 * every as f64 / rate_hz).ceil());
    two_states.map_or(SILENT_AFTER, |two| two.max(SILENT_AFTER))
}

/// Returns the length of a vector.
fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Returns a line that fits a terminal of `columns` columns: a row is cut, other text is wrapped.
fn fitted(line: &str, columns: Option<usize>, row: bool) -> String {
    match columns {
        Some(columns) if row => terminal::cut(line, columns),
        Some(columns) => terminal::wrapped(line, columns),
        None => line.to_owned(),
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

/// Width of a row with all components of all vectors, columns.
const WIDE: usize = 128;

/// What the columns mean whose headers do not say it, for the first lines of the output. It fits 80
/// columns.
const LEGEND: &str = "scale: part of the wanted torque that is applied; late: how late the tick began";

/// What the columns mean, for the help.
const COLUMNS: &str = "\
Columns:
  t s          time since the start of the loop, s
  mode         mode of the rig, or its fault
  orientation  of the sphere in frame N, a quaternion; in a terminal of fewer
               than 128 columns `deg`, its angle in degrees
  torque N m   torque on the sphere about n1 n2 n3, and its length
  rate rad/s   angular velocity of the sphere about n1 n2 n3; in a terminal of
               fewer than 128 columns its length
  scale        part of the wanted torque that is applied after all limits
  late us      time from the deadline of the tick to its start, microseconds";

/// Which columns a row has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    /// The components of the vectors, as [`WIDE`] columns.
    Wide,
    /// The components of the torque, and the lengths of the other vectors, within 80
    /// columns.
    Narrow,
}

impl Form {
    fn fitting(columns: usize) -> Self {
        if columns < WIDE { Self::Narrow } else { Self::Wide }
    }

    fn header(self) -> String {
        let (dim, off) = (style::DIM, style::OFF);
        match self {
            Self::Wide => format!(
                "{dim}{:>8}  {:12} {:^31}  {:^23} {:>7}  {:^23}  {:>5} {:>8}{off}",
                "t s",
                "mode",
                "orientation w x y z",
                "torque N m",
                "length",
                "rate rad/s",
                "scale",
                "late us",
            ),
            Self::Narrow => format!(
                "{dim}{:>8}  {:12} {:>6} {:^21} {:>6} {:>7} {:>5} {:>7}{off}",
                "t s", "mode", "deg", "torque N m n1 n2 n3", "length", "rad/s", "scale", "late us",
            ),
        }
    }

    fn row(self, s: &StateEvent) -> String {
        let mode = s.fault.map_or_else(|| s.mode.to_string(), |fault| fault.to_string());
        let mode = format!("{}{mode:12}{}", style::of_mode(s.mode.as_str()), style::OFF);
        let (t, scale, late) = (s.t, s.scale, s.timing.lateness_us);
        let [w, x, y, z] = s.q;
        let ([o1, o2, o3], [t1, t2, t3]) = (s.omega, s.torque);
        let torque = length(s.torque);
        match self {
            Self::Wide => format!(
                "{t:8.2}  {mode} {w:7.4} {x:7.4} {y:7.4} {z:7.4}  {t1:7.4} {t2:7.4} {t3:7.4} {torque:7.4}  {o1:7.3} {o2:7.3} {o3:7.3}  \
                 {scale:5.2} {late:8.1}"
            ),
            Self::Narrow => {
                let turned = (2.0 * length([x, y, z]).atan2(w.abs())).to_degrees();
                format!(
                    "{t:8.2}  {mode} {turned:6.1} {t1:6.3} {t2:6.3} {t3:6.3}  {torque:6.3} {:7.3} {scale:5.2} {late:7.0}",
                    length(s.omega)
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The text without the codes of colours.
    fn plain(text: &str) -> String {
        anstream::adapter::strip_str(text).to_string()
    }

    #[test]
    fn a_silence_is_longer_than_the_time_between_two_states() {
        assert_eq!(silent_after(100, 1000.0), SILENT_AFTER);
        assert_eq!(silent_after(1, 0.0), SILENT_AFTER, "a server with a wrong rate");
        assert_eq!(silent_after(5250, 1000.0), Duration::from_secs(11));
    }

    #[test]
    fn a_row_fits_the_terminal_and_stands_under_its_header() {
        assert_eq!((Form::fitting(80), Form::fitting(WIDE)), (Form::Narrow, Form::Wide));
        let [wide, narrow] = [Form::Wide, Form::Narrow].map(|form| plain(&form.header()).chars().count());
        assert_eq!(wide, WIDE);
        assert_eq!(narrow, 80);
        assert!(LEGEND.chars().count() <= 80);
    }

    #[test]
    fn a_row_of_80_columns_has_the_three_torques_under_their_header() {
        let state = StateEvent { torque: [0.3, 0.0, -0.4], ..StateEvent::default() };
        let [header, row] = [Form::Narrow.header(), Form::Narrow.row(&state)].map(|line| plain(&line));
        assert_eq!(row.chars().count(), 80);
        let at = header.find("length").expect("a column") + "length".len();
        assert!(row[..at].ends_with(" 0.300  0.000 -0.400   0.500"), "{header}\n{row}");
        assert!(header.contains("n1 n2 n3"), "{header}");
    }

    #[test]
    fn a_wide_row_ends_each_column_under_its_header_and_has_the_length_of_the_torque() {
        let state = StateEvent { torque: [0.3, 0.0, -0.4], ..StateEvent::default() };
        let [header, row] = [Form::Wide.header(), Form::Wide.row(&state)].map(|line| plain(&line));
        assert_eq!(row.chars().count(), WIDE);
        let at = header.find("length").expect("a column") + "length".len();
        assert!(row[..at].ends_with(" 0.3000  0.0000 -0.4000  0.5000"), "{header}\n{row}");
    }
}
