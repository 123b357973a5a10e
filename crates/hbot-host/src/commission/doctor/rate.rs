//! The highest rate that a machine and the rig's serial lines hold together, and what it buys.

use hbot_config::RigConfig;
use hbot_config::advice::{StiffnessBound, USUAL_DAMPING};
use hbot_config::rig::Port;

use super::{Finding, Mark, Punctuality};
use crate::bus::{Traffic, driver};

/// Largest share of the capacity of a line or bus that the loop's traffic can use.
pub const MOST_LOAD: f64 = 0.9;

/// Highest rate of a loop, Hz: the most that a rig file allows.
const MOST_HZ: f64 = 20_000.0;

/// Returns the highest rate at which a line carries one command and one reading per tick, Hz.
#[must_use]
pub fn line_rate(traffic: &Traffic, baud: u32) -> f64 {
    if let Some(bus) = &traffic.bus {
        return MOST_LOAD * 1.0e9 / bus.most_ns as f64;
    }
    /// Bits on the line for one byte: one start bit, eight data bits and one stop bit.
    const BITS_A_BYTE: f64 = 10.0;
    let time = |bytes: usize| bytes as f64 * BITS_A_BYTE / f64::from(baud);
    // The controllers' own processing time lies between a command and its answer.
    let feedback = time(traffic.feedback) + f64::from(traffic.turnaround_us) * 1.0e-6;
    MOST_LOAD / time(traffic.commands).max(feedback)
}

/// Returns the name of each line of a rig, and the number of joints on it. A simulated rig has the
/// lines that its joints name by `port`.
#[must_use]
pub fn lines(config: &RigConfig) -> Vec<(String, usize)> {
    let names = match &config.link.port {
        Port::Devices(devices) => devices.clone(),
        port => {
            let last = config.ports.iter().copied().max().unwrap_or(0);
            vec![port.to_string(); last + 1]
        }
    };
    let joints = |line| config.ports.iter().filter(|port| **port == line).count();
    names.into_iter().enumerate().map(|(line, name)| (name, joints(line))).collect()
}

/// Returns the highest rate of the slowest line of a rig, Hz, with the name of the line. For a
/// simulated rig it is that of real lines.
fn slowest_line(config: &RigConfig) -> (String, f64) {
    let rate = |joints| line_rate(&driver(config.link.protocol).traffic(joints), config.link.baud);
    let rates = lines(config).into_iter().map(|(name, joints)| (name, rate(joints)));
    // A rig has one line at least.
    rates.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default()
}

/// Returns the highest rate at which this machine is punctual, Hz. At that rate at most one tick in
/// 100 is late, as for the mark `Usable`. How late the machine wakes a thread hardly depends on the
/// rate.
#[must_use]
pub fn machine_rate(measured: &Punctuality) -> f64 {
    0.25e6 / measured.p99_us
}

/// Finds the highest rate that the machine and the lines of the rig hold together, and says how
/// stiff a spring can be at this rate.
#[must_use]
pub fn highest_rate(config: &RigConfig, measured: &Punctuality) -> Finding {
    let machine = machine_rate(measured);
    let (name, line) = slowest_line(config);
    let simulated = config.link.port.is_simulated();
    let limit = if simulated { f64::INFINITY } else { line };
    let together = limit.min(machine).min(MOST_HZ);
    // The machine's rate is measured and varies, that of a line is computed: `hbot rig check` and
    // `hbot rig new` say the same number.
    let rate = limit.floor().min(rounded(machine.min(MOST_HZ)));
    let lines = if simulated {
        format!("a simulated line has no limit (a real one: {:.0} Hz)", line.floor())
    } else {
        format!("{name} up to {:.0} Hz", line.floor())
    };
    let mut found = format!(
        "this machine holds up to {:.0} Hz with at most one late tick in 100, {lines}: together {rate:.0} Hz",
        rounded(machine.min(MOST_HZ))
    );
    if let Some(bound) = StiffnessBound::of(config) {
        let at = |hz: f64| bound.at_rate(hz).stable(USUAL_DAMPING);
        let now = f64::from(config.rate_hz);
        let is_stiffer = rate == now || at(rate.max(now)) > at(rate.min(now));
        let stiffer = if is_stiffer { ", so a faster loop makes stiffer springs" } else { "" };
        found += &format!(
            ". The torque is one period old{stiffer}: with a damping of {USUAL_DAMPING} N m s/rad and motors that follow in {:.1} ms a spring is stable in small motions up to {:.1} N m/rad at {now:.0} Hz",
            1.0e3 * bound.sampled().lag,
            at(now)
        );
        if rate != now {
            found += &format!(" and {:.1} at {rate:.0} Hz", at(rate));
        }
    }
    if f64::from(config.rate_hz) <= together {
        return Finding::new("rate", Mark::Good, found, "");
    }
    let mend = format!("rate_hz = {rate:.0} in the rig file's [loop], or a faster line, or a calmer machine");
    Finding::new("rate", Mark::Usable, found, &mend)
}

