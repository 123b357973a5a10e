//! Wrong input on the command line and in files. The program says what is wrong, where, and what is
//! legal, and its exit code is not 0.

use predicates::str::ends_with;

use crate::process::*;

fn file(text: &str) -> tempfile::NamedTempFile {
    let file = tempfile::Builder::new().suffix(".toml").tempfile().expect("a file");
    std::fs::write(&file, text).expect("written");
    file
}

fn path(file: &tempfile::NamedTempFile) -> &str {
    file.path().to_str().expect("UTF-8")
}

#[test]
fn a_port_that_is_not_there() {
    run(&["server", "--listen", "127.0.0.1:0", "--port", "/dev/no-such-port"])
        .failure()
        .stderr(contains("/dev/no-such-port").and(contains("--port sim")));
}

#[test]
fn a_processor_that_is_not_there() {
    for command in [
        &["server", "--listen", "127.0.0.1:0", "--cpu", "1023"][..],
        &["doctor", "--cpu", "1023", "--seconds", "1"],
    ] {
        let said = run(command).failure();
        let out = said.get_output();
        let text = String::from_utf8_lossy(&out.stdout).into_owned() + &String::from_utf8_lossy(&out.stderr);
        assert!(text.contains("processor 1023 is not there") && text.contains("legal: one of 0"), "{text}");
    }
    run(&["server", "--cpu", "1024"])
        .code(2)
        .stderr(contains("--cpu: 1024 is out of range; legal: 0 to 1023"));
}

/// Only regular files are read. The others here are a FIFO without a writer, an endless device and
/// a folder.
#[test]
fn what_is_no_regular_file_is_not_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let fifo = folder.path().join("fifo");
    let mode = rustix::fs::Mode::from_raw_mode(0o600);
    rustix::fs::mknodat(rustix::fs::CWD, &fifo, rustix::fs::FileType::Fifo, mode, 0).expect("a FIFO");
    for special in [fifo.to_str().expect("UTF-8"), "/dev/zero", "/dev/full", "/"] {
        let server =
            |option| ["server", "--listen", "127.0.0.1:0", option, special].map(str::to_owned).to_vec();
        let check = |what: &str| [what, "check", special].map(str::to_owned).to_vec();
        for command in
            [check("rig"), check("scene"), server("--rig"), server("--scene"), server("--token-file")]
        {
            let command: Vec<&str> = command.iter().map(String::as_str).collect();
            run(&command).failure().stderr(contains(special).and(contains("it is no regular file")));
        }
    }
    let long = folder.path().join("long.toml");
    std::fs::write(&long, "# ".repeat(1 << 20)).expect("written");
    run(&["rig", "check", long.to_str().expect("UTF-8")]).failure().stderr(contains("more than 1 MiB"));
}

#[test]
fn a_rig_that_comes_by_standard_input_is_read() {
    assert_cmd::Command::from_std(hbot())
        .args(["rig", "check", "/dev/stdin"])
        .write_stdin(include_str!("../../rigs/prototype.toml"))
        .assert()
        .success();
}

#[test]
fn an_address_in_use() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = taken.local_addr().expect("an address").to_string();
    let said = |assert: assert_cmd::assert::Assert| {
        // Nothing that sounds like a running server comes before the error.
        assert.failure().code(1).stdout("").stderr(contains(&address).and(contains("another hbot server")));
    };
    said(run(&["server", "--listen", &address]));
    said(run(&["server", "--listen", "127.0.0.1:0", "--foxglove", &address]));
    said(run(&["server", "--listen", "127.0.0.1:0", "--web", &address]));
}

#[test]
fn another_machine_needs_a_token() {
    // Other names for loopback are not accepted as loopback, because the system decides whether
    // they can be reached from elsewhere.
    for other in ["0.0.0.0:0", "[::]:0", "[::ffff:127.0.0.1]:0", "[::ffff:0:0]:0"] {
        run(&["server", "--listen", other]).failure().stderr(contains("--token-file"));
        run(&["server", "--listen", "127.0.0.1:0", "--metrics", other])
            .failure()
            .stderr(contains("--metrics-token-file").and(contains("--metrics ")));
    }
    let short = file("secret");
    run(&["server", "--listen", "0.0.0.0:0", "--token-file", path(&short)])
        .failure()
        .stderr(contains("at least 16 characters"));
}

