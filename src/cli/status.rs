//! The status line of a server that runs in a terminal, and the figures at its end.

use std::fmt::Write as _;
use std::time::Duration;

use hbot_server::server::Finished;
use hbot_server::service::{Distribution, Status};
use tokio::sync::watch;

use super::log::Log;
use super::style;

/// Draws the status line five times a second, for ever.
pub(crate) async fn show(mut status: watch::Receiver<Status>, log: Log) {
    let plain = anstream::AutoStream::choice(&std::io::stderr()) == anstream::ColorChoice::Never;
    let mut beat = tokio::time::interval(Duration::from_millis(200));
    beat.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    loop {
        beat.tick().await;
        let line = line(&status.borrow_and_update());
        let line = if plain { anstream::adapter::strip_str(&line).to_string() } else { line };
        log.draw(format!("{}{line}{}", style::SAME_LINE, style::LINE_END).into_bytes());
    }
}

/// Takes the status line away.
pub(crate) fn clear(log: &Log) {
    log.draw(style::CLEAR_LINE.as_bytes().to_vec());
}

/// One line: time, mode, orientation, torque, how punctual, who is there.
fn line(status: &Status) -> String {
    let Some(sample) = &status.sample else { return "waiting for the first tick".to_owned() };
    let (state, counters) = (&sample.state, &sample.counters);
    let mode = status.mode();
    let mut line = String::new();
    let angle = 2.0 * state.q.w.abs().min(1.0).acos();
    let _ = write!(
        line,
        "{:8.1} s  {}{mode}{}  turned {:5.1} deg  torque {:.3} N m  late {} skipped {} missed {}  {} client{}",
        sample.t_ns as f64 * 1e-9,
        style::of_mode(mode),
        style::OFF,
        angle.to_degrees(),
        state.torque.length(),
        counters.late,
        counters.skipped,
        counters.missed,
        status.clients,
        if status.clients == 1 { "" } else { "s" },
    );
    if let Some(holder) = &status.holder {
        let _ = write!(line, ", held by {holder}");
    }
    line
}

/// The figures at the end.
pub(crate) fn summary(finished: &Finished) -> String {
    let s = &finished.summary;
    let c = &s.counters;
    let mut text = format!(
        "{}stopped{} after {} ticks: {} late, {} skipped, {} missed, {} damaged frames\n  median (99 %) in us: lateness {}, \
         compute {}, line {}, torque age {}",
        style::NAME,
        style::OFF,
        s.ticks,
        c.late,
        c.skipped,
        c.missed,
        c.corrupt_frames,
        pair(&s.lateness_us),
        pair(&s.compute_us),
        pair(&s.link_us),
        pair(&s.age_us),
    );
    if let Some(ratio) = finished.speed {
        let _ = write!(text, "\n  {ratio:.0} times real time");
    }
    if let Some(part) = finished.failed {
        let _ = write!(
            text,
            "\n  {}{part} ended by a fault of its own{}: motors were switched off",
            style::BAD,
            style::OFF
        );
    }
    text
}

fn pair(d: &Distribution) -> String {
    format!("{:.1} ({:.1})", d.p50, d.p99)
}
