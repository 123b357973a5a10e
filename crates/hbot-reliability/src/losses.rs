//! Rows in which something is taken away from a running server.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use hbot_api::{Fault, Mode, StatsOk};
use hbot_config::rig::Protocol;
use rustix::process::Signal;
use serde_json::{Value, json};

use crate::bench::{Helper, WatchedServer, hbot, still};
use crate::clients::VALID_MS;
use crate::{Outcome, Row, rigs};

/// Length of the ramp with which a client's torque ends, ms.
const RAMP_MS: u64 = 20;
/// Number of ticks that the server may take to notice a loss and react to it.
pub(crate) const NOTE: u64 = 2;
/// Number of ticks beyond `timeout_ticks` within which motors are off after their controllers have
/// fallen silent. docs/reliability.md derives it.
const SILENCE: u32 = 3;
/// Parameters of a simulated hand that holds the sphere still.
const HOLDS: &str = r#"{"stiffness": 50, "damping": 1, "amplitude": 0}"#;

fn hand() -> Outcome<Value> {
    Ok(serde_json::from_str(HOLDS)?)
}

/// Kills or stops a client that commands a torque. Measures the number of ticks from the client's
/// last accepted message to zero torque.
pub(crate) fn client_lost(protocol: Protocol, fault: &str, signal: Signal) -> Outcome<Row> {
    let mut row = client_lost_once(protocol, fault, signal)?;
    for _ in 0..4 {
        // A fault of the machine can end the torque earlier. Such a run proves nothing, so it is
        // repeated.
        if row.kept {
            break;
        }
        row = client_lost_once(protocol, fault, signal)?;
    }
    Ok(row)
}

fn client_lost_once(protocol: Protocol, fault: &str, signal: Signal) -> Outcome<Row> {
    let mut bench = WatchedServer::start(protocol, "sim", json!({"hand": hand()?}))?;
    let client = bench.pushed()?;
    client.process.signal(signal)?;
    let mut taken = 0;
    let over = loop {
        let state = bench.until(|_| true)?;
        if still(&state) {
            break state;
        }
        let client = state.client.ok_or("no stream")?;
        taken = state.tick - client.age_ticks;
    };
    let ticks = over.tick - taken;
    let bound = VALID_MS + RAMP_MS + NOTE;
    Ok(Row::new(
        &format!("client {fault} while it commands 0.3 N m"),
        format!("zero torque at most {bound} ticks after the last message"),
        format!("zero after {ticks} ticks; mode {:?}", over.mode),
        ticks <= bound && over.mode == Mode::Active,
    ))
}

/// Starts motor controllers of `protocol` in a separate process, a server that uses them, and a
/// client that commands a torque. Returns the controllers, the server and the client.
pub(crate) fn pushed_rig(protocol: Protocol) -> Outcome<(Helper, WatchedServer, Helper)> {
    let mut peer = Helper::start(&["peer", protocol.name()])?;
    let port = peer.line()?;
    let mut bench = WatchedServer::start(protocol, &port, Value::Null)?;
    let client = bench.pushed()?;
    Ok((peer, bench, client))
}

/// Kills or stops the process of the motor controllers. Counts the ticks without a reading until
/// the server commands zero torque. Only the server can report this number.
pub(crate) fn peer_gone(protocol: Protocol, fault: &str, signal: Signal) -> Outcome<Row> {
    let link = rigs::on_device(protocol)?.link;
    let (peer, mut bench, _client) = pushed_rig(protocol)?;
    let missed = |bench: &mut WatchedServer| Ok::<_, Box<dyn std::error::Error>>(bench.stats()?.missed_ticks);
    peer.process.signal(signal)?;
    let before = missed(&mut bench)?;
    let state = bench.until(|state| state.mode == Mode::Fault)?;
    let after = missed(&mut bench)?;
    let bound = u64::from(link.timeout_ticks) + NOTE;
    Ok(Row::new(
        &format!("motor controllers {fault}"),
        format!(
            "link_lost after {bound} ticks without a reading, with zero torque in that tick; the controllers' own watchdog after {} ms",
            link.watchdog_ms
        ),
        format!("{}; {} missed ticks counted after the signal", cause(state.fault), after - before),
        state.fault == Some(Fault::LinkLost) && still(&state),
    ))
}

pub(crate) fn cause(fault: Option<Fault>) -> String {
    fault.map_or_else(|| "no fault".to_owned(), |fault| fault.to_string())
}

