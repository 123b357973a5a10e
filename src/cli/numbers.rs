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
        let range = format!("{LEGAL}{} to {}", legal.start(), legal.end());
        match text.parse() {
            Ok(number) if legal.contains(&number) => Ok(number),
            _ if text.parse::<i128>().is_ok() => Err(format!("{text} is out of range; {range}")),
            _ => Err(format!("{text:?} is not a whole number; {range}")),
        }
    }
}

/// Returns a parser of whole seconds in a range.
pub(crate) fn whole_seconds(
    legal: RangeInclusive<u32>,
) -> impl Fn(&str) -> Result<u32, String> + Clone + Send + Sync + 'static {
    move |text| whole(legal.clone())(text.trim_end_matches('s').trim_end())
}

/// Parses a rate of the loop, Hz. The range is that of `loop.rate_hz` in rig files.
pub(crate) fn rate(text: &str) -> Result<u32, String> {
    whole(50..=20_000)(text.trim_end_matches("Hz").trim_end()).map_err(|why| format!("{why} Hz"))
}

/// Parses the number of a processor. The range is that of `loop.cpu` in rig files.
pub(crate) fn processor(text: &str) -> Result<u32, String> {
    whole(0..=1023)(text)
}

/// Returns a parser of numbers in a range, without a unit or with one of its kind. `legal`
/// describes the range.
pub(crate) fn real(
    unit: &'static str,
    is_legal: fn(f64) -> bool,
    legal: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| {
        // `ms` before `s`.
        let units = others(unit).iter().copied().chain([(unit, 1.0)]);
        let scaled = units.into_iter().find_map(|(unit, factor)| Some((text.strip_suffix(unit)?, factor)));
        let (number, factor) = scaled.unwrap_or((text, 1.0));
        let others: Vec<_> = others(unit).iter().map(|(unit, _)| *unit).collect();
        let others = if others.is_empty() {
            String::new()
        } else {
            format!(", or with the unit {}", others.join(", "))
        };
        let legal = format!("{LEGAL}{}{others}", format!("{legal} {unit}").trim_end());
        match number.trim().parse::<f64>().ok().filter(|number| number.is_finite()) {
            Some(number) if is_legal(number * factor) => Ok(number * factor),
            Some(_) => Err(format!("{text} is out of range; {legal}")),
            None => Err(format!("{text:?} is not a number; {legal}")),
        }
    }
}

/// Returns the other units of the same kind, and how many `unit` one of each is.
fn others(unit: &str) -> &'static [(&'static str, f64)] {
    match unit {
        "s" => &[("ms", 1.0e-3), ("min", 60.0), ("h", 3600.0)],
        "rad" => &[("deg", std::f64::consts::PI / 180.0)],
        "deg" => &[("\u{b0}", 1.0), ("rad", 180.0 / std::f64::consts::PI)],
        _ => &[],
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
    real("s", |s| s > 0.0 && s <= 1.0e9, "above 0 and at most 1e9")(text)
}

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
        for (text, s) in [("2.5s", 2.5), ("5min", 300.0), ("5 min", 300.0), ("2h", 7200.0), ("500ms", 0.5)] {
            assert_eq!(seconds(text), Ok(s), "{text}");
        }
        let legal = "legal: above 0 and at most 1e9 s, or with the unit ms, min, h";
        assert_eq!(seconds("-1").unwrap_err(), format!("-1 is out of range; {legal}"));
        assert_eq!(seconds("5m").unwrap_err(), format!("\"5m\" is not a number; {legal}"));
        assert_eq!(seconds("0min").unwrap_err(), format!("0min is out of range; {legal}"));
        assert_eq!(
            positive("rad")("1mrad").unwrap_err(),
            "\"1mrad\" is not a number; legal: above 0 rad, or with the unit deg"
        );
        assert_eq!(positive("rad")("180deg"), Ok(std::f64::consts::PI));
        assert_eq!(rate("1000 Hz"), Ok(1000));
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