#[test]
fn a_web_port_for_other_machines_needs_a_token_and_encryption() {
    let token = file("a secret of sixteen bytes");
    for other in ["0.0.0.0:0", "[::]:0", "[::ffff:127.0.0.1]:0"] {
        let server = ["server", "--listen", "127.0.0.1:0", "--web", other];
        run(&server).failure().stdout("").stderr(contains("--token-file").and(contains("api.tls")));
        let server = [&server[..], &["--token-file", path(&token)]].concat();
        run(&server).failure().stdout("").stderr(contains("--web ").and(contains("api.tls")));
    }
    run(&["server", "--web", "4269"]).failure().code(2).stderr(contains("such as 127.0.0.1:4269, or off"));
    for name in ["http://rig.local", "rig.local:4269", "", "a b", "*"] {
        run(&["server", "--allowed-host", name])
            .failure()
            .code(2)
            .stderr(contains("without a scheme and a port"));
    }
}

#[test]
fn a_scene_with_an_unknown_key_a_wrong_type_and_a_value_out_of_range() {
    for (line, words) in [
        ("stifness = 2", ["stifness", "stiffness"]),
        ("stiffness = \"2\"", ["stiffness", "string"]),
        ("stiffness = -2", ["stiffness", "-2"]),
        ("reference = [0, 0, 0, 0]", ["reference", "zero"]),
    ] {
        let scene = file(&format!("name = \"x\"\n[[effect]]\nid = \"spring\"\nkind = \"spring\"\n{line}\n"));
        let place = format!("{}:5:", path(&scene));
        for command in [&["scene", "check", path(&scene)][..], &["server", "--scene", path(&scene)]] {
            run(command).failure().stderr(contains(&place).and(contains(words[0])).and(contains(words[1])));
        }
    }
}

#[test]
fn a_name_of_no_scene_is_corrected_and_says_where_the_names_are() {
    for command in
        [&["server", "--listen", "127.0.0.1:0", "--scene"][..], &["scene", "load"], &["scene", "check"]]
    {
        let with = |name| [command, &[name]].concat();
        let list = || contains("`hbot scene list` prints the ready-made scenes");
        run(&with("spirng"))
            .failure()
            .stderr(contains("spirng: no file").and(contains("did you mean `spring`?")).and(list()));
        for (typed, meant) in
            [("hinj", "hinge"), ("Hinge", "hinge"), ("sprin", "spring"), ("gyro", "gyroscope")]
        {
            run(&with(typed)).failure().stderr(contains(format!("(did you mean `{meant}`?)")));
        }
        for other in ["zeppelin", "hinterland"] {
            run(&with(other)).failure().stderr(list().and(contains("did you mean").not()));
        }
        run(&with("nowhere/clay.toml"))
            .failure()
            .stderr(contains("nowhere/clay.toml: cannot be read").and(contains("`clay` without folder")));
    }
}

#[test]
fn a_rig_file_that_does_not_exist_is_corrected() {
    for command in [&["server", "--rig"][..], &["rig", "check"], &["scene", "check", "clay", "--rig"]] {
        let with = |name| [command, &[name]].concat();
        for name in ["prototype", "protoype", "prototype.toml", "rigs/prototype"] {
            let said = format!("{name}: cannot be read: No such file");
            run(&with(name))
                .failure()
                .stderr(contains(said).and(contains("(did you mean `rigs/prototype.toml`?)")));
        }
        run(&with("zeppelin")).failure().stderr(contains("did you mean").not());
    }
}