/// Makes the motor controllers misbehave. Measures, by their own clock, the time until controllers
/// of hbot's own link receive zero torque, and until no motor of another rig gives torque. If
/// `expected` is given, the fault must be this one.
pub(crate) fn peer_troubled(
    protocol: Protocol,
    trouble: &str,
    fault: &str,
    expected: Option<Fault>,
) -> Outcome<Row> {
    let config = rigs::on_device(protocol)?;
    let (mut peer, mut bench, _client) = pushed_rig(protocol)?;
    peer.say(trouble)?;
    let state = bench.until(|state| state.mode == Mode::Fault)?;
    // Wait until the motor controllers have received the commands of the fault.
    bench.until(|later| later.tick > state.tick + 50)?;
    peer.say("report")?;
    let heard: Value = serde_json::from_str(&peer.line()?)?;
    let after_ms = heard["zero_after_ms"].as_f64().unwrap_or(f64::INFINITY);
    let (bound, of_what) = if ["mute", "deafen_one"].contains(&trouble) {
        let ticks = config.rig.timing.timeout_ticks + SILENCE;
        (f64::from(ticks) * config.rig.timing.period_ns as f64 * 1e-6, "time-out and three ticks")
    } else {
        // One tick to notice the fault and one to send the command.
        (f64::from(config.link.watchdog_ms) + NOTE as f64, "watchdog time and two ticks")
    };
    let place = if protocol == Protocol::Hbot { "the controllers" } else { "all motors" };
    let stats = bench.stats()?;
    Ok(Row::new(
        &format!("motor controllers {fault}"),
        format!(
            "{}, and zero torque at {place} within {bound} ms ({of_what})",
            expected.map_or_else(|| "a fault".to_owned(), |fault| fault.to_string())
        ),
        format!(
            "{}, zero torque after {after_ms:.1} ms; {} damaged and {} foreign frames",
            cause(state.fault),
            stats.corrupt_frames,
            stats.foreign_frames
        ),
        state.fault.is_some_and(|fault| expected.is_none_or(|expected| fault == expected))
            && still(&state)
            && after_ms <= bound,
    ))
}

/// Damages the share `share` of the frames on the line, for at most `ticks` ticks, and returns the
/// row of the fault table. If `rides` is true, the rig must stay in the mode `active`. Otherwise it
/// must go to the fault `link_corrupt` with zero torque.
pub(crate) fn noise(share: f64, ticks: u64, rides: bool) -> Outcome<Row> {
    let link = json!({"latency_s": 0, "command_latency_s": 0, "jitter_s": 0, "loss": 0, "corrupt": share});
    let mut bench = WatchedServer::start(Protocol::Hbot, "sim", json!({"hand": hand()?}))?;
    bench.watcher.acquire(false)?;
    bench
        .watcher
        .load_scene(json!({"name": "noise", "effect": [], "simulate": {"hand": hand()?, "link": link}}))?;
    let from = bench.until(|_| true)?.tick;
    let state = bench.until(|state| state.mode == Mode::Fault || state.tick > from + ticks)?;
    let frames = bench.stats()?.corrupt_frames;
    let promise =
        if rides { "no fault, damaged frames are counted" } else { "fault link_corrupt, zero torque" };
    let kept = if rides {
        state.mode == Mode::Active
    } else {
        state.fault == Some(Fault::LinkCorrupt) && still(&state)
    };
    Ok(Row::new(
        &format!("{} % of frames damaged each way", 100.0 * share),
        promise,
        format!(
            "mode {:?}, {} after {} ticks, {frames} damaged frames counted",
            state.mode,
            cause(state.fault),
            state.tick - from
        ),
        kept,
    ))
}

/// Damages frames as [`noise`] does, but in virtual time, so that only the damage can cause a
/// fault. Checks that no fault occurs.
pub(crate) fn noise_virtual(share: f64, seconds: u64) -> Outcome<Row> {
    let folder = tempfile::tempdir()?;
    let scene = folder.path().join("noise.toml");
    let text = format!(
        "name = \"noise\"\n[[effect]]\nid = \"spring\"\nkind = \"spring\"\nstiffness = 1\nanchor = \"here\"\n[simulate]\nhand = {{ amplitude = 0.2 }}\n\
         link = {{ latency_s = 0, command_latency_s = 0, jitter_s = 0, loss = 0, corrupt = {share} }}\n"
    );
    std::fs::write(&scene, text)?;
    let out = hbot()?
        .args(["server", "--listen", "127.0.0.1:0", "--time", "virtual", "--duration"])
        .arg(seconds.to_string())
        .arg("--scene")
        .arg(&scene)
        .env("XDG_STATE_HOME", folder.path())
        .output()?;
    let said = String::from_utf8_lossy(&out.stdout).into_owned();
    let last = said.lines().find(|line| line.contains("stopped")).unwrap_or("nothing").trim().to_owned();
    let logs = std::fs::read_dir(folder.path().join("hbot/flight")).map_or(0, Iterator::count);
    Ok(Row::new(
        &format!(
            "{} % of frames damaged each way for {} ticks of virtual time",
            100.0 * share,
            1000 * seconds
        ),
        "no fault",
        format!("{logs} faults; {last}"),
        logs == 0 && out.status.success() && !last.contains(" 0 damaged frames"),
    ))
}

