//! The text of the metrics page: every statistic of a run as a metric for Prometheus.

use std::fmt::Write as _;

use hbot_api::{CountsByName, Distribution, Name};
use prometheus_client::collector::Collector;
use prometheus_client::encoding::text::encode;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric as _};
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::{Registry, Unit};

use super::format::Format;
use crate::service::Summary;

/// Formats the statistics of a run as text for Prometheus.
pub(super) fn text(summary: Box<Summary>, format: Format) -> String {
    let mut registry = Registry::with_prefix("hbot");
    registry.register_collector(Box::new(Figures(summary)));
    let mut out = String::new();
    // Writing to a string cannot fail. If an encoder fails anyway, return the error and not half of
    // the text.
    if let Err(error) = encode(&mut out, &registry) {
        out.clear();
        let _ = writeln!(out, "# {error}\n# EOF");
    }
    // Quantiles belong to the type summary, which the library cannot write. Nothing else in
    // `Figures` is a gauge.
    let out = out.replace(" gauge\n", " summary\n");
    match format {
        Format::OpenMetrics => out,
        Format::Text => older(&out),
    }
}

/// Converts a text from the OpenMetrics format to the text format 0.0.4. There the name of a
/// counter ends in `_total` in the comments too, and there are neither units nor an end mark.
fn older(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut help = "";
    for line in text.lines() {
        if let Some(described) = line.strip_prefix("# HELP ") {
            // The type, which says what the name is, is in the next line.
            help = described.split_once(' ').map_or("", |(_, words)| words);
        } else if let Some((name, kind)) =
            line.strip_prefix("# TYPE ").and_then(|typed| typed.split_once(' '))
        {
            let total = if kind == "counter" { "_total" } else { "" };
            let _ = writeln!(out, "# HELP {name}{total} {help}\n# TYPE {name}{total} {kind}");
        } else if !line.starts_with('#') {
            let _ = writeln!(out, "{line}");
        }
    }
    out
}

/// The statistics of a run, presented as metrics for Prometheus.
#[derive(Debug)]
struct Figures(Box<Summary>);