/// The other mistakes of such a file would only hide what is wrong.
#[test]
fn a_rig_file_as_a_scene_and_a_scene_file_as_a_rig_are_told_in_one_line_with_the_command() {
    let one_line = || predicates::function::function(|text: &str| text.lines().count() == 1);
    let rig = "rigs/prototype.toml";
    for command in [&["server", "--scene", rig][..], &["scene", "check", rig], &["scene", "load", rig]] {
        let said =
            contains("this is a rig file, not a scene file. `hbot server --rig rigs/prototype.toml` runs it");
        run(command).failure().stderr(said.and(one_line()));
    }
    let scene = "scenes/clay.toml";
    for command in [&["server", "--rig", scene][..], &["rig", "check", scene]] {
        let said = contains(
            "this is a scene file, not a rig file. `hbot server --scene scenes/clay.toml` starts with it",
        );
        run(command).failure().stderr(said.and(one_line()));
    }
}

/// The rig file is named in the same two ways everywhere.
#[test]
fn a_rig_file_is_named_by_its_place_or_by_an_option_but_not_twice() {
    let (rig, scene) = ("rigs/prototype.toml", "scenes/clay.toml");
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("UTF-8");
    for command in [
        &["check"][..],
        &["scan"],
        &["test", "--joint", "1", "--torque", "auto"],
        &["calibrate", "--seconds", "5"],
        &["certify", "--out", out],
    ] {
        let with = |more: &[&str]| run(&[&["rig"], command, more].concat());
        let help = run(&["rig", command[0], "--help"]).success();
        let help = String::from_utf8_lossy(&help.get_output().stdout).into_owned();
        assert!(
            help.contains("--rig <FILE>") && (help.contains("RIG.toml]") || help.contains("[FILE]")),
            "{help}"
        );
        // This is no rig file, and both ways tell so.
        for named in [&[scene][..], &["--rig", scene]] {
            with(named).failure().stderr(contains("this is a scene file, not a rig file"));
        }
        with(&[rig, "--rig", rig]).code(2).stderr(contains("cannot be used with").and(contains("--rig")));
    }
    run(&["rig", "scan", rig]).stderr(contains("built-in prototype").not());
    run(&["rig", "certify", "--rig", rig, "no.mcap", "--out", out]).failure().stderr(contains("no.mcap"));
    run(&["rig", "certify"]).code(2).stderr(contains("RIG.toml"));
    // Its recordings stand without an option, so its rig file needs one.
    run(&["rig", "identify", rig])
        .code(2)
        .stderr(contains("no recording (MCAP); the rig file is named by `--rig rigs/prototype.toml`"));
}

#[test]
fn a_size_that_is_written_in_another_unit_is_warned_of() {
    let sizes = |text: &str, sphere: &str, wheel: &str| {
        let text = text.replacen("mass = 0.467", sphere, 1).replace("radius = 0.0155", wheel);
        run(&["rig", "check", "--rig", path(&file(&text))]).success()
    };
    let prototype = include_str!("../../rigs/prototype.toml");
    let asks = contains("is it in");
    sizes(prototype, "mass = 0.467", "radius = 0.0155").stdout(asks.clone().not());
    let grams = contains("sphere.mass 467 kg is ").and(contains("is it in grams?"));
    sizes(prototype, "mass = 467", "radius = 0.0155").stdout(grams.and(contains("unlikely size")));
    let large = "wheel[1].radius 1.5 m is more than the sphere's";
    sizes(prototype, "mass = 0.467", "radius = 1.5").stdout(contains(large).and(asks));
}

#[test]
fn an_option_out_of_range_is_named() {
    let whole = "--rate: \"1e9\" is not a whole number; legal: 50 to 20000 Hz";
    run(&["server", "--rate", "1e9"]).failure().stderr(contains(whole));
    run(&["server", "--listen", "5102"]).failure().stderr(contains("such as 127.0.0.1:5102"));
    run(&["server", "--duration", "5m"])
        .code(2)
        .stderr(contains("--duration: \"5m\" is not").and(contains("unit ms, min, h")));
    let typed = "--accuracy-target: \"1mrad\" is not a number; legal: above 0 rad, or with the unit deg";
    run(&["server", "--accuracy-target", "1mrad"]).code(2).stderr(contains(typed));
    run(&["server", "--listen", "no-such-host.invalid:1"]).code(2).stderr(contains("such as 127.0.0.1:4268"));
    run(&["server", "--time", "virtual", "--port", "/dev/ttyS0", "--listen", "127.0.0.1:0"])
        .failure()
        .stderr(contains("virtual time needs the simulated rig"));
}

