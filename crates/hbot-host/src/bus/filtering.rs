//! How late a motor controller's torque and rates are, as its own settings say, and whether the rig
//! file promises more.

use hbot_config::RigConfig;
use hbot_core::design::rig::RateEstimate;

use super::{Expected, field};

/// Largest excess of a lag over the rig file's that is not reported, as a fraction. A rig file has
/// few digits: 0.8 ms for the 0.796 ms of 200 Hz.
const ROUNDED: f64 = 0.05;
/// Ratio of a lag to the rig file's below which the rig file is worth a change.
const SHORTER: f64 = 0.5;

/// A delay that a setting of a motor controller causes.
#[derive(Debug, Clone, PartialEq)]
pub struct Lag {
    /// Name of the setting, as the vendor's tools have it.
    pub setting: String,
    /// Value of the setting, Hz.
    pub hz: f64,
    /// The delay in a slow motion, s.
    pub seconds: f64,
}

/// The delays that the settings of a motor controller cause. A delay is `None` if the controller
/// does not say its setting.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Filtering {
    /// Time constant with which the torque follows a command.
    pub torque: Option<Lag>,
    /// Delay of the reported rate behind the true rate.
    pub rate: Option<Lag>,
}

impl Filtering {
    /// Returns a sentence for each delay that is longer than the rig file of `config` says.
    #[must_use]
    pub fn warnings(&self, config: &RigConfig) -> Vec<String> {
        let longer = self.delays(config).filter(|(lag, .., ours)| lag.seconds > ours * (1.0 + ROUNDED));
        let warning = |(Lag { setting, hz, seconds }, what, key, ours): (&Lag, _, _, _)| {
            format!(
                "{setting} = {hz:.0} Hz in the controller, so {what} is {:.1} ms late and not {:.1} ms as in the rig \
                 file, which promises stiffer springs than are stable: write {key} = {seconds:.4}, or calibrate the \
                 motor with a higher bandwidth (docs/controllers.md)",
                1e3 * seconds,
                1e3 * ours
            )
        };
        longer.map(warning).collect()
    }

    /// Returns a sentence for each delay that is much shorter than the rig file of `config` says.
    #[must_use]
    pub fn advice(&self, config: &RigConfig) -> Vec<String> {
        let shorter = self.delays(config).filter(|(lag, .., ours)| lag.seconds < SHORTER * ours);
        let advice = |(Lag { setting, hz, seconds }, what, key, ours): (&Lag, _, _, _)| {
            format!(
                "{setting} = {hz:.0} Hz in the controller, so {what} is only {:.2} ms late and not {:.1} ms as in the \
                 rig file: write {key} = {seconds:.5}, and stiffer springs are stable",
                1e3 * seconds,
                1e3 * ours
            )
        };
        shorter.map(advice).collect()
    }

    /// Returns each delay, what is late, its key in a rig file, and what that of `config` says (s).
    fn delays(&self, config: &RigConfig) -> impl Iterator<Item = (&Lag, &str, &str, f64)> {
        let all = [
            (&self.torque, "the torque", "torque_lag", config.torque_lag),
            (&self.rate, "the reported rate", "rate_lag", config.rate_lag),
        ];
        all.into_iter().filter_map(|(lag, what, key, ours)| Some((lag.as_ref()?, what, key, ours)))
    }
}

/// Returns the warnings about the controllers on one line, which have been met.
#[must_use]
pub fn filtering_warnings(config: &RigConfig, expected: &Expected) -> Vec<String> {
    let one = |at| Some((field(expected.joint(at)?.number), expected.filtering(at).warnings(config)));
    each_once((0..expected.joints()).filter_map(one))
}

/// Returns each warning once, with the names of all that it is about in front.
pub fn each_once(warnings: impl Iterator<Item = (String, Vec<String>)>) -> Vec<String> {
    let mut all: Vec<(String, String)> = Vec::new();
    for (name, warnings) in warnings {
        for warning in warnings {
            match all.iter_mut().find(|(_, other)| *other == warning) {
                Some((names, _)) => *names = format!("{names}, {name}"),
                None => all.push((name.clone(), warning)),
            }
        }
    }
    all.into_iter().map(|(names, warning)| format!("{names}: {warning}")).collect()
}