/// Sends a signal that ends a program to the server while a client commands a torque. Checks the
/// last commands that the motor controllers receive.
pub(crate) fn signalled(name: &str, signal: Signal) -> Outcome<Row> {
    let (mut peer, mut bench, _client) = pushed_rig(Protocol::Hbot)?;
    peer.say("mark")?;
    bench.server.signal(signal)?;
    let status = bench.server.0.wait()?;
    // Bytes on the line still arrive.
    std::thread::sleep(Duration::from_millis(100));
    peer.say("report")?;
    let heard: Value = serde_json::from_str(&peer.line()?)?;
    let zeros = heard["last_zeros"].as_u64().unwrap_or(0);
    let after_ms = heard["zero_after_ms"].as_f64().unwrap_or(f64::INFINITY);
    Ok(Row::new(
        &format!("{name} while a client commands torque"),
        "the last three commands to the controllers are motors off with zero torque; exit 0",
        format!(
            "{status}; the last {zeros} commands were motors off, the first of them {after_ms:.1} ms after the signal"
        ),
        status.success() && zeros >= 3,
    ))
}

/// Makes the writing of a flight log fail because the disk is full. Checks that the server reports
/// this and goes on.
pub(crate) fn disk_full() -> Outcome<Row> {
    let folder = tempfile::tempdir()?;
    let small = folder.path().join("small");
    std::fs::create_dir(&small)?;
    let mounted = mount(&["-t", "tmpfs", "-o", "size=32k", "tmpfs"], &small);
    let (how, blocks) = if mounted.is_some() {
        ("a file system of 32 KiB", None)
    } else {
        ("files limited to 32 KiB, for want of the right to mount", Some(64))
    };
    unwritten(
        &format!("the disk is full while a flight log is written ({how})"),
        &small,
        folder.path(),
        blocks,
    )
}

/// Makes the writing of a flight log fail because the disk is read-only. Checks that the server
/// reports this and goes on.
pub(crate) fn disk_read_only() -> Outcome<Row> {
    let folder = tempfile::tempdir()?;
    let logs = folder.path().join("read-only");
    std::fs::create_dir(&logs)?;
    let mounted = mount(&["-t", "tmpfs", "-o", "ro,size=32k", "tmpfs"], &logs);
    let (how, place) = if mounted.is_some() {
        ("a file system mounted read-only", logs.clone())
    } else {
        // Not even root can make folders there.
        ("a folder below /proc, for want of the right to mount", "/proc/self/hbot".into())
    };
    unwritten(
        &format!("the disk is read-only while a flight log is written ({how})"),
        &place,
        folder.path(),
        None,
    )
}

fn unwritten(fault: &str, logs: &Path, folder: &Path, blocks: Option<u32>) -> Outcome<Row> {
    let said = folder.join("said");
    let mut bench = WatchedServer::logging(logs, &said, blocks)?;
    let counts = |stats: &StatsOk| [stats.late_ticks, stats.skipped_ticks, stats.missed_ticks];
    // Measures a second without a flight log, then the second in which the log is written.
    let second = |bench: &mut WatchedServer| {
        let before = counts(&bench.stats()?);
        let tick = bench.watcher.ping(Value::Null)?.tick;
        bench.until(|state| state.tick > tick + 1000)?;
        let after = counts(&bench.stats()?);
        Ok::<[u64; 3], Box<dyn std::error::Error>>(std::array::from_fn(|i| after[i] - before[i]))
    };
    let without = second(&mut bench)?;
    let before = bench.stats()?;
    bench.watcher.estop()?;
    let with = second(&mut bench)?;
    let stats = bench.stats()?;
    bench.watcher.acquire(false)?;
    bench.activate()?;
    let warned = std::fs::read_to_string(&said)?.contains("flight logs could not be written");
    let failed = stats.flight_logs_failed - before.flight_logs_failed;
    Ok(Row::new(
        fault,
        "the failure is counted and logged as a warning; no fault, the loop goes on",
        format!(
            "{failed} log given up, {}; late, skipped and missed ticks {with:?} in that second, {without:?} in the second before; active again after reset",
            if warned { "with a warning" } else { "without a warning" }
        ),
        failed == 1 && warned && stats.flight_logs == 0 && stats.faults == before.faults,
    ))
}

/// Mounts a file system that is unmounted when the value is dropped. Returns `None` if this process
/// is not permitted to mount.
fn mount(args: &[&str], at: &Path) -> Option<Mounted> {
    let mounted = Command::new("mount").args(args).arg(at).output().is_ok_and(|out| out.status.success());
    mounted.then(|| Mounted(at.to_owned()))
}

struct Mounted(std::path::PathBuf);

impl Drop for Mounted {
    fn drop(&mut self) {
        // Unmount lazily, because the server can still have a file open.
        let _ = Command::new("umount").arg("-l").arg(&self.0).output();
    }
}