#[test]
fn a_server_listens_where_a_name_says_and_for_minutes() {
    let virtually = ["--time", "virtual", "--duration", "0.001min", "--web", "localhost:0"];
    let server = [&["server", "--listen", "localhost:0"][..], &virtually].concat();
    run(&server).success().stdout(contains("127.0.0.1:"));
}

/// The help says what an option accepts, and the option accepts no more.
#[test]
fn the_help_of_an_option_states_its_range() {
    for (command, option, outside, words) in [
        (&["doctor"][..], "--seconds", ["0", "3601"], "1 to 3600 s"),
        (&["rig", "calibrate"], "--seconds", ["4", "601"], "5 to 600 s"),
        (&["rig", "new", "new.toml"], "--wheels", ["1", "9"], "2 to 8"),
        (&["rig", "new", "new.toml"], "--radius", ["0.0009", "11"], "m, 0.001 to 10"),
        (&["rig", "new", "new.toml"], "--mass", ["0.0009", "1001"], "kg, 0.001 to 1000"),
        (&["rig", "new", "new.toml"], "--wheel-radius", ["0.00009", "11"], "m, 0.0001 to 10"),
        (&["rig", "new", "new.toml"], "--cone", ["0", "180"], "above 0 and below 180"),
        (&["rig", "new", "new.toml"], "--drive-gear", ["0.0009", "10001"], "0.001 to 10000"),
        (&["rig", "new", "new.toml"], "--steer-peak", ["0", "1001"], "above 0 and at most 1000"),
        (&["record", "x.mcap"], "--every", ["0", "1000001"], "1 to 1000000"),
        (&["watch"], "--every", ["0", "1000001"], "1 to 1000000"),
        (&["server"], "--rate", ["49", "20001"], "50 to 20000"),
        (&["server"], "--duration", ["0", "1.1e9"], "above 0 and at most 1e9 s"),
        (&["replay", "x.mcap"], "--from", ["-1", "1.1e9"], "0 to 1e9 s"),
    ] {
        let help = run(&[command, &["--help"]].concat()).success();
        let help = String::from_utf8_lossy(&help.get_output().stdout).into_owned();
        // The help of an option ends where that of the next one begins.
        let stated = help.split(&format!("{option} <")).nth(1).unwrap_or_else(|| panic!("{option}: {help}"));
        let stated = stated.split(" --").next().expect("a text").split_whitespace();
        let stated = stated.collect::<Vec<_>>().join(" ");
        assert!(stated.contains(words), "{command:?} {option}: {stated}");
        for value in outside {
            let equals = format!("{option}={value}");
            let refused = contains(format!("{option}: ")).and(contains(" is out of range; legal: "));
            run(&[command, &[equals.as_str()]].concat()).failure().stderr(refused);
        }
    }
}

#[test]
fn an_accuracy_that_nothing_reaches_names_the_best() {
    run(&["server", "--listen", "127.0.0.1:0", "--accuracy-target", "1e-12"]).failure().stderr(
        contains("--accuracy-target 1e-12").and(contains("The best are")).and(contains("rad in 10 s")),
    );
    run(&["server", "--accuracy-target", "0"]).failure().stderr(contains("above 0"));
    run(&["server", "--accuracy-target", "1e-3", "--accuracy", "fast"])
        .failure()
        .stderr(contains("cannot be used with"));
}

