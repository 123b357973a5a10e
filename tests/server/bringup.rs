//! The machine and the rig before any loop runs: `hbot doctor`, `hbot rig scan`, `rig test`, `rig
//! calibrate`; metrics of one that does.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::os::unix::process::ExitStatusExt as _;
use std::process::Stdio;

use assert_cmd::assert::Assert;
use serde_json::Value;

use crate::process::*;

fn check(text: &str) -> Assert {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("rig.toml");
    std::fs::write(&path, text).expect("written");
    run(&["rig", "check", path.to_str().expect("UTF-8")])
}

#[test]
fn the_doctor_tells_programs_what_it_found_and_the_exit_code_follows() {
    let output = run(&["doctor", "--seconds", "1", "--json"]).get_output().clone();
    let told: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let findings = told["findings"].as_array().expect("a list");
    for id in ["kernel", "governor", "idle_states", "rt_throttling", "priority", "memlock", "punctuality"] {
        assert!(findings.iter().any(|finding| finding["id"] == id), "{id}: {told}");
    }
    assert_eq!(told["punctuality"]["ticks"], 1000);
    assert_eq!(output.status.success(), told["verdict"] != "not_sufficient", "{told}");
    for finding in findings {
        assert_eq!(finding["mend"].is_null(), finding["mark"] == "good", "{finding}");
    }
}

/// The rig file of the prototype with moteus servos.
const MOTEUS: &str = "rigs/prototype-moteus.toml";
/// The prototype with ODrives.
const ODRIVE: &str = "rigs/prototype-odrive.toml";

#[test]
fn odrives_are_listed_and_pass_their_test_and_calibration() {
    let axes = run(&["rig", "scan", "--rig", ODRIVE]).success();
    axes.stdout(contains("sim: 4 answer").and(contains("  3: ODrive")).and(contains("24.0 V")));
    run(&["rig", "test", "--rig", ODRIVE, "--joint", "2", "--torque", "0.002"])
        .success()
        .stdout(contains("drive of wheel A"));
    run(&["rig", "calibrate", "--rig", ODRIVE, "--seconds", "10"])
        .success()
        .stdout(contains("steering zero off by"));
}

#[test]
fn four_odrives_on_one_bus_are_too_many_and_two_fit() {
    let two = include_str!("../../rigs/prototype-odrive.toml")
        .replace("port = \"sim\" ", "port = [\"/dev/ttyACM0\", \"/dev/ttyACM1\"] ");
    check(&two).success().stdout(contains("line /dev/ttyACM1, 1000 Hz, 2 joints").and(contains("fits")));
    let one = two.replace(", \"/dev/ttyACM1\"]", "]").replace("port = 1", "port = 0");
    check(&one).failure().stdout(contains("does not fit").and(contains("2 lines")));
}

#[test]
fn a_scan_lists_the_controllers_of_a_line_whatever_they_speak() {
    run(&["rig", "scan"]).success().stdout(contains("sim: 4 answer").and(contains("hbot-sim")));
    let servos = run(&["rig", "scan", "--rig", MOTEUS]).success();
    let late = "torque 0.8 ms late (servo.pid_dq_hz 199 Hz), rate 3.9 ms late (motor_position.sources.0.pll_filter_hz 202 Hz)";
    let listed = contains("sim: 4 answer").and(contains("  4: moteus r4")).and(contains("24.0 V"));
    servos.stdout(listed.and(contains(late)));
}

#[test]
fn a_check_recommends_the_rates_of_a_kalman_filter_where_those_of_the_controllers_are_late() {
    let advice = "note: the rates of the controllers are 3.9 ms late";
    let text = include_str!("../../rigs/prototype-moteus.toml").replace("\"auto\" ", "\"controller\" ");
    check(&text).success().stdout(contains(advice).and(contains("rate_estimate = \"kalman\"")));
    run(&["rig", "check"]).success().stdout(contains("note:").not());
}

#[test]
fn a_check_says_which_rate_estimate_was_picked_and_why() {
    let said = "rates: rate_estimate = \"auto\" picked kalman with acceleration = ";
    let text = include_str!("../../rigs/prototype.toml").replace("\"controller\" #", "\"auto\" #");
    let why = contains("3.3 mN m that a hand feels").and(contains("because rate_lag is 0"));
    check(&text).success().stdout(contains(said).and(why));
    run(&["rig", "check", MOTEUS]).success().stdout(contains(said).and(contains("note:").not()));
    run(&["rig", "check"]).success().stdout(contains("picked").not());
}

