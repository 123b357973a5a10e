//! The file names of flight logs.

use std::fmt;

use hbot_api::{Fault, Mode};

/// Pattern of the time in the file name of a flight log. Each 0 stands for any digit.
const TIME: &str = "00000000T000000.000Z";

/// The file name of a flight log, such as `flight-20260131T235959.123Z-4711-001-thermal.csv`. The
/// extension is `.part` while the file is being written.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Name {
    /// Time of the fault in UTC, in a format whose alphabetical order is the order of time.
    pub time: String,
    /// Number of the process that writes the log, so that two servers with a fault in the same
    /// millisecond do not write the same file.
    pub process: u32,
    /// Number of the log within its process, from 1, modulo 1000. It is always written with three
    /// digits.
    pub number: u16,
    /// Name of the fault, or `estop` for an emergency stop.
    pub what: String,
    /// Whether the file is still being written.
    pub part: bool,
}

impl Name {
    /// Creates the name of the log with this number, counted from 1.
    #[must_use]
    pub fn new(time: &str, process: u32, number: u64, what: &str) -> Self {
        let number = (number % 1000) as u16;
        Self { time: time.to_owned(), process, number, what: what.to_owned(), part: false }
    }

    /// Parses the file name of a flight log. Returns `None` for a name that this program does not
    /// write.
    #[must_use]
    pub fn parse(name: &str) -> Option<Self> {
        let (rest, extension) = name.strip_prefix("flight-")?.rsplit_once('.')?;
        let mut fields = rest.split('-');
        let (time, process) = (fields.next()?, fields.next()?.parse().ok()?);
        let (number, what) = (fields.next()?.parse().ok()?, fields.next()?);
        let part = extension == "part";
        let read = Self { time: time.to_owned(), process, number, what: what.to_owned(), part };
        let like = |(a, b): (u8, u8)| if b == b'0' { a.is_ascii_digit() } else { a == b };
        let is_time = time.len() == TIME.len() && time.bytes().zip(TIME.bytes()).all(like);
        let known = what == Mode::Estop.as_str() || what.parse::<Fault>().is_ok();
        // Writing the name again and comparing detects leading zeros, signs and extra fields.
        (is_time && known && read.to_string() == name).then_some(read)
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { time, process, number, what, part } = self;
        write!(f, "flight-{time}-{process}-{number:03}-{what}.{}", if *part { "part" } else { "csv" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_that_this_program_writes_are_read() {
        for name in [
            "flight-20260131T235959.123Z-4711-001-thermal.csv",
            "flight-20260131T235959.123Z-1-999-estop.csv",
            "flight-20260131T235959.123Z-1-000-link_lost.part",
        ] {
            assert_eq!(Name::parse(name).map(|name| name.to_string()).as_deref(), Some(name));
        }
        for name in [
            "flight-plan.csv",
            "flight-2026.csv",
            "flight-20260131T235959.123Z-4711-001-thermal.csv.bak",
            "flight-20260131T235959.123Z-4711-001-thermal.txt",
            "flight-20260131T235959.123Z-4711-001-thermal-2.csv",
            "flight-20260131T235959.123Z-4711-001-holiday.csv",
            "flight-20260131T235959.123Z-4711-1-thermal.csv",
            "flight-20260131T235959.123Z-+4711-001-thermal.csv",
            "flight-20260131T235959.123Z-001-thermal.csv",
            "flight-20260131T235959.1234-4711-001-thermal.csv",
            "my-flight-20260131T235959.123Z-4711-001-thermal.csv",
        ] {
            assert_eq!(Name::parse(name), None, "{name}");
        }
    }
}