#[test]
fn a_command_that_hbot_calls_otherwise_is_named() {
    for (words, command) in [
        (&["load", "hinge"][..], "`hbot scene load NAME`"),
        (&["list"], "`hbot scene list`"),
        (&["start", "--port", "sim"], "`hbot server`"),
        (&["status"], "`hbot info`"),
        (&["check", "x.toml"], "`hbot rig check FILE`"),
        (&["hinge"], "`hbot scene load hinge`"),
        (&["magnet"], "`hbot scene new FILE --effect magnet`"),
        (&["server", "my.toml"], "`--rig my.toml` or `--scene my.toml`"),
        (&["set"], "`hbot set EFFECT KEY=VALUE`"),
        (&["set", "spring", "--stiffness", "2"], "without dashes, as in `stiffness=VALUE`"),
        (&["set", "spring.stiffness=2"], "hbot set spring stiffness=2"),
        (&["info", "--port", "4268"], "`--server HOST:PORT`"),
        (&["watch", "127.0.0.1:4268"], "`--server 127.0.0.1:4268`"),
        (&["stats", "127.0.0.1:4268"], "`--server 127.0.0.1:4268`"),
        (&["scene", "show", "127.0.0.1:4268"], "`--server 127.0.0.1:4268`"),
        (&["rig", "identify"], "`hbot rig identify --motors`"),
        (&["completions"], "(legal: bash, elvish, fish, powershell, zsh)"),
        (&["completions"], "`hbot completions --install`"),
        (&["scene", "hinge"], "`hbot scene load hinge`"),
        (&["server", "hinge"], "`--scene hinge` starts with a ready-made scene"),
        (&["server", "hinj"], "`--scene hinge` starts with a ready-made scene"),
        (&["monitor"], "`hbot watch`"),
        (&["convert", "x.mcap"], "docs/recordings.md"),
        (&["faults"], "`hbot explain FILE`"),
        (&["scene", "validate", "x.toml"], "`hbot scene check FILE|NAME`"),
        (&["scene", "save", "x.toml"], "`hbot scene show > FILE`"),
        (&["recover"], "After a fault or a stop of the rig, run `hbot reset`"),
        (&["rig", "validate", "x.toml"], "`hbot rig check FILE`"),
        (&["server", "--verbose"], "HBOT_LOG=debug"),
        (&["server", "-v"], "HBOT_LOG=debug"),
        (&["turn"], "`hbot hand turn n3 40deg`"),
        (&["hand", "n2", "30deg"], "`hbot hand turn n2 30deg`"),
        (&["hand", "turn", "30deg", "n2"], "`hbot hand turn n2 30deg`"),
        (&["connect", "127.0.0.1:4268"], "`--server HOST:PORT`"),
        (&["config"], "`hbot rig new FILE`"),
        (&["top"], "`hbot watch` shows the state, live"),
        (&["demo"], "`hbot server` runs a simulated rig"),
        (&["set", "spring", "stiffness=2", "--json"], "`hbot info --json` prints the scene"),
        (&["study", "accuracy", "--quick"], "`cargo run --release -p hbot-study -- accuracy --quick`"),
    ] {
        run(words).code(2).stderr(contains(command).and(contains("similar").not()));
    }
    run(&["watch", "--server", "http://127.0.0.1:4268"]).code(2).stderr(contains("without http://"));
    // A mistyped word still gets the most similar command or option.
    run(&["set", "spring", "stiffness=2", "--steel"]).code(2).stderr(contains("'--steal'"));
    run(&["rig", "check", "--port", "sim"]).code(2).stderr(contains("--server").not());
    run(&["serer"]).code(2).stderr(contains("'server'"));
    run(&["scene", "lod"]).code(2).stderr(contains("'load'"));
    // What is only as long, or begins alike, is not named: a wrong hint is worse than none.
    for words in [&["wander"][..], &["scene", "lint-all"], &["rig", "print"], &["info", "--vertical"]] {
        run(words).code(2).stderr(contains("similar").not());
    }
    run(&["estopp"]).code(2).stderr(contains("NOT STOPPED: \"estopp\" is no command. `hbot estop`"));
    run(&["enabel"]).code(2).stderr(contains("exists: 'enable'\n"));
}

