//! Numbers on the command line. Errors about them have the words of errors about keys of files.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Returns a parser of whole numbers in a range. The bounds name the type: clap checks it only when
/// the command line is parsed.
pub(crate) fn whole<T>(
    legal: RangeInclusive<T>,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static
where
    T: FromStr + PartialOrd + Display + Clone + Send + Sync + 'static,
{
    move |text| {
        let number = text.parse().ok().filter(|number| legal.contains(number));
        number
            .ok_or_else(|| refused(text, "a whole number", &format!("{} to {}", legal.start(), legal.end())))
    }
}

/// Parses a rate of the loop, Hz. The range is that of `loop.rate_hz` in rig files.
pub(crate) fn rate(text: &str) -> Result<u32, String> {
    whole(50..=20_000)(text).map_err(|why| format!("{why} Hz"))
}

/// Parses the number of a processor. The range is that of `loop.cpu` in rig files.
pub(crate) fn processor(text: &str) -> Result<u32, String> {
    whole(0..=1023)(text)
}

/// Returns a parser of numbers in a range, with or without the unit. `legal` describes the range.
pub(crate) fn real(
    unit: &'static str,
    is_legal: fn(f64) -> bool,
    legal: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| {
        let number = text.strip_suffix(unit).unwrap_or(text).trim();
        let parsed = number.parse().ok().filter(|&number: &f64| number.is_finite() && is_legal(number));
        let is_number = number.parse::<f64>().is_ok_and(f64::is_finite);
        // What is no number is quoted as it was typed.
        let wrong = if is_number { number } else { text };
        parsed.ok_or_else(|| refused(wrong, REAL, format!("{legal} {unit}").trim_end()))
    }
}

/// Returns a parser of numbers above 0.
pub(crate) fn positive(
    unit: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    real(unit, |number| number > 0.0, "above 0")
}

/// Parses a time above 0. Returns it in s.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    const TIMES: &str = "above 0 and at most 1e9 s, or with the unit min or h";
    let units = [("min", 60.0), ("h", 3600.0), ("s", 1.0)];
    let scaled = units.into_iter().find_map(|(unit, factor)| Some((text.strip_suffix(unit)?.trim(), factor)));
    let (number, factor) = scaled.unwrap_or((text, 1.0));
    match number.parse::<f64>().ok().filter(|number| number.is_finite()).map(|number| number * factor) {
        Some(s) if s > 0.0 && s <= 1.0e9 => Ok(s),
        Some(_) => Err(format!("{text} is out of range; {LEGAL}{TIMES}")),
        None => Err(format!("{text:?} is not {REAL}; {LEGAL}{TIMES}")),
    }
}

/// Returns the error about an argument that is not `wanted` or not in the range `legal`.
fn refused(text: &str, wanted: &str, legal: &str) -> String {
    let is_whole = text.parse::<i128>().is_ok();
    if is_whole || wanted == REAL && text.parse::<f64>().is_ok_and(f64::is_finite) {
        format!("{text} is out of range; {LEGAL}{legal}")
    } else {
        format!("{text:?} is not {wanted}; {LEGAL}{legal}")
    }
}

/// What a number is called that need not be whole.
const REAL: &str = "a number";
/// What begins the legal values in an error.
pub(crate) const LEGAL: &str = "legal: ";

#[cfg(test)]
mod tests {
    use hbot_config::{Override, RigConfig};

    use super::*;

    #[test]
    fn a_number_is_refused_in_the_words_of_the_files() {
        let every = whole(1..=1_000_000_u64);
        assert_eq!(every("7"), Ok(7));
        assert_eq!(every("0").unwrap_err(), "0 is out of range; legal: 1 to 1000000");
        assert_eq!(every("x").unwrap_err(), "\"x\" is not a whole number; legal: 1 to 1000000");
        assert_eq!(every("2.5").unwrap_err(), "\"2.5\" is not a whole number; legal: 1 to 1000000");
        for (text, s) in [("2.5s", 2.5), ("5min", 300.0), ("5 min", 300.0), ("2h", 7200.0)] {
            assert_eq!(seconds(text), Ok(s), "{text}");
        }
        let legal = "legal: above 0 and at most 1e9 s, or with the unit min or h";
        assert_eq!(seconds("-1").unwrap_err(), format!("-1 is out of range; {legal}"));
        assert_eq!(seconds("5m").unwrap_err(), format!("\"5m\" is not a number; {legal}"));
        assert_eq!(seconds("0min").unwrap_err(), format!("0min is out of range; {legal}"));
        assert_eq!(positive("rad")("1mrad").unwrap_err(), "\"1mrad\" is not a number; legal: above 0 rad");
        assert_eq!(positive("m")("nan").unwrap_err(), "\"nan\" is not a number; legal: above 0 m");
        assert_eq!(rate("1k").unwrap_err(), "\"1k\" is not a whole number; legal: 50 to 20000 Hz");
    }

    #[test]
    fn rates_and_processors_have_the_ranges_of_the_rig_file() {
        let legal = |path: &'static str, value: u32| {
            let over = Override { path, value: value.into(), from: "a test" };
            // A bound can be wrong for another reason, such as a line that is too slow.
            RigConfig::load(None, &[over]).err().is_none_or(|error| {
                let error = format!("{:#}", anyhow::Error::from(error));
                !error.contains("is out of range")
            })
        };
        for hz in [49, 50, 20_000, 20_001] {
            assert_eq!(rate(&hz.to_string()).is_ok(), legal("loop.rate_hz", hz), "{hz}");
        }
        for cpu in [0, 1023, 1024] {
            assert_eq!(processor(&cpu.to_string()).is_ok(), legal("loop.cpu", cpu), "{cpu}");
        }
    }
}