impl Collector for Figures {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> Result<(), std::fmt::Error> {
        // Every field is named, so a field that is added to the summary does not compile until it
        // is exported here too.
        let Summary {
            ticks,
            awake_us,
            lateness_us,
            compute_us,
            link_us,
            age_us,
            late_ticks,
            skipped_ticks,
            missed_ticks,
            corrupt_frames,
            foreign_frames,
            send_failures,
            reopened_ports,
            dropped_samples,
            faults,
            estops,
            requests,
            refused,
            refused_streams,
            dropped_states,
            connections,
            connections_turned_away,
            handshakes_failed,
            connections_cut,
            flight_logs,
            flight_logs_failed,
            recorded_ticks,
            unrecorded_ticks,
            recordings_failed,
            dropped_live,
        } = &*self.0;
        for (name, help, value) in [
            ("ticks", "Ticks of the loop", ticks),
            ("late_ticks", "Ticks that started more than a quarter period late", late_ticks),
            ("skipped_ticks", "Ticks whose deadline passed before the one before them ended", skipped_ticks),
            ("missed_ticks", "Ticks without a new reading", missed_ticks),
            ("corrupt_frames", "Damaged frames on the serial lines", corrupt_frames),
            ("foreign_frames", "Whole frames that were not for this rig", foreign_frames),
            ("send_failures", "Commands that a serial line did not take whole", send_failures),
            ("reopened_ports", "Times that a serial line was gone and came back", reopened_ports),
            ("dropped_samples", "Samples that the service did not fetch in time", dropped_samples),
            ("estops", "Emergency stops", estops),
            ("requests", "Requests read", requests),
            ("refused_streams", "Stream messages refused", refused_streams),
            ("dropped_states", "States that slow readers did not get", dropped_states),
            ("connections", "Connections taken", connections),
            ("connections_turned_away", "Connections turned away", connections_turned_away),
            ("handshakes_failed", "Connections never encrypted as they were to be", handshakes_failed),
            ("connections_cut", "Connections cut because their client did not read", connections_cut),
            ("flight_logs", "Flight logs written", flight_logs),
            ("flight_logs_failed", "Flight logs that could not be written", flight_logs_failed),
            ("recorded_ticks", "Ticks written to recordings", recorded_ticks),
            ("unrecorded_ticks", "Ticks missing in recordings", unrecorded_ticks),
            ("recordings_failed", "Recordings that could not be written to their end", recordings_failed),
            ("dropped_live", "Messages that slow live viewers did not get", dropped_live),
        ] {
            let counter = ConstCounter::new(*value);
            counter.encode(encoder.encode_descriptor(name, help, None, counter.metric_type())?)?;
        }
        family(&mut encoder, "faults", "Faults by cause", "cause", faults)?;
        family(&mut encoder, "refused", "Requests refused by code", "code", refused)?;
        for (name, help, distribution) in [
            ("awake", "Awake before a tick's deadline, waiting for it", awake_us),
            ("lateness", "From a tick's deadline to its start", lateness_us),
            ("compute", "In the controller", compute_us),
            ("link", "On the serial lines", link_us),
            ("torque_age", "From a reading to the torque on the wire", age_us),
        ] {
            let Distribution { p50, p90, p99, p99_9, p99_99, max, .. } = *distribution;
            let none = ConstGauge::new(0.0_f64);
            let mut gauge =
                encoder.encode_descriptor(name, help, Some(&Unit::Seconds), none.metric_type())?;
            let quantiles =
                [("0.5", p50), ("0.9", p90), ("0.99", p99), ("0.999", p99_9), ("0.9999", p99_99), ("1", max)];
            for (quantile, us) in quantiles {
                ConstGauge::new(us * 1e-6).encode(gauge.encode_family(&[("quantile", quantile)])?)?;
            }
        }
        Ok(())
    }
}

fn family<N: Name>(
    encoder: &mut DescriptorEncoder<'_>,
    name: &str,
    help: &str,
    label: &str,
    counts: &CountsByName<N>,
) -> Result<(), std::fmt::Error> {
    let none = ConstCounter::new(0_u64);
    let mut counter = encoder.encode_descriptor(name, help, None, none.metric_type())?;
    for (value, count) in counts.iter() {
        ConstCounter::new(count).encode(counter.encode_family(&[(label, value.as_str())])?)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use hbot_api::Fault;

    use super::*;

    #[test]
    fn every_figure_has_its_line() {
        let mut summary = Summary { ticks: 42, ..Summary::default() };
        (0..3).for_each(|_| summary.faults.add(Fault::LinkLost));
        summary.lateness_us.p99 = 250.0;
        let older = text(Box::new(summary.clone()), Format::Text);
        let text = text(Box::new(summary), Format::OpenMetrics);
        for line in [
            "hbot_ticks_total 42",
            "hbot_faults_total{cause=\"link_lost\"} 3",
            "hbot_refused_total{code=\"bad_request\"} 0",
            "# TYPE hbot_lateness_seconds summary",
            "hbot_lateness_seconds{quantile=\"0.99\"} 0.00025",
        ] {
            assert!(text.lines().any(|l| l == line), "{line} in\n{text}");
        }
        assert!(text.ends_with("# EOF\n"));
        for line in [
            "# HELP hbot_ticks_total Ticks of the loop",
            "# TYPE hbot_ticks_total counter",
            "hbot_ticks_total 42",
            "# TYPE hbot_lateness_seconds summary",
            "hbot_lateness_seconds{quantile=\"0.99\"} 0.00025",
        ] {
            assert!(older.lines().any(|l| l == line), "{line} in\n{older}");
        }
        assert!(!older.contains("# UNIT") && !older.contains("# EOF"), "{older}");
        let samples = |text: &str| text.lines().filter(|line| !line.starts_with('#')).count();
        assert_eq!(samples(&older), samples(&text));
    }
}
