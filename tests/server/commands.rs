//! Commands that are clients of a running server: `info`, `stats`, `set`, `scene show` and `scene
//! load`, and the lease that some of them take.

use assert_cmd::assert::Assert;
use hbot_config::SceneFile;
use hbot_testing::lines::JsonLines;
use predicates::prelude::PredicateBooleanExt as _;
use predicates::str::{contains, starts_with};

use crate::process::{Process, hbot, patient_rig};

fn server(state: &std::path::Path) -> Process {
    Process::start(&["--rig", &patient_rig(state)], state)
}

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
    let state = tempfile::tempdir().expect("a folder");
    let server = server(state.path());
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
fn set_changes_the_running_scene_and_show_prints_it() {
    let state = tempfile::tempdir().expect("a folder");
    let server = server(state.path());
    run(&server, &["set", "spring", "stiffness=2", "deadband=5 deg"])
        .success()
        .stdout(contains("spring: stiffness = 2.0 (before: 1.0)").and(contains("deadband = 0.0872")));
    let shown = run(&server, &["scene", "show"]).success();
    let text = String::from_utf8(shown.get_output().stdout.clone()).expect("UTF-8");
    let scene = SceneFile::from_toml(&text, "shown").unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!((scene.name(), &scene.effects()[0].to_json()["stiffness"]), ("Spring", &2.0.into()));
    // The prototype keeps 495 N m/rad at most (docs/stability.md). Nobody types 500 on purpose.
    for (stiffness, warned) in [("400", false), ("500", true), ("[[1, 0, 0], [0, 500, 0], [0, 0, 1]]", true)]
    {
        let set = run(&server, &["set", "spring", &format!("stiffness={stiffness}")]).success();
        let said = String::from_utf8_lossy(&set.get_output().stdout).into_owned();
        let unstable = said.contains("500 N m/rad is unstable on this rig with any damping");
        assert_eq!(unstable, warned, "{stiffness}: {said}");
    }
    run(&server, &["set", "sprung", "stiffness=2"]).failure().stderr(contains("legal: spring"));
    run(&server, &["set", "spring", "stifness=2"]).failure().stderr(contains("did you mean `stiffness`"));
    run(&server, &["set", "spring", "stiffness"]).code(2).stderr(contains("KEY=VALUE"));
}

/// `enable` after a stop sends the user to `info`, so `info` must say what to do.
#[test]
fn info_says_after_a_stop_how_torque_comes_back() {
    let state = tempfile::tempdir().expect("a folder");
    let server = server(state.path());
    run(&server, &["estop"]).success();
    run(&server, &["enable"]).failure().stderr(contains("`hbot info` shows the cause"));
    let stopped = "mode       estop: the rig was stopped. When it is safe: `hbot reset`, then `hbot enable`";
    run(&server, &["info"]).success().stdout(contains(stopped));
    run(&server, &["reset"]).success();
    run(&server, &["info"]).success().stdout(contains("mode       idle\n"));
}

#[test]
fn commands_take_the_lease_from_another_client_only_with_steal() {
    let state = tempfile::tempdir().expect("a folder");
    let server = server(state.path());
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

#[test]
fn a_script_completes_commands_in_each_shell() {
    for shell in ["bash", "zsh", "fish"] {
        let mut command = assert_cmd::Command::from_std(hbot());
        command
            .args(["completions", shell])
            .assert()
            .success()
            .stdout(contains("scene").and(contains("hbot")));
    }
}

#[test]
fn every_command_has_a_man_page_that_names_its_options() {
    let folder = tempfile::tempdir().expect("a folder");
    assert_cmd::Command::from_std(hbot()).arg("man").arg(folder.path()).assert().success().stdout("");
    let page = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect(name);
    assert!(page("hbot-server.1").contains(r"\-\-rig"));
    assert!(page("hbot-rig-check.1").contains("hbot\\-rig\\-check"));
    // Each page that a command refers to exists. Hidden commands have none.
    let all = page("hbot.1");
    let named: Vec<&str> =
        all.lines().filter_map(|l| l.strip_prefix("hbot\\-")?.strip_suffix("(1)")).collect();
    assert!(named.len() > 10, "{all}");
    for name in named {
        page(&format!("hbot-{}.1", name.replace("\\-", "-")));
    }
    assert!(!folder.path().join("hbot-last-word.1").exists());

    let nowhere = folder.path().join("nowhere");
    let mut command = assert_cmd::Command::from_std(hbot());
    command.arg("man").arg(&nowhere).assert().failure().stderr(contains("nowhere"));
}