/// Rounds a rate down to two digits, so that it is easy to write into a rig file.
fn rounded(rate: f64) -> f64 {
    let step = 10_f64.powf(rate.max(10.0).log10().floor() - 1.0);
    (rate / step).floor() * step
}

#[cfg(test)]
mod tests {
    use hbot_config::Override;

    use super::*;

    fn measured(p99_us: f64) -> Punctuality {
        Punctuality {
            rate_hz: 1000,
            real_time: true,
            ticks: 10_000,
            p50_us: 5.0,
            p99_us,
            p99_9_us: p99_us,
            p99_99_us: p99_us,
            max_us: p99_us,
            late: 0,
            skipped: 0,
        }
    }

    fn on(port: &str, baud: u32) -> RigConfig {
        let over = |path, value| Override { path, value, from: "a test" };
        // The check below is that of a law without the lead.
        let set =
            [over("link.port", port.into()), over("link.baud", baud.into()), over("loop.lead", false.into())];
        RigConfig::load(None, &set).expect("legal")
    }

    #[test]
    fn the_slower_of_machine_and_line_limits_the_rate() {
        let said = |port, baud, p99_us| highest_rate(&on(port, baud), &measured(p99_us));
        // 0.25 ms / 100 us = 2500 Hz.
        let by_machine = said("sim", 3_000_000, 100.0);
        assert!(by_machine.found.contains("up to 2500 Hz"), "{}", by_machine.found);
        assert!(by_machine.found.contains("together 2500 Hz"), "{}", by_machine.found);
        assert!(by_machine.found.contains("no limit (a real one: "), "{}", by_machine.found);
        // To first order damping/(1.5 h + lag): 0.02/(1.5 ms + 0.5 ms) = 10, and 0.02/(0.6 ms + 0.5
        // ms) = 18.2. The exact border is 0.4 % lower.
        assert!(
            by_machine.found.contains("10.0 N m/rad at 1000 Hz and 18.1 at 2500 Hz"),
            "{}",
            by_machine.found
        );
        assert_eq!(by_machine.mark, Mark::Good);
        let traffic = driver(on("sim", 115_200).link.protocol).traffic(4);
        let most = MOST_LOAD * 11_520.0 / traffic.commands.max(traffic.feedback) as f64;
        assert!((line_rate(&traffic, 115_200) - most).abs() < 1.0e-9 * most);
        let by_line = said("/dev/ttyUSB0", 115_200, 100.0);
        assert!(by_line.found.contains("/dev/ttyUSB0 up to"), "{}", by_line.found);
        assert_eq!(by_line.mark, Mark::Usable, "a line of 115200 baud does not carry 1 kHz");
    }

    #[test]
    fn rates_are_rounded_down_to_two_digits() {
        let rates = [1_234.0, 999.9, 20_000.0, 87.6].map(rounded);
        assert_eq!(rates, [1_200.0, 990.0, 20_000.0, 87.0]);
    }
}
