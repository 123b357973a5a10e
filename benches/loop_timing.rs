//! Measures the lateness of the real-time loop over a pseudo-terminal. Compares it with a loop that
//! only sleeps to absolute deadlines at the same priority. The two run alternately in pairs, at 1,
//! 2 and 4 kHz.
//!
//! `cargo bench --bench loop_timing`. With `-- SECONDS` each run lasts that long (default 3).

use std::time::Duration;

use hbot_config::{Override, RigConfig, SceneFile};
use hbot_host::run_loop::clock::{now_ns, sleep_until_ns};
use hbot_host::run_loop::pace::Pace;
use hbot_host::run_loop::realtime::{LOOP_PRIORITY, lock_memory, real_time, touch_stack};
use hbot_server::server::{ServerOptions, Time};
use hbot_server::service::Summary;
use hbot_testing::server::{any_port, serve};
use hdrhistogram::Histogram;
use serde_json::json;

const PAIRS: usize = 5;

/// Runs a loop that only sleeps until each deadline, as a baseline for the server's loop. Returns
/// the median and the 99 % quantile of its lateness in us, the number of late ticks, and the number
/// of all ticks.
fn bare(rate: u32, seconds: f64) -> [f64; 4] {
    let body = move || {
        let _ = real_time(LOOP_PRIORITY);
        touch_stack();
        let period_ns = 1_000_000_000 / u64::from(rate);
        let mut lateness = Histogram::<u64>::new_with_bounds(1, 10_000_000_000, 3).expect("legal bounds");
        let mut pace = Pace::new(now_ns() + period_ns, period_ns);
        let end = now_ns() + (seconds * 1e9) as u64;
        let mut late = 0;
        while pace.deadline_ns() < end {
            sleep_until_ns(pace.deadline_ns());
            let beat = pace.beat(now_ns());
            lateness.saturating_record(beat.lateness_ns);
            late += u64::from(beat.late);
            pace.end(now_ns());
        }
        let us = |q| lateness.value_at_quantile(q) as f64 * 1e-3;
        [us(0.5), us(0.99), late as f64, lateness.len() as f64]
    };
    std::thread::spawn(body).join().expect("it ends")
}

/// Runs the server without clients, connected to a simulated rig through a pseudo-terminal. Returns
/// the statistics of its loop.
fn server(rate: u32, seconds: f64) -> Result<Summary, Box<dyn std::error::Error>> {
    let rate = Override { path: "loop.rate_hz", value: json!(rate), from: "--rate" };
    let rig = RigConfig::load(None, &[rate])?;
    let options = ServerOptions::new(rig, SceneFile::default_scene(), Time::Wall);
    let duration = Some(Duration::from_secs_f64(seconds));
    Ok(serve(ServerOptions { duration, ..options }, any_port(), |_| std::future::pending()).summary)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let mut args: Vec<_> = std::env::args().skip(1).collect();
    // `cargo bench` gives the argument `--bench`, `cargo test` does not.
    let has = |name: &str| args.iter().any(|a| a == name);
    let smoke = has("--test") || !has("--bench");
    args.retain(|a| !a.starts_with("--"));
    let seconds = if smoke { 0.2 } else { args.first().and_then(|s| s.parse().ok()).unwrap_or(3.0) };
    let pairs = if smoke { 1 } else { PAIRS };
    // Requests the loop's priority in a separate thread. The service runs in this thread and must
    // not have that priority.
    let priority = std::thread::spawn(|| real_time(LOOP_PRIORITY)).join().expect("it ends");
    for refused in [lock_memory(), priority].into_iter().filter_map(Result::err) {
        println!("not in real time: {refused}");
    }
    println!("{pairs} pairs of {seconds} s; lateness in us: median (99 %)\n");
    println!(
        "| rate | bare loop | hbot | ratio of medians, median of pairs | ticks | late (bare) | skipped | missed | torque age, us |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for rate in [1000, 2000, 4000] {
        let (mut bares, mut hbots) = (Vec::new(), Vec::new());
        for _ in 0..pairs {
            bares.push(bare(rate, seconds));
            match server(rate, seconds) {
                Ok(summary) => hbots.push(summary),
                Err(error) => return println!("not measured: {error}"),
            }
        }
        let of = |k: usize| median(bares.iter().map(|b| b[k]).collect());
        let ours = |pick: fn(&Summary) -> f64| median(hbots.iter().map(pick).collect());
        let ratio = median(bares.iter().zip(&hbots).map(|(b, h)| h.lateness_us.p50 / b[0]).collect());
        let sum = |pick: fn(&Summary) -> u64| hbots.iter().map(pick).sum::<u64>();
        println!(
            "| {rate} Hz | {:.1} ({:.1}) | {:.1} ({:.1}) | {ratio:.2} | {} | {} ({}) | {} | {} | {:.0} ({:.0}) |",
            of(0),
            of(1),
            ours(|h| h.lateness_us.p50),
            ours(|h| h.lateness_us.p99),
            sum(|h| h.ticks),
            sum(|h| h.late_ticks),
            bares.iter().map(|b| b[2]).sum::<f64>(),
            sum(|h| h.skipped_ticks),
            sum(|h| h.missed_ticks),
            ours(|h| h.age_us.p50),
            ours(|h| h.age_us.p99),
        );
    }
}