#[test]
fn servos_pass_their_test_and_calibration() {
    run(&["rig", "test", "--rig", MOTEUS, "--joint", "2", "--torque", "0.002"])
        .success()
        .stdout(contains("drive of wheel A"));
    run(&["rig", "calibrate", "--rig", MOTEUS, "--seconds", "10"])
        .success()
        .stdout(contains("steering zero off by"));
}

#[test]
fn a_can_bus_that_is_too_slow_for_the_rate_is_refused_with_what_would_do() {
    let one = include_str!("../../rigs/prototype-moteus.toml")
        .replace("port = \"sim\" ", "port = \"/dev/ttyACM0\" ");
    check(&one)
        .failure()
        .stdout(contains("does not fit").and(contains("2 lines")).and(contains("loop.rate_hz to 778")));
    let two = one.replace("\"/dev/ttyACM0\"", "[\"/dev/ttyACM0\", \"/dev/ttyACM1\"]");
    let two = two.replace("controller = 3", "port = 1\ncontroller = 3");
    let two = two.replace("controller = 4", "port = 1\ncontroller = 4");
    check(&two).success().stdout(contains("line /dev/ttyACM1, 1000 Hz, 2 joints").and(contains("fits")));
}

#[test]
fn a_port_that_is_not_there_is_not_sufficient() {
    run(&["doctor", "--seconds", "1", "--port", "/dev/no-such-port"])
        .failure()
        .stdout(contains("/dev/no-such-port is not there").and(contains("to mend it")));
}

#[test]
fn a_server_that_does_not_answer_is_a_finding_beside_the_others() {
    let told = run(&["doctor", "--seconds", "1", "--json", "--server", "127.0.0.1:1"]).failure();
    let told: serde_json::Value = serde_json::from_slice(&told.get_output().stdout).expect("JSON");
    assert_eq!(
        (&told["verdict"], told["punctuality"]["ticks"].as_u64()),
        (&"not_sufficient".into(), Some(1000))
    );
    let findings = told["findings"].as_array().expect("a list");
    let server = findings.iter().find(|finding| finding["id"] == "server").expect("a finding");
    assert!(server["mend"].as_str().is_some_and(|mend| mend.contains("start it")), "{server}");
}

#[test]
fn each_joint_of_the_simulated_rig_passes_its_test() {
    for joint in ["1", "2", "3", "4"] {
        run(&["rig", "test", "--joint", joint, "--torque", "0.01", "--speed", "50"])
            .success()
            .stdout(contains("good").and(contains(" mN m its counts went the way of the torque, by +0.")));
    }
    run(&["rig", "test", "--joint", "5", "--torque", "0.01"]).failure().stderr(contains("1 to 4"));
    run(&["rig", "test", "--joint", "1", "--torque", "2"]).failure().stderr(contains("0.93"));
    // What a motor may have for a moment only is not held.
    let held = |torque| run(&["rig", "test", "--joint", "1", "--torque", torque, "--hold", "10"]);
    held("0.9").failure().stderr(contains("continuous torque, 0.073 N m"));
    held("auto").failure().stderr(contains("--hold needs a number"));
    run(&["rig", "test", "--joint", "2", "--torque", "0.05", "--speed", "0.1"])
        .failure()
        .stdout(contains("faster than --speed"));
}

#[test]
fn the_simulated_rig_is_as_its_file_says() {
    let by_itself = contains("the simulated hand turns the sphere").and(contains("faster than real time"));
    run(&["rig", "calibrate"]).success().stdout(contains("slip over rolling").and(by_itself));
    // Also where the zero of an encoder was measured.
    let measured = include_str!("../../rigs/prototype.toml").replacen(
        "zero = \"assume\"",
        "zero = \"assume\"\nzero_offset = 0.2 #",
        1,
    );
    let file = tempfile::Builder::new().suffix(".toml").tempfile().expect("a file");
    std::fs::write(&file, measured).expect("written");
    let path = file.path().to_str().expect("UTF-8");
    run(&["rig", "calibrate", "--rig", path]).success().stdout(contains("the rig is as its file says"));
}

#[test]
fn a_new_rig_file_without_a_terminal_has_defaults_and_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("new.toml");
    run(&["rig", "new", path.to_str().expect("UTF-8"), "--cone", "12"])
        .success()
        .stderr(contains("nothing is asked: what no option gives has its default"));
    let text = std::fs::read_to_string(path).expect("it is written");
    assert!(text.contains("cone = \"12 deg\"") && text.contains("port = \"sim\""), "{text}");
    run(&["rig", "new", "/nowhere/new.toml"]).failure().stderr(contains("there is no folder /nowhere"));
}

