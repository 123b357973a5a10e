//! End-to-end tests in wall-clock time: loop, pseudo-terminal, simulated rig, TCP.

use std::process::Stdio;

use hbot_testing::far::Far;
use hbot_testing::lines::{norm, vector};
use hbot_testing::patience::PATIENCE;

use crate::process::*;

/// Waits until the rig is active. A machine that stood still for 20 ms causes a deadline fault,
/// which these tests do not concern, so it is reset.
fn active(client: &mut JsonLines) -> serde_json::Value {
    loop {
        let state = client.state(|s| s["mode"] == "active" || s["fault"] == "deadline");
        if state["mode"] == "active" {
            return state;
        }
        println!("this machine stood still: {state}");
        for op in ["acquire", "reset", "enable"] {
            client.ask(&format!(r#"{{"id": "again", "op": "{op}"}}"#));
        }
    }
}

#[test]
fn the_server_starts_active_and_the_sphere_moves() {
    let server = Process::patient(&[]);
    for word in ["Hbot prototype", "sim", "1000 Hz", "127.0.0.1:"] {
        assert!(server.banner.contains(word), "{word} in:\n{}", server.banner);
    }
    let mut client = JsonLines::greeted(&server.address);
    client.ask(r#"{"id": 1, "op": "subscribe", "every": 10}"#);
    // Half a second in which the machine did not stand still.
    let (first, later) = loop {
        let first = active(&mut client);
        let end = first["t"].as_f64().map(|t| t + 0.5);
        let later = client.state(|s| s["t"].as_f64() > end || s["mode"] != "active");
        if later["mode"] == "active" {
            break (first, later);
        }
    };
    assert_ne!(first["q"], later["q"], "the hand turns the sphere");
    assert!(norm(&later["torque"]) > 0.0, "the spring pulls");
    let q: f64 = (0..4).map(|i| later["q"][i].as_f64().expect("a number").powi(2)).sum();
    assert!((q - 1.0).abs() < 1e-12, "unit: {q}");
    assert_eq!(later["joints"].as_array().map(Vec::len), Some(4));
}

#[test]
fn the_loop_and_nothing_else_stays_on_the_processor_that_it_is_given() {
    let mine = rustix::thread::sched_getaffinity(None).expect("a set");
    let all: Vec<usize> = (0..1024).filter(|number| mine.is_set(*number)).collect();
    let number = all.last().expect("one that this runs on").to_string();
    let server = Process::patient(&["--cpu", &number]);
    assert!(server.banner.contains(&format!("on processor {number},")), "{}", server.banner);
    let mut seen = 0;
    for task in std::fs::read_dir(format!("/proc/{}/task", server.pid())).expect("it runs") {
        let read = |name: &str| std::fs::read_to_string(task.as_ref().expect("a thread").path().join(name));
        // A thread can end while it is being examined.
        let (Ok(name), Ok(status)) = (read("comm"), read("status")) else { continue };
        let allowed =
            status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:")).expect("a list");
        let alone = allowed.trim() == number;
        assert_eq!(alone, name.trim() == "hbot-loop" || all.len() == 1, "{name} on {allowed}");
        seen += u32::from(name.trim() == "hbot-loop");
    }
    assert_eq!(seen, 1, "the loop's thread");
}

/// The limit on processor sleep holds as long as the file is open. Without the permission to open
/// it, the server says so.
#[test]
fn processors_are_kept_from_sleeping_while_the_loop_runs() {
    const FILE: &str = "/dev/cpu_dma_latency";
    let may = std::fs::File::options().write(true).open(FILE).is_ok();
    for (wake_us, asked) in [(0, true), (1_000_000, false)] {
        let server = Process::altered("rate_hz = 1000", &format!("rate_hz = 1000\nwake_us = {wake_us}"));
        let files = std::fs::read_dir(format!("/proc/{}/fd", server.pid())).expect("its files");
        let held = files.flatten().any(|file| {
            std::fs::read_link(file.path()).is_ok_and(|target| target == std::path::Path::new(FILE))
        });
        assert_eq!(held, asked && may, "wake_us = {wake_us}");
    }
}

#[test]
fn the_loop_is_awake_before_its_deadlines_as_long_as_it_may() {
    for early_us in [0, 1000] {
        let server = Process::altered("rate_hz = 1000", &format!("rate_hz = 200\nearly_us = {early_us}"));
        let mut client = JsonLines::greeted(&server.address);
        eventually("awake before a deadline", || {
            let stats = client.ask(r#"{"id": 1, "op": "stats"}"#);
            let awake = stats["ok"]["awake_us"]["max"].as_f64().expect("a number");
            // The histogram has three significant digits.
            assert!(awake <= 1.001 * f64::from(early_us), "{awake}");
            let enough = stats["ok"]["ticks"].as_u64() > Some(100);
            enough && (awake > 0.0 || early_us == 0)
        });
    }
}

#[test]
fn the_last_that_controllers_hear_before_a_signal_ends_it_is_zero_torque() {
    let rig = hbot_config::RigConfig::prototype();
    for signal in STOPPING {
        let state = tempfile::tempdir().expect("a folder");
        let far = Far::start(&rig);
        let server = Process::patient(&["--port", &far.path, "--scene", &push_scene(state.path())]);
        let mut client = server.holder();
        push(&mut client, || far.pushed());
        server.signal(signal);
        client.until(|event| event["event"] == "stopping");
        let (last_words, status) = server.end();
        assert_eq!(status.code(), Some(0), "{signal:?}: {last_words}");
        far.ends_still();
    }
}

#[test]
fn sigusr1_is_an_emergency_stop_until_reset() {
    let server = Process::patient(&[]);
    let mut client = JsonLines::greeted(&server.address);
    client.ask(r#"{"id": 1, "op": "subscribe", "every": 1}"#);
    active(&mut client);
    server.signal(Signal::USR1);
    let stopped = client.state(|s| s["mode"] == "estop");
    assert_eq!(norm(&stopped["torque"]), 0.0, "zero torque in the same tick: {stopped}");
    for joint in stopped["joints"].as_array().expect("joints") {
        assert_eq!(joint["torque"].as_f64(), Some(0.0));
    }
    client.ask(r#"{"id": 2, "op": "acquire"}"#);
    let refused = client.ask(r#"{"id": 3, "op": "enable"}"#);
    assert_eq!(refused["error"]["code"], "faulted", "{refused}");
    let reset = client.ask(r#"{"id": 4, "op": "reset"}"#);
    assert_eq!(reset["ok"]["mode"], "idle", "{reset}");
}

#[test]
fn the_loop_keeps_its_count_over_the_pseudo_terminal_at_each_rate() {
    for rate in ["1000", "2000", "4000"] {
        let server = Process::patient(&["--rate", rate, "--duration", "1"]);
        let address = server.address.clone();
        let mut client = JsonLines::greeted(&address);
        client.ask(r#"{"id": 1, "op": "subscribe", "every": 1}"#);
        let stats = client.ask(r#"{"id": 2, "op": "stats"}"#);
        for name in ["late_ticks", "skipped_ticks", "missed_ticks"] {
            assert!(stats["ok"][name].is_u64(), "{name} is counted apart: {stats}");
        }
        let (last_words, status) = server.end();
        assert_eq!(status.code(), Some(0), "at {rate} Hz: {last_words}");
        // Each deadline of a second is either ticked or counted as skipped.
        let count = |before: &str, after: &str| -> u64 {
            let rest =
                last_words.split(before).nth(1).unwrap_or_else(|| panic!("no {before:?}: {last_words}"));
            rest.split(after)
                .next()
                .and_then(|n| n.trim().parse().ok())
                .unwrap_or_else(|| panic!("{last_words}"))
        };
        let (ticks, skipped) = (count("stopped after ", " ticks"), count(" late, ", " skipped"));
        let deadlines: u64 = rate.parse().expect("a number");
        // Deadlines skipped at the very end can lie beyond the second.
        assert!(ticks <= deadlines && ticks + skipped >= deadlines, "at {rate} Hz: {last_words}");
    }
}

#[test]
fn a_client_renders_for_itself_and_its_torque_ends_when_it_falls_silent() {
    let server = Process::patient(&[]);
    let mut client = JsonLines::greeted(&server.address);
    client.ask(r#"{"id": 1, "op": "acquire"}"#);
    client.ask(r#"{"id": 2, "op": "load_scene", "scene": {"name": "nothing", "effect": [], "simulate": {"hand": {"stiffness": 50, "damping": 1, "amplitude": 0}}}}"#);
    client.ask(r#"{"id": 3, "op": "subscribe", "every": 1}"#);
    // Repeats the attempt if the machine stood still during it.
    let ticks =
        (1..=PATIENCE.as_secs()).find_map(|seq| push_once(&mut client, seq)).expect("120 ms in one piece");
    // 100 ms valid and 20 ms ramp. The slew limit of 200 N m/s takes a tick at each end.
    assert!((115..=125).contains(&ticks), "{ticks} ticks");
}

/// Returns the number of ticks in which a torque that is valid for 100 ms acts. Returns `None` if a
/// tick was skipped, or was so late that it caused a fault.
fn push_once(client: &mut JsonLines, seq: u64) -> Option<u64> {
    let tick = |state: &serde_json::Value| state["tick"].as_u64().expect("a tick");
    let from = tick(&active(client)) + 100;
    client.state(|s| tick(s) >= from);
    client.send(&format!(
        "{{\"op\": \"torque\", \"torque\": [0.1, 0.02, -0.05], \"valid_ms\": 100, \"seq\": {seq}}}\n"
    ));
    let still = |s: &serde_json::Value| norm(&s["torque"]) == 0.0;
    let begun = client.state(|s| !still(s) || s["mode"] != "active");
    let (mut last, mut sent_whole) = (begun.clone(), false);
    while !still(&last) {
        let torque = vector(&last["torque"]);
        sent_whole |= torque.iter().zip([0.1, 0.02, -0.05]).all(|(got, sent)| (got - sent).abs() < 1e-9);
        let next = client.state(|_| true);
        if tick(&next) != tick(&last) + 1 || next["mode"] != "active" {
            println!("this machine stood still: {next}");
            return None;
        }
        last = next;
    }
    if last["mode"] != "active" {
        return None;
    }
    assert!(sent_whole, "the torque that was sent, in N");
    assert_eq!(begun["client"]["seq"], seq);
    Some(tick(&last) - tick(&begun))
}

/// The command says where the sphere stopped, that another client has taken the lease, and what to
/// do about a rig that makes no torque.
#[test]
fn a_hand_turns_the_sphere_and_says_what_became_of_it() {
    let server = Process::patient(&[]);
    let command = |args: &[&str]| {
        let mut command = hbot();
        command.args(args).args(["--server", &server.address]);
        assert_cmd::Command::from_std(command).timeout(PATIENCE).assert()
    };
    let turn = ["hand", "turn", "n3", "20deg", "--over", "1s"];
    command(&turn)
        .success()
        .stdout(contains("the sphere stopped after ").and(contains("asked for 20.00 deg")));
    let mut client = JsonLines::greeted(&server.address);
    let mut slow = hbot();
    slow.args(["hand", "turn", "n3", "60deg", "--over", "60s", "--server", &server.address]);
    let slow = slow.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("it starts");
    client.until(|value| value["event"] == "lease" && value["cause"] == "acquired");
    command(&["set", "spring", "stiffness=2", "--steal"]).success();
    let ended = slow.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(!ended.status.success() && said.contains("the lease was lost "), "{said}");
    let too_fast = ["hand", "turn", "n1", "175deg", "--over", "0.1s", "--stiffness", "100"];
    command(&too_fast).code(1).stdout(contains("in the mode fault overspeed: the torque is off"));
    command(&["estop"]).success();
    command(&turn).success().stdout(contains(format!("`hbot reset --server {}`, then ", server.address)));
}
