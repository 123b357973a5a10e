//! `hbot doctor`: checks whether this machine can run a rig, with the numbers behind each result
//! and advice on how to correct problems.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use hbot_config::Override;
use hbot_config::rig::Port;
use hbot_host::commission::doctor::{
    Finding, Machine, Mark, highest_rate, lead, processor, punctuality, rights, serial, verdict, wake_latency,
};
use serde_json::{Value, json};

use super::numbers::{self, rate, whole};
use super::out::{foreign, say, tell};
use super::{ServerAddress, orders, server, show, style};

/// Number of flight logs that are listed.
const LOGS: usize = 5;

/// What the exit codes mean, for the help.
const EXIT_CODES: &str = "\
Exit codes:
  0  this machine is good or usable
  1  a finding is \"not sufficient\", or --server does not answer
  2  the command line is wrong";

/// Options of `hbot doctor`.
#[derive(Debug, Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct DoctorArgs {
    /// Rig file with the port and rate to check [default: the prototype, built in]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// Serial device to check, in place of the rig file's
    #[arg(long, value_name = "DEVICE")]
    port: Option<String>,
    /// Ticks a second to measure at, 50 to 20000, in place of the rig file's
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, value_parser = rate)]
    rate: Option<u32>,
    /// Processor of the loop, 0 to 1023, in place of the rig file's
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = numbers::processor)]
    cpu: Option<u32>,
    /// How long to measure the lateness of this machine, 1 to 3600 s
    #[arg(long, value_name = "SECONDS", default_value_t = 5, allow_negative_numbers = true, value_parser = whole(1..=3600_u64))]
    seconds: u64,
    /// Also show the statistics of a running server's loop
    #[arg(long, value_name = "ADDR")]
    server: Option<String>,
    /// File with the token that the server asks for [env: HBOT_TOKEN_FILE]
    #[arg(long, value_name = "FILE", requires = "server")]
    token_file: Option<PathBuf>,
    /// File with the server's TLS certificate, or that of the authority that signed it (PEM)
    #[arg(long, value_name = "FILE", requires = "server")]
    ca: Option<PathBuf>,
    /// Print one object of JSON, for programs
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: DoctorArgs) -> anyhow::Result<ExitCode> {
    let over = |path, from, value: Option<Value>| value.map(|value| Override { path, value, from });
    let overrides: Vec<Override> = over("link.port", "--port", args.port.map(Value::from))
        .into_iter()
        .chain(over("loop.rate_hz", "--rate", args.rate.map(Value::from)))
        .chain(over("loop.cpu", "--cpu", args.cpu.map(Value::from)))
        .collect();
    let rig = super::rig_file::load(args.rig.as_deref(), &overrides)?;
    // The limit that the server would set while it runs also applies during the measurement.
    let (limit, held) = rig.wake_us.map(wake_latency).unzip();
    let machine = Machine::default();
    let machine = match (&held, rig.wake_us) {
        (Some(Some(_)), Some(wake_us)) => machine.holding(wake_us),
        _ => machine,
    };
    let mut findings = machine.findings();
    findings.extend(rights());
    findings.extend(limit);
    findings.extend(rig.cpu.map(processor));
    if let Port::Devices(devices) = &rig.link.port {
        findings.extend(devices.iter().flat_map(|device| serial(device)));
    }
    let token_file = args.token_file.or_else(|| std::env::var_os("HBOT_TOKEN_FILE").map(PathBuf::from));
    let address = args.server.map(|server| ServerAddress { server, token_file, ca: args.ca });
    let silent = |error: &anyhow::Error| Finding {
        id: "server",
        mark: Mark::NotSufficient,
        found: foreign(&format!("{error:#}")).to_string(),
        mend: Some("start it, name another, or leave --server out".to_owned()),
    };
    // The server is contacted before the measurement, so that the user does not wait for nothing if
    // it does not answer.
    let mut server =
        match address.map(|address| orders::connect_by_option(&address, "hbot doctor")).transpose() {
            Ok(server) => server,
            Err(error) => {
                findings.push(silent(&error));
                None
            }
        };
    if !args.json {
        findings.iter().try_for_each(show)?;
        say!("  {}measuring for {} s{}", style::DIM, args.seconds, style::OFF)?;
    }
    let measured = punctuality(rig.rate_hz, rig.cpu, Duration::from_secs(args.seconds));
    drop(held);
    let judged = [verdict(&measured), lead(&measured, rig.early_ns), highest_rate(&rig, &measured)];
    if !args.json {
        judged.iter().try_for_each(show)?;
    }
    findings.extend(judged);
    let stats = match server.as_mut().map(hbot_api::Client::stats).transpose() {
        Ok(stats) => stats,
        Err(error) => {
            let finding = silent(&error.into());
            if !args.json {
                show(&finding)?;
            }
            findings.push(finding);
            None
        }
    };
    let mut logs = server::flight_logs();
    let logs = logs.split_off(logs.len().saturating_sub(LOGS));
    let worst = findings.iter().map(|finding| finding.mark).max().unwrap_or(Mark::Good);
    if args.json {
        let all = json!({
            "verdict": worst, "findings": findings, "punctuality": measured, "server": stats, "flight_logs": logs,
        });
        say!("{all}")?;
    } else {
        if let Some(stats) = &stats {
            say!("")?;
            show::print(stats)?;
        }
        for log in &logs {
            tell!("  flight log       {}", log.display())?;
        }
        let (colour, word) = mark(worst);
        say!("\n{colour}{word}{}", style::OFF)?;
    }
    Ok(if worst == Mark::NotSufficient { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn mark(mark: Mark) -> (anstyle::Style, &'static str) {
    match mark {
        Mark::Good => (style::GOOD, "good"),
        Mark::Usable => (style::WARN, "usable"),
        Mark::NotSufficient => (style::BAD, "not sufficient"),
    }
}

fn show(finding: &Finding) -> anyhow::Result<()> {
    let (colour, word) = mark(finding.mark);
    let off = style::OFF;
    tell!("  {:<16} {colour}{word:<14}{off} {}", finding.id, finding.found)?;
    if let Some(mend) = &finding.mend {
        tell!("  {:<16} {}to mend it: {mend}{off}", "", style::DIM)?;
    }
    Ok(())
}