/// What `rig new` writes, `rig check` accepts, also where the line carries less than 1 kHz.
#[test]
fn a_new_rig_file_passes_its_check_whatever_it_is_made_of() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, protocol, wheels) in [("a", "moteus", "3"), ("b", "odrive", "2"), ("c", "hbot", "8")] {
        let path = folder.path().join(format!("{name}.toml"));
        let path = path.to_str().expect("UTF-8");
        let options =
            ["--protocol", protocol, "--wheels", wheels, "--port", "/dev/ttyACM0", "--radius", "60 mm"];
        run(&[&["rig", "new", path][..], &options].concat()).success();
        run(&["rig", "check", path]).success().stdout(contains("does not fit").not());
        let text = std::fs::read_to_string(path).expect("it is written");
        assert!(text.contains("radius = 0.06 # m") && text.contains("traction = { mu = 0.8,"), "{text}");
        if name == "a" {
            assert!(
                text.contains("rate_hz = 518 # the most that one line carries with 6 joints; 2 lines"),
                "{text}"
            );
        }
    }
    let path = folder.path().join("b.toml");
    let text = std::fs::read_to_string(&path).expect("it is written");
    check(&text.replace("\ntorque = ", "\ntorque = 50 # ")).success().stdout(
        contains("1 warning").and(contains("limits.torque = 50 N m limits nothing: the motors make at most")),
    );
    let lax = text.replace("\nspeed = ", "\nspeed = 900 # ").replace("[link]", "[link]\nwatchdog_ms = 1000");
    check(&lax).success().stdout(
        contains("2 warnings (limit that protects nobody)")
            .and(contains("the motors hold their last torque for 1000 ms"))
            .and(contains("stops a faster one only beyond this")),
    );
    let two = text.replace("port = \"/dev/ttyACM0\"", "port = [\"/dev/a\", \"/dev/b\"]").replacen(
        "\ncontroller = ",
        "\nport = 1\ncontroller = ",
        1,
    );
    std::fs::write(&path, two).expect("written");
    run(&["controllers", "--rig", path.to_str().expect("UTF-8")])
        .failure()
        .stderr(contains("this rig has 2 lines, and one pseudo-terminal stands for one line"));
    // A rig without a word about friction passes, with a warning.
    let without: String =
        text.lines().filter(|line| !line.starts_with("traction")).collect::<Vec<_>>().join("\n");
    std::fs::write(&path, without).expect("written");
    run(&["rig", "check", path.to_str().expect("UTF-8")])
        .success()
        .stdout(contains("1 warning").and(contains("limits.traction is absent: a motor can push with 9 N")));
}

/// The search for the zeros takes a second and more. The motors are off then, so nothing delays a
/// Ctrl-C.
#[test]
fn ctrl_c_ends_a_calibration_while_it_computes() {
    let mut child = hbot()
        .args(["rig", "calibrate", "--port", "sim", "--seconds", "120"])
        .stdout(Stdio::piped())
        .spawn()
        .expect("it runs");
    let mut lines =
        BufReader::new(child.stdout.take().expect("piped")).lines().map(|line| line.expect("UTF-8"));
    lines.find(|line| line.contains("computing from 120000 readings")).expect("it computes");
    kill_process(Pid::from_child(&child), Signal::INT).expect("it is there");
    assert_eq!(child.wait().expect("it ends").signal(), Some(Signal::INT.as_raw()));
    assert_eq!(lines.next(), None, "it went on");
}

#[test]
fn metrics_are_read_over_http_and_only_from_this_machine_without_a_token() {
    let server = Process::with(&["--time", "virtual", "--metrics", "127.0.0.1:0"]);
    let line = server.banner.lines().find(|line| line.starts_with("metrics")).expect("where metrics are");
    let address = line.trim_start_matches("metrics http://").trim_end_matches("/metrics").to_owned();
    let get = |path: &str| {
        let mut stream = std::net::TcpStream::connect(&address).expect("it listens");
        write!(stream, "GET {path} HTTP/1.1\r\nHost: x\r\n\r\n").expect("sent");
        let mut text = String::new();
        stream.read_to_string(&mut text).expect("readable");
        text
    };
    let page = get("/metrics");
    assert!(page.starts_with("HTTP/1.1 200 OK") && page.ends_with("# EOF\n"), "{page}");
    for name in [
        "hbot_ticks_total",
        "hbot_lateness_seconds{quantile=\"0.9999\"}",
        "hbot_faults_total{cause=\"link_lost\"} 0",
    ] {
        assert!(page.contains(name), "{name} in\n{page}");
    }
    assert!(get("/").starts_with("HTTP/1.1 404"));
    run(&["server", "--listen", "127.0.0.1:0", "--metrics", "0.0.0.0:0"])
        .failure()
        .stderr(contains("--metrics-token-file"));
}