/// clap sees nothing wrong with them.
#[test]
fn a_command_line_that_contradicts_itself_has_the_exit_code_of_wrong_ones() {
    let only_with_watch = "needs `--watch`";
    let ready_made = "a ready-made scene comes from no server";
    for (words, why) in [
        (&["server", "--rate", "10"][..], "--rate: 10 is out of range; legal: 50 to 20000 Hz"),
        (&["scene", "plot", "spring", "--from", "90", "--to", "10"], "--from 90 is not below --to 10"),
        (&["replay", "no.mcap", "--from", "0.2", "--to", "0.1"], "--from 0.2 is behind --to 0.1"),
        (&["set", "spring", "stiffness=1", "stiffness=2"], "stiffness is given twice"),
        (&["scene", "check", "hinge", "--steal"], only_with_watch),
        (&["scene", "check", "hinge", "--server=127.0.0.1:9"], only_with_watch),
        (&["scene", "check", "hinge", "--server", "127.0.0.1:9"], only_with_watch),
        (&["scene", "check", "hinge", "--strict", "--watch"], "cannot be used with"),
        (&["scene", "show", "clay", "--server", "127.0.0.1:9"], ready_made),
        (&["rig", "identify", "no.mcap", "--port", "sim"], "--port needs `--motors`"),
        (&["rig", "certify", "no.toml", "--port", "sim"], "--motors"),
        (&["server", "--record", "no.mcap", "--record-limit", "5MB"], "--record-limit needs --record FOLDER"),
    ] {
        run(words).code(2).stderr(contains(why).and(contains("loop.rate_hz").not()));
    }
    // The variable is for all commands.
    let mut check = assert_cmd::Command::from_std(hbot());
    check.args(["scene", "check", "hinge"]).env("HBOT_SERVER", "127.0.0.1:9").assert().success();
}

#[test]
fn the_usage_of_an_answer_does_not_ask_for_what_a_variable_gives() {
    let usage = contains("Usage: hbot hand turn [OPTIONS] <AXIS> <ANGLE>\n");
    let mut turn = assert_cmd::Command::from_std(hbot());
    turn.args(["hand", "turn", "n2"]).env("HBOT_SERVER", "127.0.0.1:9").assert().code(2).stderr(usage);
}

#[test]
fn a_strict_check_fails_for_a_warning() {
    let stiff = file("[[effect]]\nid = 's'\nkind = 'spring'\nstiffness = 900\n");
    let warned = || contains("warning: s: may shake the sphere");
    let counted = contains("1 effect, all legal, 1 warning\n").and(contains("warning:").not());
    run(&["scene", "check", path(&stiff)]).code(0).stderr(warned()).stdout(counted);
    run(&["scene", "check", path(&stiff), "--strict"]).code(1).stderr(warned());
    run(&["scene", "check", "spring", "--strict"]).code(0);
}

#[test]
fn a_new_file_in_no_folder_is_refused_before_questions() {
    for what in ["scene", "rig"] {
        let said = "/nodir/x.toml: there is no folder /nodir\n";
        run(&[what, "new", "/nodir/x.toml"]).code(1).stderr(predicates::str::diff(format!("error: {said}")));
    }
}

#[test]
fn the_help_says_what_exit_codes_mean_and_how_to_begin() {
    for command in ["server", "estop", "explain", "stats", "set", "hand turn", "rig identify", "scene new"] {
        let words: Vec<&str> = command.split(' ').chain(["--help"]).collect();
        run(&words).success().stdout(contains("Exit codes:\n  0  "));
    }
    let help = run(&["--help"]).success().stdout(contains("First steps:\n  hbot server "));
    let help = String::from_utf8_lossy(&help.get_output().stdout).into_owned();
    let names: Vec<&str> =
        help.lines().filter_map(|line| line.strip_prefix("  ")?.split(' ').next()).collect();
    assert_eq!(names[..2], ["server", "estop"], "{help}");
    let mut steps = help.lines().filter(|line| line.starts_with("  hbot "));
    assert!(steps.all(|line| line.chars().count() <= 80), "{help}");
}

/// `doctor` reads HBOT_TOKEN_FILE and not HBOT_SERVER.
#[test]
fn doctor_names_the_variables_that_it_reads() {
    run(&["doctor", "--help"]).success().stdout(contains("[env: HBOT_TOKEN_FILE]"));
    let free = std::net::TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("an address");
    run(&["doctor", "--seconds", "1", "--server", &free.to_string()])
        .code(1)
        .stdout(contains("by `--server ADDR`").and(contains("HBOT_SERVER").not()));
}

