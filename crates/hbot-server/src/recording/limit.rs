//! The size or duration after which a recording continues in a new file.

use std::str::FromStr;
use std::time::Duration;

/// The size or duration after which a recording continues in a new file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limit {
    /// Size of the file, bytes.
    Size(u64),
    /// Duration of the recorded run in the file.
    Time(Duration),
}

/// The units of a limit: their names, and whether they are bytes or seconds.
const UNITS: [(&str, bool, u64); 6] = [
    ("kB", true, 1_000),
    ("MB", true, 1_000_000),
    ("GB", true, 1_000_000_000),
    ("min", false, 60),
    ("h", false, 3600),
    ("s", false, 1),
];

impl FromStr for Limit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || "a size or a time, such as 500MB or 10min; units: kB, MB, GB, s, min, h".to_owned();
        let number = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
        let named = &text[number.len()..];
        let (_, is_size, factor) = UNITS.into_iter().find(|(unit, ..)| *unit == named).ok_or_else(wrong)?;
        let number: u64 = number.trim().parse().map_err(|_| wrong())?;
        let amount = number.checked_mul(factor).filter(|n| *n > 0).ok_or_else(wrong)?;
        Ok(if is_size { Self::Size(amount) } else { Self::Time(Duration::from_secs(amount)) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_sizes_or_times() {
        assert_eq!("500MB".parse(), Ok(Limit::Size(500_000_000)));
        assert_eq!("10min".parse(), Ok(Limit::Time(Duration::from_secs(600))));
        assert_eq!("90 s".parse(), Ok(Limit::Time(Duration::from_secs(90))));
        for wrong in ["", "12", "MB", "0s", "-1h", "5 parsecs", "99999999999999999999GB"] {
            assert!(wrong.parse::<Limit>().is_err(), "{wrong}");
        }
    }
}
