//! Statistics of a server for Prometheus: `GET /metrics` over HTTP, read only.
//!
//! A task on the service's runtime asks the hub for the statistics, as a client does with `stats`,
//! so a scrape costs the loop nothing. Connections are few at a time, short, and bounded in size.
//! If the address can be reached from other machines, a scrape must show a token as `Authorization:
//! Bearer TOKEN`. Use a separate token for this page, because it crosses the network unencrypted.

use std::fmt::Write as _;
use std::sync::Arc;
use std::time::Duration;

use hbot_api::{CountsByName, Distribution, ErrorCode, Name};
use prometheus_client::collector::Collector;
use prometheus_client::encoding::text::encode;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric as _};
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::{Registry, Unit};
use subtle::ConstantTimeEq as _;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, mpsc, oneshot};
use tokio::time::timeout;

use crate::service::{Control, Summary};

/// Largest number of simultaneous connections to the metrics page. Further ones wait in the
/// operating system's queue.
const CONNECTIONS: usize = 4;
/// Time limit for reading and answering one request for the metrics page.
const PATIENCE: Duration = Duration::from_secs(2);
/// Largest size of a request for the metrics page, bytes.
const REQUEST: usize = 8 * 1024;
/// Pause before the next attempt after the operating system has failed to accept a connection.
const PAUSE: Duration = Duration::from_millis(200);

/// Answers requests for the metrics page on `listener`, for as long as the future is polled. Gets
/// the statistics from the service through `control`. If `token` is given, every request must
/// contain it.
pub async fn serve(listener: TcpListener, control: mpsc::Sender<Control>, token: Option<String>) {
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    let token = Arc::new(token);
    loop {
        // Unreachable: the semaphore is never closed.
        let Ok(place) = Arc::clone(&places).acquire_owned().await else { return };
        match listener.accept().await {
            Ok((stream, _)) => {
                let (control, token) = (control.clone(), Arc::clone(&token));
                tokio::spawn(async move {
                    // A connection that exceeds its time gets no answer. It keeps its place until
                    // its refusal is counted, so the number of messages that wait for the hub stays
                    // bounded.
                    if timeout(PATIENCE, answer(stream, &control, token.as_deref())).await.is_err() {
                        let _ = control.send(Control::Refused(ErrorCode::BadRequest)).await;
                    }
                    drop(place);
                });
            }
            Err(_) => tokio::time::sleep(PAUSE).await,
        }
    }
}

async fn answer(
    mut stream: TcpStream,
    control: &mpsc::Sender<Control>,
    token: Option<&str>,
) -> std::io::Result<()> {
    let mut request = Vec::new();
    let mut piece = [0; 1024];
    while !request.windows(4).any(|end| end == b"\r\n\r\n") {
        let n = stream.read(&mut piece).await?;
        request.extend_from_slice(&piece[..n]);
        if n == 0 {
            return Ok(());
        }
        if request.len() > REQUEST {
            break;
        }
    }
    let judged = if request.len() > REQUEST {
        Err("431 Request Header Fields Too Large")
    } else {
        judge(&String::from_utf8_lossy(&request), token)
    };
    if let Err(status) = judged {
        // If the service has ended, nobody counts refusals any more.
        let _ = control.send(Control::Refused(code(status))).await;
    }
    let (status, kind, body) = match judged {
        Ok(()) => match summary(control).await {
            Some(summary) => {
                ("200 OK", "application/openmetrics-text; version=1.0.0; charset=utf-8", text(summary))
            }
            None => ("503 Service Unavailable", "text/plain", "the server stops\n".to_owned()),
        },
        Err(status) => (status, "text/plain", format!("{status}\n")),
    };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes()).await?;
    stream.write_all(body.as_bytes()).await?;
    stream.shutdown().await
}

/// Checks that an HTTP request is an authorized `GET /metrics`. Otherwise returns the HTTP status
/// of the refusal.
fn judge(request: &str, token: Option<&str>) -> Result<(), &'static str> {
    let mut lines = request.split("\r\n");
    let mut words = lines.next().unwrap_or_default().split(' ');
    if words.next() != Some("GET") {
        return Err("405 Method Not Allowed");
    }
    if words.next().map(|path| path.split('?').next().unwrap_or_default()) != Some("/metrics") {
        return Err("404 Not Found");
    }
    let Some(token) = token else { return Ok(()) };
    let shown = lines.find_map(|line| {
        let (name, value) = line.split_once(':')?;
        name.eq_ignore_ascii_case("authorization").then(|| value.trim().strip_prefix("Bearer ")).flatten()
    });
    let same = shown.is_some_and(|shown| bool::from(shown.as_bytes().ct_eq(token.as_bytes())));
    if same { Ok(()) } else { Err("401 Unauthorized") }
}

/// Returns the API error code under which a refusal with this HTTP status is counted.
fn code(status: &str) -> ErrorCode {
    match status.get(..3) {
        Some("401") => ErrorCode::Unauthorized,
        Some("431") => ErrorCode::TooLarge,
        _ => ErrorCode::BadRequest,
    }
}

async fn summary(control: &mpsc::Sender<Control>) -> Option<Box<Summary>> {
    let (wanted, told) = oneshot::channel();
    control.send(Control::Summarize(wanted)).await.ok()?;
    told.await.ok()
}

/// Formats the statistics of a run as text for Prometheus, in the OpenMetrics format.
fn text(summary: Box<Summary>) -> String {
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
    out.replace(" gauge\n", " summary\n")
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
    fn only_a_get_of_metrics_by_somebody_who_may_is_answered() {
        let get = "GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n";
        assert_eq!(judge(get, None), Ok(()));
        assert_eq!(judge("GET /metrics?x=1 HTTP/1.1\r\n\r\n", None), Ok(()));
        assert_eq!(judge("POST /metrics HTTP/1.1\r\n\r\n", None), Err("405 Method Not Allowed"));
        assert_eq!(judge("GET / HTTP/1.1\r\n\r\n", None), Err("404 Not Found"));
        assert_eq!(judge("\r\n\r\n", None), Err("405 Method Not Allowed"));
        assert_eq!(judge(get, Some("secret")), Err("401 Unauthorized"));
        let with = |shown: &str| format!("GET /metrics HTTP/1.1\r\nauthorization: {shown}\r\n\r\n");
        assert_eq!(judge(&with("Bearer secret"), Some("secret")), Ok(()));
        for wrong in ["Bearer secre", "Bearer secret2", "secret", ""] {
            assert_eq!(judge(&with(wrong), Some("secret")), Err("401 Unauthorized"), "{wrong}");
        }
    }

    #[test]
    fn every_figure_has_its_line() {
        let mut summary = Summary { ticks: 42, ..Summary::default() };
        (0..3).for_each(|_| summary.faults.add(Fault::LinkLost));
        summary.lateness_us.p99 = 250.0;
        let text = text(Box::new(summary));
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
    }
}