#[test]
fn what_is_no_server_of_hbot_is_told() {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    let answer = std::thread::spawn(move || {
        use std::io::{Read as _, Write as _};
        let mut peer = listener.accept().expect("a client").0;
        let _ = peer.read(&mut [0; 4096]);
        peer.write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n").expect("written");
    });
    let said = format!("what answers at {address} is no hbot server, or one of another version");
    run(&["info", "--server", &address]).code(1).stderr(contains(said));
    answer.join().expect("it has answered");
    run(&["watch", "--server", "no-such-host.invalid"])
        .code(1)
        .stderr(contains("no machine is known by the name \"no-such-host.invalid\" (").and(ends_with(")\n")));
    // An address that no machine on this network may have.
    run(&["watch", "--server", "255.255.255.255"])
        .code(1)
        .stderr(contains("cannot connect to 255.255.255.255: ").and(contains("os error").count(1)));
}

/// `cargo run server -- --help` passes the two dashes on.
#[test]
fn dashes_that_cargo_passes_on_are_skipped() {
    run(&["server", "--", "--help"]).success().stdout(contains("--rig <FILE>"));
    run(&["scene", "check", "--", "-nothing-"]).code(1).stderr(contains("-nothing-"));
}

#[test]
fn a_client_command_without_a_server_says_how_to_start_one() {
    let free = std::net::TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("an address");
    for command in ["watch", "disable", "enable"] {
        run(&[command, "--server", &free.to_string()]).failure().stderr(
            contains(format!("`hbot server --listen {free}`"))
                .and(contains("cargo run server"))
                .and(contains("HBOT_SERVER")),
        );
    }
    // A server that is started now would not stop the rig, so the error does not name `hbot
    // server`.
    let lost = format!("NOT STOPPED: the server at {free} has not confirmed the stop (no server there: ");
    run(&["estop", "--server", &free.to_string()])
        .code(1)
        .stderr(contains(lost).and(contains("Cut the motors' power.")).and(contains("hbot server`").not()));
}

#[test]
fn an_address_without_host_or_with_a_word_as_port_says_what_an_address_is() {
    let legal = || contains("Legal: HOST or HOST:PORT, as 127.0.0.1:4268");
    run(&["info", "--server", ":4268"]).code(2).stderr(contains("it has no host").and(legal()));
    run(&["info", "--server", "host:nine"]).code(2).stderr(contains("\"nine\" is no port").and(legal()));
    assert_cmd::Command::from_std(hbot())
        .args(["watch"])
        .env("HBOT_SERVER", ":4268")
        .assert()
        .code(2)
        .stderr(contains("it has no host").and(legal()));
}

/// A file of another format would still be MCAP, and a folder of this name would surprise.
#[test]
fn a_recording_with_the_ending_of_another_format_is_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let csv = folder.path().join("x.csv");
    let csv = csv.to_str().expect("UTF-8");
    for command in [
        &["record", csv][..],
        &["server", "--listen", "127.0.0.1:0", "--record", csv],
        &["replay", "x.mcap", "--scene", "clay", "--out", csv],
    ] {
        run(command)
            .code(2)
            .stderr(contains("a name that ends in .mcap").and(contains("makes a CSV file of it")));
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0, "{command:?}");
    }
}

/// Before, the server ran and recorded nothing, which only its exit code told.
#[test]
fn a_recording_to_a_device_or_a_link_to_nothing_is_refused_at_the_start() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    std::os::unix::fs::symlink(place("nothing"), place("link")).expect("a link");
    std::os::unix::fs::symlink(place("nothing.mcap"), place("link.mcap")).expect("a link");
    for (path, why) in [
        ("/dev/null", "a device"),
        ("/dev/full", "a device"),
        (&place("link"), "a symbolic link to something that does not exist"),
        (&place("link.mcap"), "a symbolic link to something that does not exist"),
    ] {
        let server = &[
            "server",
            "--listen",
            "127.0.0.1:0",
            "--time",
            "virtual",
            "--duration",
            "0.1",
            "--record",
            path,
        ];
        run(server).code(1).stderr(contains(why).and(contains("Name a new file that ends in .mcap")));
    }
}