/// Returns the advice to compute the rates from the positions, if the rates that the controllers
/// report are more than one tick late. The difference of two readings is half a tick late, and
/// positions have no delay in slow motion, although they pass the same filter.
#[must_use]
pub fn late_rates(config: &RigConfig) -> Option<String> {
    let period = config.rig.timing.period_s();
    let late = config.rig.methods.rate == RateEstimate::Controller && config.rate_lag > period;
    late.then(|| {
        format!(
            "the rates of the controllers are {:.1} ms late (rate_lag), more than a tick of {:.1} ms; \
             loop.rate_estimate = \"kalman\" computes them from the positions, and stiffer springs are stable",
            1e3 * config.rate_lag,
            1e3 * period
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(lines: &str) -> RigConfig {
        let text = include_str!("../../../../rigs/prototype-moteus.toml");
        let text = text.replace("rate_lag = 0.0039 ", &format!("{lines} #"));
        let text = text.replace("rate_estimate = \"auto\"", "rate_estimate = \"controller\"");
        RigConfig::from_toml(&text, "x.toml").unwrap_or_else(|e| panic!("{e}"))
    }

    fn of(torque_hz: f64, rate_hz: f64) -> Filtering {
        let lag = |setting: &str, hz: f64, seconds| Some(Lag { setting: setting.to_owned(), hz, seconds });
        Filtering {
            torque: lag("t", torque_hz, 1.0 / (std::f64::consts::TAU * torque_hz)),
            rate: lag("r", rate_hz, 0.789_409 / rate_hz),
        }
    }

    #[test]
    fn a_rig_file_that_promises_more_than_the_settings_is_warned_of() {
        let rig = config("rate_lag = 0.0039");
        assert_eq!(of(200.0, 200.0).warnings(&rig), Vec::<String>::new());
        assert_eq!(of(1000.0, 1000.0).warnings(&rig), Vec::<String>::new());
        assert_eq!(of(200.0, 200.0).advice(&rig), Vec::<String>::new());
        let advice = of(1000.0, 1000.0).advice(&rig);
        assert!(
            advice[0].contains("0.16 ms late and not 0.8 ms") && advice[0].contains("torque_lag = 0.00016")
        );
        assert!(advice[1].contains("write rate_lag = 0.00079, and stiffer springs are stable"), "{advice:?}");
        assert_eq!(Filtering::default().warnings(&rig), Vec::<String>::new());
        let said = of(100.0, 150.0).warnings(&rig);
        assert_eq!(said.len(), 2, "{said:?}");
        for (words, said) in [
            ("t = 100 Hz in the controller, so the torque is 1.6 ms late and not 0.8 ms", &said[0]),
            ("write torque_lag = 0.0016", &said[0]),
            ("r = 150 Hz in the controller, so the reported rate is 5.3 ms late and not 3.9 ms", &said[1]),
            ("write rate_lag = 0.0053", &said[1]),
        ] {
            assert!(said.contains(words), "{words}: {said}");
        }
    }

    #[test]
    fn one_warning_about_several_joints_is_there_once_with_their_names() {
        let of = |name: &str, all: &[&str]| (name.to_owned(), all.iter().map(|&it| it.to_owned()).collect());
        let said = each_once([of("a", &["late"]), of("b", &["late", "hot"]), of("c", &["late"])].into_iter());
        assert_eq!(said, ["a, b, c: late", "b: hot"]);
    }

    #[test]
    fn kalman_is_offered_where_the_rates_are_the_latest_part_of_the_loop() {
        let advice = late_rates(&config("rate_lag = 0.0039")).expect("later than 1 ms");
        assert!(advice.contains("3.9 ms late (rate_lag), more than a tick of 1.0 ms"), "{advice}");
        assert!(advice.contains("loop.rate_estimate = \"kalman\""), "{advice}");
        assert_eq!(late_rates(&config("rate_lag = 0.0009")), None);
        let mut rig = config("rate_lag = 0.0039");
        rig.rig = rig.rig.with(|parts| parts.methods.rate = RateEstimate::Difference).expect("legal");
        assert_eq!(late_rates(&rig), None, "its rates are not those of the controllers");
        assert_eq!(late_rates(&RigConfig::prototype()), None);
    }
}
