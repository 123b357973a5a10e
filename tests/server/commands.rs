//! Commands that are clients of a running server: `info`, `stats`, `set`, `watch`, `record`, `scene
//! show` and `scene load`, and the lease that some of them take. Also the files that a recording
//! does not overwrite.

use std::io::{BufRead as _, BufReader};
use std::os::unix::process::ExitStatusExt as _;
use std::process::Stdio;
use std::time::{Duration, Instant};

use assert_cmd::assert::Assert;
use hbot_config::SceneFile;
use hbot_config::scene::ShelfScene;
use hbot_testing::lines::norm;
use hbot_testing::patience::until;
use predicates::str::starts_with;

use crate::process::*;

/// Runs a command that finds the server by the variable HBOT_SERVER.
fn run(server: &Process, args: &[&str]) -> Assert {
    let mut command = assert_cmd::Command::from_std(hbot());
    command
        .args(args)
        .env("HBOT_SERVER", &server.address)
        .timeout(std::time::Duration::from_secs(60))
        .assert()
}

#[test]
fn the_banner_and_info_say_first_whether_motors_can_push() {
    let server = Process::patient(&[]);
    let first = server.banner.lines().next().expect("a line");
    assert!(first.contains("SIMULATED rig, no motors; it enables itself"), "{first}");
    run(&server, &["info"]).success().stdout(
        starts_with("SIMULATED Hbot prototype on ").and(contains("lease      free")).and(contains("spring")),
    );
    run(&server, &["info", "--json"])
        .success()
        .stdout(contains(r#""simulated":true"#).and(contains(r#""controllers":[{"joint":0,"port":"sim""#)));
    run(&server, &["stats"]).success().stdout(contains("late, ").and(contains("lateness_us")));
    run(&server, &["stats", "--json"]).success().stdout(contains(r#""late_ticks":"#));
}

#[test]
fn info_shows_the_limits_of_energy_rounded_for_people() {
    let server =
        Process::altered("passivity = true ", "passivity = { allowance = 0.1, store = 0.3000000000000004 } ");
    run(&server, &["info"])
        .success()
        .stdout(contains("damps what delay creates beyond 0.1 J, with a store of 0.3 J, by up to "));
}

#[test]
fn set_changes_the_running_scene_and_show_prints_it() {
    let server = Process::patient(&[]);
    run(&server, &["set", "spring", "stiffness=2", "deadband=5 deg"]).success().stdout(
        contains("spring: stiffness = 2 N m/rad (before: 1 N m/rad)")
            .and(contains("deadband = 5 deg (before: 0 deg)")),
    );
    run(&server, &["set", "spring", "deadband=0"])
        .success()
        .stdout(contains("deadband = 0 rad (before: 0.0873 rad)"));
    run(&server, &["set", "spring", "stiffness=3 N m/rad"])
        .success()
        .stdout(contains("stiffness = 3 N m/rad"));
    run(&server, &["set", "spring", "stiffness=2"]).success();
    let shown = run(&server, &["scene", "show"]).success();
    let text = String::from_utf8(shown.get_output().stdout.clone()).expect("UTF-8");
    let scene = SceneFile::from_toml(&text, "shown").unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!((scene.name(), &scene.effects()[0].to_json()["stiffness"]), ("Spring", &2.0.into()));
    // The prototype keeps 496 N m/rad at most (docs/stability.md). Nobody types 500 on purpose.
    for (stiffness, warned) in [("300", false), ("500", true), ("[[1, 0, 0], [0, 500, 0], [0, 0, 1]]", true)]
    {
        let set = run(&server, &["set", "spring", &format!("stiffness={stiffness}"), "deadband=0"]).success();
        let said = String::from_utf8_lossy(&set.get_output().stderr).into_owned();
        let unstable = said.contains("the scene has 500 N m/rad") && said.contains("with any damping");
        assert_eq!(unstable, warned, "{stiffness}: {said}");
    }
    // With the lead, 258 N m/rad are stable with the spring's 0.02 N m s/rad.
    run(&server, &["set", "spring", "stiffness=300"])
        .success()
        .stderr(contains("warning: spring: may shake the sphere"));
    run(&server, &["set", "sprung", "stiffness=2"]).failure().stderr(contains("legal: spring"));
    run(&server, &["set", "spring", "stifness=2"]).failure().stderr(contains("did you mean `stiffness`"));
    run(&server, &["set", "spring", "stiffness"]).code(2).stderr(contains("KEY=VALUE"));
    run(&server, &["set", "stiffness=2"]).code(2).stderr(contains("name the effect first"));
}

/// `enable` after a stop sends the user to `info`, so `info` must say what to do.
#[test]
fn info_says_after_a_stop_how_torque_comes_back() {
    let server = Process::patient(&[]);
    let back = "the rig is stopped. When it is safe: `hbot reset`, then `hbot enable`";
    run(&server, &["estop"]).success().stdout(format!("estop: {back}\n"));
    run(&server, &["enable"]).failure().stderr(contains("`hbot info` shows the cause"));
    let stopped = contains(format!("mode       estop: {back}\n"));
    let by = contains("  cause      at ").and(contains(": stopped by client \"hbot "));
    let explained =
        contains("  explain    what happened before: `hbot explain ").and(contains("-estop.csv`\n"));
    run(&server, &["info"]).success().stdout(stopped.and(by).and(explained));
    let idle = "idle: the torque is off. `hbot enable` switches it on\n";
    run(&server, &["reset"]).success().stdout(idle);
    run(&server, &["info"])
        .success()
        .stdout(contains(format!("mode       {idle}")).and(contains("cause").not()));
    let on = "active: the torque is on. `hbot estop` stops the rig at once\n";
    run(&server, &["enable"]).success().stdout(on);
}

#[test]
fn words_of_panic_stop_the_rig() {
    let server = Process::patient(&[]);
    for word in ["stop", "halt", "e-stop", "emergency-stop"] {
        run(&server, &[word]).success().stdout(starts_with("estop: "));
        run(&server, &["reset"]).success().stdout(starts_with("idle: "));
    }
}

/// A stop is carried out although its line is wrong, by the server that the line names.
#[test]
fn a_stop_with_words_that_are_not_understood_stops_first() {
    let server = Process::patient(&[]);
    let mut client = JsonLines::greeted(&server.address);
    for odd in [&["estop", "--steal", "--json"][..], &["STOP", "now"], &["panic", "-f"]] {
        let said = contains("not understood: \"").and(contains(format!("{} is stopped", server.address)));
        run(&server, odd).code(2).stdout(starts_with("estop: ")).stderr(said);
        run(&server, &["reset"]).success();
    }
    let here = contains(format!("`hbot reset --server {}`", server.address));
    crate::process::run(&["--server", &server.address, "stop"]).code(0).stdout(here.clone());
    run(&server, &["reset"]).success();
    crate::process::run(&["Estop", &server.address]).success().stdout(here);
    assert_eq!(client.ask(r#"{"id": 1, "op": "info"}"#)["ok"]["mode"], "estop");
    crate::process::run(&["estop", "--server", "http://lab"]).code(1).stderr(contains("NOT STOPPED: "));
}

/// Who presses Ctrl-C while the torque rises wants none.
#[test]
fn an_enable_that_a_signal_breaks_off_takes_the_torque_away() {
    let server = Process::patient(&[]);
    let mut watcher = JsonLines::greeted(&server.address);
    watcher.ask(r#"{"id": 1, "op": "subscribe", "every": 1}"#);
    // On a busy machine the torque can have risen before the signal arrives.
    let broken_off = (0..20).any(|_| {
        run(&server, &["disable"]).success();
        watcher.state(|state| state["mode"] == "idle");
        let mut enable = hbot();
        enable.args(["enable", "--server", &server.address]).stderr(Stdio::piped()).stdout(Stdio::piped());
        let enable = enable.spawn().expect("the binary runs");
        watcher.state(|state| state["mode"] == "enabling");
        let _ = kill_process(Pid::from_child(&enable), Signal::INT);
        let output = enable.wait_with_output().expect("it ends");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.signal().is_some(), said.contains("enable was broken off"), "{said}");
        output.status.signal().is_some()
    });
    assert!(broken_off, "it never was");
    let info = watcher.ask(r#"{"id": 2, "op": "info"}"#);
    assert_eq!(info["ok"]["mode"], "idle", "{info}");

    // A signal that comes while the server does not answer yet: the order is not sent any more.
    server.signal(Signal::STOP);
    let mut enable = hbot();
    enable.args(["enable", "--server", &server.address]).stderr(Stdio::null()).stdout(Stdio::null());
    let mut enable = enable.spawn().expect("the binary runs");
    let status = format!("/proc/{}/status", enable.id());
    eventually("the command takes signals", || {
        let status = std::fs::read_to_string(&status).unwrap_or_default();
        let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap_or_default();
        u64::from_str_radix(caught.trim(), 16).is_ok_and(|caught| caught & 1 << 1 != 0)
    });
    let _ = kill_process(Pid::from_child(&enable), Signal::INT);
    server.signal(Signal::CONT);
    assert!(enable.wait().expect("it ends").signal().is_some());
    watcher.send(r#"{"id": 3, "op": "info"}"#);
    watcher.until(|line| {
        assert_ne!(line["mode"], "enabling", "{line}");
        line["id"] == 3
    });
}

/// A stop that a suspended server has not confirmed still stops the rig when the server runs again.
#[test]
fn a_stop_that_a_suspended_server_does_not_answer_is_not_lost() {
    let server = Process::patient(&[]);
    server.signal(Signal::STOP);
    let silent = "the server is there but does not answer (it may be suspended or overloaded): no answer to hello within 5 s";
    let lost = format!(
        "NOT STOPPED: the server at {} has not confirmed the stop ({silent}). Cut the motors' power.",
        server.address
    );
    let first = "NOT STOPPED yet: no answer within 1 s. Cut the motors' power.";
    run(&server, &["estop"]).code(1).stderr(contains(first).and(contains(lost)));
    let lost = format!("NOT DISABLED: the server at {} has not confirmed it ({silent})", server.address);
    run(&server, &["disable"]).code(1).stderr(contains(lost));
    run(&server, &["enable"]).code(1).stderr(contains("If the sphere still pushes, cut the motors' power."));
    server.signal(Signal::CONT);
    eventually("the rig is stopped", || {
        let info = run(&server, &["info"]).success();
        String::from_utf8_lossy(&info.get_output().stdout).contains("mode       estop")
    });
}

/// The torque falls for 50 ms after the order.
#[test]
fn disable_ends_when_the_torque_has() {
    let server = Process::patient(&[]);
    let state = |wanted: &dyn Fn(f64) -> bool| {
        let mut watcher = JsonLines::greeted(&server.address);
        watcher.ask(r#"{"id": 1, "op": "subscribe", "every": 1}"#);
        norm(&watcher.state(|state| wanted(norm(&state["torque"])))["torque"])
    };
    state(&|torque| torque > 0.2);
    run(&server, &["disable"]).success().stdout(contains("idle: the torque is off"));
    assert_eq!(state(&|_| true), 0.0);
}

/// Somebody enables the rig again before its torque is zero.
#[test]
fn disable_says_that_the_torque_is_on_again() {
    let server = Process::with(&["--time", "virtual"]);
    let mut holder = JsonLines::greeted(&server.address);
    holder.ask(r#"{"id": 1, "op": "acquire"}"#);
    holder.ask(r#"{"id": 2, "op": "advance", "ticks": 1000}"#);
    // The time stands still: the order is carried out, and no state follows.
    run(&server, &["disable"]).success().stdout(contains("idle: the torque is off"));
    let advance = |holder: &mut JsonLines, ticks: u32| {
        let state = holder.ask(&format!(r#"{{"id": 3, "op": "advance", "ticks": {ticks}}}"#));
        state["ok"]["mode"].as_str().expect("a mode").to_owned()
    };
    holder.ask(r#"{"id": 4, "op": "enable"}"#);
    assert_eq!(advance(&mut holder, 1000), "active");
    let mut disable = hbot();
    disable.args(["disable", "--server", &server.address]).stderr(Stdio::piped());
    let mut disable = disable.spawn().expect("the binary runs");
    until("it is disabled", || (advance(&mut holder, 1) == "idle").then_some(()));
    holder.ask(r#"{"id": 5, "op": "enable"}"#);
    until("the command ends", || {
        advance(&mut holder, 1);
        disable.try_wait().expect("a child")
    });
    let output = disable.wait_with_output().expect("it has ended");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && said.starts_with("error: NOT DISABLED: the torque is on"), "{said}");
}

#[test]
fn commands_take_the_lease_from_another_client_only_with_steal() {
    let server = Process::patient(&[]);
    let mut other = JsonLines::greeted(&server.address);
    for command in
        [&["set", "spring", "stiffness=2"][..], &["scene", "load", "clay"], &["reset"], &["enable"]]
    {
        other.ask(r#"{"id": 1, "op": "acquire"}"#);
        run(&server, command).failure().stderr(contains("holds the lease").and(contains("add `--steal`")));
        // `reset` and `enable` can be refused for other reasons, but not for the lease.
        let stolen = run(&server, &[command, &["--steal"]].concat());
        let said = String::from_utf8_lossy(&stolen.get_output().stderr).into_owned();
        assert!(!said.contains("lease"), "{command:?}: {said}");
    }
    run(&server, &["info"]).success().stdout(contains("scene      Clay"));
}

/// A change that cannot be made is refused before it takes the lease from the client that has it.
#[test]
fn a_set_that_cannot_be_made_steals_nothing() {
    let server = Process::patient(&[]);
    let mut other = JsonLines::greeted(&server.address);
    for (command, why) in [
        (
            &["set", "spring", "stiffness=-1", "--steal"][..],
            "effect \"spring\": stiffness: -1 is out of range",
        ),
        (&["set", "spring", "stifness=2", "--steal"], "effect \"spring\": stifness: unknown key"),
        (
            &["set", "sprung", "stiffness=2", "--steal"],
            "no effect has the id \"sprung\" (did you mean `spring`?); legal: spring",
        ),
    ] {
        other.ask(r#"{"id": 1, "op": "acquire"}"#);
        run(&server, &["info"]).success().stdout(contains("lease      held by a test"));
        run(&server, command).failure().stderr(contains(why));
        run(&server, &["info"]).success().stdout(contains("lease      held by a test"));
    }
    // One that can be made takes it, and the victim is told who did.
    run(&server, &["set", "spring", "stiffness=2", "--steal"]).success();
    let stolen = other.until(|line| line["event"] == "lease" && line["cause"] == "stolen");
    assert!(stolen["by"]["name"].as_str().is_some_and(|name| name.starts_with("hbot set ")), "{stolen}");
}

/// The lease is free again after a command has stolen it, also if the server refused the command.
#[test]
fn a_refused_command_gives_back_the_lease_that_it_has_stolen() {
    let server = Process::patient(&[]);
    let mut other = JsonLines::greeted(&server.address);
    run(&server, &["estop"]).success();
    other.ask(r#"{"id": 1, "op": "acquire"}"#);
    run(&server, &["info"]).success().stdout(contains("lease      held by a test"));
    run(&server, &["enable", "--steal"]).failure().stderr(contains("`hbot reset`, then `hbot enable`"));
    run(&server, &["info"]).success().stdout(contains("lease      free"));
}

#[test]
fn a_scene_that_is_loaded_and_a_scene_that_runs_say_what_they_feel_like() {
    let server = Process::patient(&["--scene", "compass"]);
    assert!(server.banner.contains("scene    Compass"), "{}", server.banner);
    let words = |name: &str| ShelfScene::named(name).expect("on the shelf").scene().description().to_owned();
    run(&server, &["info"]).success().stdout(contains(words("compass")));
    run(&server, &["scene", "load", "clay"]).success().stdout(contains(words("clay")));
    run(&server, &["info"]).success().stdout(contains(words("clay")).and(contains(words("compass")).not()));
}

/// A line that loses every frame makes the fault by itself, so the advice is about the scene.
#[test]
fn a_scene_whose_line_loses_every_frame_is_named_by_the_fault_and_an_ideal_rig_goes_on() {
    let server = Process::with(&["--time", "virtual"]);
    let mut client = JsonLines::greeted(&server.address);
    let scene = server.folder().join("lossy.toml");
    std::fs::write(&scene, "[simulate]\nlink = { loss = 1.0 }\n").expect("written");
    run(&server, &["scene", "load", scene.to_str().expect("UTF-8")]).success();
    let fault = client.until(|line| line["event"] == "fault");
    let said = fault["message"].as_str().expect("a text");
    assert_eq!(fault["fault"], "link_lost", "{said}");
    assert!(said.contains("[simulate.link] loses frames (loss = 1)"), "{said}");
    let remedy = fault["remedy"].as_str().expect("a text");
    assert!(remedy.contains("load the scene with a smaller `loss`"), "{remedy}");
    let still =
        contains("the cause of fault link_lost is still there").and(contains("scene load NAME --ideal"));
    run(&server, &["reset"]).failure().stderr(still);
    run(&server, &["hand", "turn", "n1", "30deg"]).failure().stderr(contains("there are no readings"));
    let keeps = contains("keeps that of the scene").and(contains("`hbot scene load NAME --ideal`"));
    run(&server, &["scene", "load", "spring"]).success().stderr(keeps);
    run(&server, &["scene", "load", "spring", "--ideal"])
        .success()
        .stderr(starts_with("fault: the torque is off. "));
    let unseen = contains("the sphere may have turned unseen");
    run(&server, &["reset"]).success().stdout(starts_with("idle: ")).stderr(unseen);
}

/// In virtual time, a second of the run takes far less than a second of the clock.
#[test]
fn a_recording_lasts_as_long_as_the_clock_says_and_overwrites_nothing() {
    let server = Process::with(&["--time", "virtual"]);
    let file = server.folder().join("x.mcap");
    let file = file.to_str().expect("UTF-8");
    let record = ["record", file, "--every", "1000", "--duration", "1"];
    let begun = Instant::now();
    // Whether states are lost depends on the machine, and with it the exit code.
    let recorded = run(&server, &record);
    assert!(begun.elapsed() >= Duration::from_secs(1), "{:?}", begun.elapsed());
    let said = String::from_utf8_lossy(&recorded.get_output().stdout).into_owned();
    assert!(said.contains(" states recorded, ") && said.contains(" lost"), "{said}");
    let before = std::fs::read(file).expect("a recording");
    run(&server, &record).failure().stderr(contains(file).and(contains("exists already. Name another one")));
    assert!(std::fs::read(file).expect("a recording") == before, "it is not touched");
}

#[test]
fn a_recording_that_ends_before_its_time_says_why() {
    let folder = tempfile::tempdir().expect("a folder");
    for (signal, duration, code, said) in [
        (Signal::KILL, "60", 1, "the recording is shorter than wanted: the connection broke after "),
        (Signal::KILL, "", 1, "the recording is shorter than wanted: the connection broke after "),
        (Signal::TERM, "60", 1, "the recording is shorter than wanted: the server stopped after "),
        (Signal::TERM, "", 0, "the server stopped after "),
    ] {
        let server = Process::patient(&[]);
        let file = folder.path().join(format!("{}{duration}.mcap", signal.as_raw()));
        let mut record = hbot();
        record.arg("record").arg(&file).args(["--every", "10", "--server", &server.address]);
        if !duration.is_empty() {
            record.args(["--duration", duration]);
        }
        let record = record.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it runs");
        eventually("some states", || std::fs::metadata(&file).is_ok_and(|found| found.len() > 4000));
        server.signal(signal);
        let ended = record.wait_with_output().expect("it ends");
        let [out, err] = [ended.stdout, ended.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
        assert!(out.contains(" states recorded"), "the file has its end: {out}{err}");
        assert!(err.contains(said) && err.contains(" of 60 s") == (duration == "60"), "{signal:?}: {err}");
        // Whether states are lost depends on the machine.
        assert!(
            ended.status.code() == Some(code) || err.contains("drops the next ones"),
            "{signal:?}: {err}"
        );
    }
}

/// Returns the number before `word` in a text.
fn number_before(word: &str, text: &str) -> u64 {
    let before = text.split(word).next().and_then(|before| before.split_whitespace().last());
    before
        .and_then(|number| number.parse().ok())
        .unwrap_or_else(|| panic!("no number before {word:?}: {text}"))
}

#[test]
fn a_server_that_records_counts_as_many_ticks_as_its_recording_has() {
    let state = tempfile::tempdir().expect("a folder");
    let [file, other] = ["x.mcap", "y.mcap"].map(|name| state.path().join(name));
    let [file, other] = [&file, &other].map(|path| path.to_str().expect("UTF-8"));
    let rig = patient_rig(state.path());
    let server = Process::start(&["--rig", &rig, "--record", file], state.path());
    assert!(server.banner.starts_with(&format!("recording to {file}\n")), "{}", server.banner);
    // Without subscribers, samples wait for the service until it has another reason to wake.
    let mut client = JsonLines::greeted(&server.address);
    eventually("some ticks", || {
        client.ask(r#"{"id": 1, "op": "stats"}"#)["ok"]["ticks"].as_u64() > Some(200)
    });
    server.signal(Signal::INT);
    let (said, status) = server.end();
    assert!(status.success(), "{said}");
    let [ticks, recorded, lost] =
        [" ticks: ", " ticks recorded", " lost, "].map(|word| number_before(word, &said));
    assert_eq!(ticks, recorded + lost, "{said}");
    let bytes = std::fs::metadata(file).expect("a recording").len() as f64;
    // How long it runs depends on the machine.
    let size =
        if bytes < 1.0e6 { format!("{:.1} kB", bytes * 1.0e-3) } else { format!("{:.1} MB", bytes * 1.0e-6) };
    assert!(said.contains(&format!("recorded to {file}: {size}\n")), "{size}: {said}");

    use crate::process::run;

    run(&["server", "--listen", "127.0.0.1:0", "--record", file])
        .failure()
        .stderr(contains(file).and(contains("exists already. Name another one, or a folder")));
    run(&["replay", file, "--from", "1000"])
        .failure()
        .stderr(contains(" s of the run (tick ").and(contains("the recording ends at ")));
    run(&["rig", "identify", "--rig", &rig, file]).stderr(contains("recorded on the simulated rig"));
    std::fs::write(other, "mine").expect("written");
    run(&["replay", file, "--scene", "clay", "--out", other])
        .failure()
        .stderr(contains(other).and(contains("exists already. Name another one")));
    assert_eq!(std::fs::read_to_string(other).expect("readable"), "mine");
    std::fs::remove_file(other).expect("removed");
    run(&["replay", file, "--scene", "clay", "--out", other])
        .stdout(contains("computed with the other scene"));
}

/// The run goes on without its recording, and the exit code tells a script that it is missing.
#[test]
fn a_recording_that_cannot_be_written_ends_with_an_exit_code_of_its_own() {
    let state = tempfile::tempdir().expect("a folder");
    std::fs::write(state.path().join("blocked"), "a file where the folder should be").expect("written");
    let args = ["server", "--listen", "127.0.0.1:0", "--time", "virtual", "--duration", "1", "--record"];
    // Files may have 8 kB at most.
    let limited = |path: &str| {
        let mut shell = assert_cmd::Command::new("bash");
        shell.args(["-c", "ulimit -f 8; exec \"$@\"", "limited", env!("CARGO_BIN_EXE_hbot")]).args(args);
        let shell = shell.arg(state.path().join(path)).env("XDG_STATE_HOME", state.path());
        shell.timeout(Duration::from_secs(60)).assert()
    };
    limited("run.mcap")
        .code(3)
        .stdout(contains("0 ticks recorded").and(contains("1 file failed")))
        .stderr(contains("the recording cannot be written"));
    // A folder that is made is told.
    limited("new/run.mcap").code(3).stderr(contains("new: this folder is new"));
    limited("new/other.mcap").code(3).stderr(contains("this folder is new").not());
    // Where no file can be made at all, the run does not begin.
    limited("blocked/run.mcap").code(1).stderr(contains("blocked/run.mcap: no file can be made there"));
    let told = contains("3  the run was good, but a file of --record");
    crate::process::run(&["server", "--help"]).success().stdout(told);
}

#[test]
fn stats_explains_its_rows() {
    let help = |command: &str| {
        let mut program = assert_cmd::Command::from_std(hbot());
        program.args([command, "--help"]).env("HBOT_SERVER", "rig:1").assert().success()
    };
    let rows = contains("link_us ").and(contains("time spent on reading"));
    help("stats").stdout(rows.and(contains("[env: HBOT_SERVER]")).and(contains("rig:1").not()));
    help("info").stdout(contains("link_us ").not());
}

#[test]
fn watch_explains_its_columns() {
    let columns = contains("part of the wanted torque that is applied").and(contains("N m"));
    crate::process::run(&["watch", "--help"]).success().stdout(columns.and(contains("late us")));
    let server = Process::patient(&[]);
    let mut watch = hbot();
    let mut watch =
        watch.args(["watch", "--server", &server.address]).stdout(Stdio::piped()).spawn().expect("it runs");
    let lines = BufReader::new(watch.stdout.take().expect("piped")).lines();
    let first: Vec<String> = lines.take(3).map(|line| line.expect("UTF-8")).collect();
    watch.kill().expect("it runs");
    watch.wait().expect("it ends");
    assert!(first[1].contains("scale: part of the wanted torque"), "{first:?}");
    assert!(first[2].contains("torque N m") && first[2].contains("length"), "{first:?}");
}

#[test]
fn watch_tells_the_largest_torque_also_if_the_server_ends() {
    for (signal, code) in [(Signal::TERM, 0), (Signal::KILL, 1)] {
        let server = Process::patient(&[]);
        let mut watch = hbot();
        watch.args(["watch", "--server", &server.address]).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut watch = watch.spawn().expect("it runs");
        let mut lines = BufReader::new(watch.stdout.take().expect("piped")).lines().map_while(Result::ok);
        assert_eq!(lines.by_ref().take(5).count(), 5);
        server.signal(signal);
        let last = lines.last().unwrap_or_default();
        assert!(last.starts_with("the largest length in ") && last.ends_with(" N m"), "{last}");
        assert_eq!(watch.wait().expect("it ends").code(), Some(code));
    }
}

#[test]
fn a_turn_of_the_hand_that_a_signal_ends_says_where() {
    let server = Process::patient(&[]);
    let mut turn = hbot();
    turn.args(["hand", "turn", "n2", "20deg", "--over", "60s", "--server", &server.address]);
    let turn = turn.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("it runs");
    let held = || {
        let info = run(&server, &["info"]).success();
        String::from_utf8_lossy(&info.get_output().stdout).contains("lease      held by hbot hand")
    };
    eventually("the hand turns", held);
    rustix::process::kill_process(rustix::process::Pid::from_child(&turn), Signal::INT).expect("it is there");
    let ended = turn.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(said.contains("the turn was broken off after ") && said.contains(" deg"), "{said}");
    assert_eq!(ended.status.signal(), Some(2), "a loop of a shell ends too");
}

/// Without a state, `watch` says once that it knows nothing, and goes on when states come again.
#[test]
fn watch_tells_a_silence_of_the_server_once() {
    let server = Process::patient(&[]);
    let mut watch = hbot()
        .args(["watch", "--json", "--server", &server.address])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it runs");
    let mut states = BufReader::new(watch.stdout.take().expect("piped")).lines();
    let mut notes = BufReader::new(watch.stderr.take().expect("piped")).lines();
    let mut note = || notes.next().map(|line| line.expect("UTF-8"));
    let silence = "no state for 2 s: what the rig does is not known";
    for _ in 0..2 {
        // More states than can have waited in the pipes.
        assert_eq!(states.by_ref().take(20).count(), 20);
        server.signal(Signal::STOP);
        assert_eq!(note().as_deref(), Some(silence));
        // The silence lasts longer than that.
        std::thread::sleep(Duration::from_secs(3));
        server.signal(Signal::CONT);
    }
    assert_eq!(states.by_ref().take(20).count(), 20);
    server.signal(Signal::TERM);
    assert_eq!((note().as_deref(), note()), (Some("the server stops"), None), "each silence was told once");
    // Nobody has read the last states.
    drop(states);
    assert!(watch.wait().expect("it ends").success());
}

#[test]
fn a_token_file_is_found_by_its_variable_and_its_absence_names_it() {
    let state = tempfile::tempdir().expect("a folder");
    let token = state.path().join("token");
    std::fs::write(&token, "a token of more than sixteen").expect("written");
    let file = token.to_str().expect("UTF-8");
    let server = Process::start(&["--rig", &patient_rig(state.path()), "--token-file", file], state.path());
    run(&server, &["info"]).failure().stderr(contains("--token-file FILE").and(contains("HBOT_TOKEN_FILE")));
    let mut with = assert_cmd::Command::from_std(hbot());
    with.args(["info", "--server", &server.address]).env("HBOT_TOKEN_FILE", file).assert().success();
}

/// Whether a server asks for a token only the server knows, so a stop does not wait for its file.
#[test]
fn a_stop_is_sent_even_if_the_token_file_cannot_be_read() {
    let state = tempfile::tempdir().expect("a folder");
    let gone = state.path().join("gone");
    let stop = |server: &Process| {
        let mut command = assert_cmd::Command::from_std(hbot());
        command.args(["estop", "--server", &server.address]).env("HBOT_TOKEN_FILE", &gone).assert()
    };
    stop(&Process::patient(&[])).success().stdout(starts_with("estop"));

    let token = state.path().join("token");
    std::fs::write(&token, "a token of more than sixteen").expect("written");
    let file = token.to_str().expect("UTF-8");
    let server = Process::start(&["--rig", &patient_rig(state.path()), "--token-file", file], state.path());
    let unread = format!("; token file {}: ", gone.display());
    stop(&server)
        .code(1)
        .stderr(contains("NOT STOPPED").and(contains(unread)).and(contains("). Cut the motors' power.")));
}

/// A variable that is set and empty counts as one that is not set, as usual in shells.
#[test]
fn empty_variables_are_as_if_unset() {
    let server = Process::patient(&[]);
    let mut command = assert_cmd::Command::from_std(hbot());
    command.args(["info", "--server", &server.address]).env("HBOT_TOKEN_FILE", "").assert().success();
    // Whether a server listens at the default address or not, it is the one that is asked.
    let mut command = assert_cmd::Command::from_std(hbot());
    let said = command.arg("info").env("HBOT_SERVER", "").env("HBOT_TOKEN_FILE", "").assert();
    let output = said.get_output();
    let text =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("127.0.0.1:4268"), "{text}");
}