/// A limit of file sizes is an error of the file, as a full disk is, and does not end the server.
#[test]
fn a_limit_of_file_sizes_ends_the_recording_and_not_the_server() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = std::process::Command::new("sh");
    command.args(["-c", "ulimit -f 100; exec \"$0\" \"$@\""]).arg(hbot().get_program());
    command.args(["server", "--listen", "127.0.0.1:0", "--time", "virtual", "--duration", "3", "--record"]);
    command.arg(folder.path().join("cut.mcap")).env("XDG_STATE_HOME", folder.path());
    assert_cmd::Command::from_std(command).assert().code(3).stdout(contains("1 file failed"));
}

#[test]
fn a_folder_in_place_of_a_file_is_told_with_what_is_wanted() {
    let folder = tempfile::Builder::new().suffix(".svg").tempdir().expect("a folder");
    let folder = folder.path().to_str().expect("UTF-8");
    for (command, wanted) in [
        (&["replay", folder][..], "Name the file of a recording (MCAP)"),
        (&["scene", "plot", "clay", "--out", folder], "Name a file for the picture"),
        (&["rig", "calibrate", "--write", folder], "Name the rig file to write"),
        (&["info", "--ca", folder], "Name a file with certificates (PEM)"),
    ] {
        run(command).failure().stderr(contains("this is a folder. ").and(contains(wanted)));
    }
    // Nor is a file of another kind overwritten.
    let other = format!("{folder}/thesis.txt");
    std::fs::write(&other, "years of work").expect("written");
    for command in [
        &["rig", "calibrate", "--write", &other][..],
        &["rig", "identify", "run.mcap", "--out", &other],
        &["rig", "identify", "--motors", "--out", &other],
    ] {
        run(command).failure().stderr(contains("the file to write exists already and is no rig file: "));
    }
    assert_eq!(std::fs::read_to_string(&other).expect("there"), "years of work");
    // Nothing waits for the other end of a pipe.
    let pipe = format!("{folder}/pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo");
    assert!(made.success());
    run(&["replay", &pipe]).failure().stderr(contains("this is a pipe. Name the file of a recording (MCAP)"));
}

#[test]
fn what_is_legal_checks_out() {
    run(&["rig", "check"])
        .success()
        .stdout(contains("a legal design").and(contains("234.336 N m/rad at 0.01")));
}

/// Somebody who reads only the first line, or sees only the last ones, must not miss a warning.
#[test]
fn the_headline_of_a_rig_counts_its_warnings() {
    let prototype = include_str!("../../rigs/prototype.toml");
    let check = |calibrated| {
        let rig = file(&prototype.replacen("zero = \"assume\"", "zero = \"calibrate\"", calibrated));
        let checked = run(&["rig", "check", path(&rig)]).success();
        let said = String::from_utf8_lossy(&checked.get_output().stdout).into_owned();
        let headline = said.lines().next().expect("a line").to_owned();
        assert!(said.ends_with(&format!("{headline}; every line fits\n")), "{said}");
        (headline, said.matches("warning:").count())
    };
    for (calibrated, end) in
        [(0, ""), (1, ", 1 warning (steering zero not known)"), (2, ", 2 warnings (steering zero not known)")]
    {
        let (headline, warnings) = check(calibrated);
        assert!(
            headline.ends_with(&format!(": a legal design{end}")) && warnings == calibrated,
            "{warnings}: {headline}"
        );
    }
}

/// The old command `study` is refused with one line, which names the command to run instead.
#[test]
fn a_study_is_a_program_by_itself() {
    for (args, words) in [
        (&["study", "accuracy", "--quick", "--out", "/tmp/x"][..], "accuracy --quick --out /tmp/x"),
        (&["study"], "--help"),
        (&["study", "--help"], "--help"),
    ] {
        let command = format!("run `cargo run --release -p hbot-study -- {words}`\n");
        let one_line = predicates::function::function(|text: &str| text.lines().count() == 1);
        run(args).code(2).stderr(contains(command).and(one_line)).stdout("");
    }
    run(&["--help"]).success().stdout(contains("study").not());
}
