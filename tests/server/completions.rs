//! Completions of a shell, and the man pages.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::process::*;

/// Returns what a user's bash offers for the last of these words, after the script was read.
fn offered(folder: &Path, server: &str, words: &[&str]) -> Vec<String> {
    const TAB: &str = r#"
        source <(hbot completions bash)
        registered=$(complete -p hbot) && registered=${registered##*-F } && registered=${registered%% *}
        COMP_WORDS=("$@") COMP_CWORD=$(($# - 1))
        typed=${COMP_WORDS[COMP_CWORD]}
        "$registered" hbot "${typed#[=:]}" "${COMP_WORDS[COMP_CWORD - 1]}"
        [ ${#COMPREPLY[@]} = 0 ] || printf '%s\n' "${COMPREPLY[@]}""#;
    // bash breaks a line at these characters too. A break at its end is the last word.
    let mut words: Vec<String> = words
        .iter()
        .flat_map(|word| {
            word.replace('=', "\n=\n")
                .replace(':', "\n:\n")
                .split('\n')
                .map(str::to_owned)
                .collect::<Vec<_>>()
        })
        .collect();
    if matches!(&words[..], [.., broken, last] if last.is_empty() && ["=", ":"].contains(&broken.as_str())) {
        words.pop();
    }
    let program = hbot();
    let programs = Path::new(program.get_program()).parent().expect("a folder");
    let path = format!("{}:{}", programs.display(), std::env::var("PATH").expect("a path"));
    let mut bash = std::process::Command::new("bash");
    bash.args(["--norc", "-c", TAB, "bash", "hbot"]).args(&words);
    let told = bash.current_dir(folder).env("PATH", path).env("HBOT_SERVER", server).output().expect("bash");
    assert_eq!(String::from_utf8_lossy(&told.stderr), "", "{words:?}");
    String::from_utf8_lossy(&told.stdout).lines().map(str::to_owned).collect()
}

#[test]
fn bash_offers_scenes_kinds_files_ports_and_axes_where_they_are_wanted() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["aa.mcap", "bb.mcap", "log.csv", "my.toml", "notes.txt"] {
        std::fs::write(folder.path().join(name), "").expect("written");
    }
    std::fs::write(folder.path().join("mine.toml"), "[[wheel]]\n").expect("written");
    std::fs::create_dir(folder.path().join("runs")).expect("a folder");
    let offered = |words: &str| {
        // The last word can be empty.
        offered(folder.path(), "127.0.0.1:9", &words.split(' ').collect::<Vec<_>>()).join(" ")
    };
    for (words, all) in [
        ("replay ", "aa.mcap bb.mcap log.csv runs/"),
        ("explain a", "aa.mcap"),
        ("recover ", "aa.mcap bb.mcap log.csv runs/"),
        ("rig identify ", "aa.mcap bb.mcap runs/"),
        ("scene load hin", "hinge"),
        ("scene load m", "metronome my.toml"),
        ("scene check hin", "hinge"),
        ("scene kinds s", "spring snaps slip"),
        ("scene new x.toml --effect spring,da", "spring,damper"),
        ("server --scene hin", "hinge"),
        ("server --scene=hin", "hinge"),
        ("server --port sim:p", "pty"),
        ("server --port sim:", "pty"),
        ("server --rig ", "mine.toml my.toml runs/"),
        ("server --port s", "sim sim:pty"),
        ("rig scan --port s", "sim"),
        ("rig check ", "mine.toml my.toml runs/"),
        ("rig calibrate ", "mine.toml my.toml runs/"),
        ("rig certify --rig ", "mine.toml my.toml runs/"),
        // Nothing is known, and no file is meant.
        ("server --web ", ""),
        ("rig test --joint ", ""),
        ("hand turn ", "n1 n2 n3"),
        ("hand turn n2 40deg --ov", "--over"),
        ("server --accuracy ", "fast balanced exact"),
        ("estop --s", "--server"),
        // Hidden commands.
        ("ma", ""),
        ("las", ""),
        ("scene pa", ""),
        ("help las", ""),
    ] {
        assert_eq!(offered(words), all, "hbot {words}");
    }
    let scenes = offered("server --scene ");
    assert!(
        scenes.contains("spring") && scenes.contains("my.toml") && !scenes.contains("aa.mcap"),
        "{scenes}"
    );
    assert!(!offered("server --port ").contains("my.toml"));
    let commands = offered("");
    assert!(commands.starts_with("server estop ") && !commands.contains("man "), "{commands}");
}

#[test]
fn bash_offers_the_effects_that_a_server_renders_and_their_parameters() {
    let server = Process::patient(&[]);
    let offered =
        |at: &str, words: &str| offered(server.folder(), at, &words.split(' ').collect::<Vec<_>>()).join(" ");
    let named = format!("set --server {} spr", server.address);
    for (at, words, all) in [
        (&*server.address, "set ", "spring"),
        (&server.address, "set spring st", "stiffness="),
        (&server.address, "set spring stiffness=2 dam", "damping="),
        // Words that are values; a number has none.
        (&server.address, "set spring anchor=", "absolute here"),
        (&server.address, "set spring anchor=h", "here"),
        (&server.address, "set spring stiffness=", ""),
        ("127.0.0.1:9", &named, "spring"),
    ] {
        // The shell does not wait for a busy computer.
        eventually(&format!("{all:?} for {words:?}"), || offered(at, words) == all);
    }
    // Keys that say what an effect is cannot be set.
    assert_eq!(offered(&server.address, "set spring ki"), "");
    // One that does not answer does not hold the shell up.
    let silent = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let at = silent.local_addr().expect("an address").to_string();
    let begun = Instant::now();
    assert_eq!(offered(&at, "set spr"), "");
    assert!(begun.elapsed() < Duration::from_secs(3), "{:?}", begun.elapsed());
}

#[test]
fn each_shell_has_a_script_that_asks_this_program() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let asks = contains("HBOT_COMPLETE").and(contains(" hbot ").or(contains("\"hbot\"")));
        run(&["completions", shell]).success().stdout(asks);
    }
}

/// Nothing is written outside the data folder, and each file that is written is named.
#[test]
fn one_command_installs_completions_and_man_pages() {
    let folder = tempfile::tempdir().expect("a folder");
    let [bin, home] = ["cargo/bin", "home"].map(|name| folder.path().join(name));
    std::fs::create_dir_all(&bin).expect("a folder");
    std::fs::copy(hbot().get_program(), bin.join("hbot")).expect("copied");
    let mut command = assert_cmd::Command::new(bin.join("hbot"));
    command.args(["completions", "--install"]).env("HOME", &home).env_remove("XDG_DATA_HOME");
    let said = |command: &mut assert_cmd::Command| {
        String::from_utf8(command.assert().success().get_output().stdout.clone()).expect("UTF-8")
    };
    let first = said(&mut command);
    let program = bin.join("hbot").display().to_string();
    for (file, text) in [
        ("man/man1/hbot-server.1", r"\-\-rig"),
        ("bash-completion/completions/hbot", program.as_str()),
        ("fish/vendor_completions.d/hbot.fish", program.as_str()),
    ] {
        let path = home.join(".local/share").join(file);
        assert!(std::fs::read_to_string(&path).expect(file).contains(text), "{file}");
        assert!(first.contains(&path.parent().expect("a folder").display().to_string()), "{file}: {first}");
    }
    assert_eq!(std::fs::read_dir(folder.path().join("cargo")).expect("a folder").count(), 1);
    // Man looks beside the folders of PATH.
    assert!(first.contains("export MANPATH="), "{first}");
    command.env("PATH", home.join(".local/bin"));
    assert!(!said(&mut command).contains("MANPATH"));
    command.env("XDG_DATA_HOME", folder.path().join("data"));
    assert!(said(&mut command).contains("MANPATH"));
    assert!(folder.path().join("data/man/man1/hbot.1").exists());
    // Without a home there is no place for them.
    command.env_remove("HOME").env_remove("XDG_DATA_HOME");
    command.assert().failure().stderr(contains("XDG_DATA_HOME"));
}

#[test]
fn every_command_has_a_man_page_that_names_its_options() {
    let folder = tempfile::tempdir().expect("a folder");
    let man = |path: &Path| run(&["man", path.to_str().expect("UTF-8")]);
    man(folder.path()).success().stdout(contains("man pages  "));
    let page = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect(name);
    assert!(page("hbot-server.1").contains(r"\-\-rig"));
    assert!(page("hbot-rig-check.1").contains("hbot\\-rig\\-check"));
    for command in ["server", "record", "replay", "recover", "doctor"] {
        assert!(page(&format!("hbot-{command}.1")).contains("\n.SH \"EXIT STATUS\"\n  0  "), "{command}");
    }
    // Each page that a command refers to exists. Hidden commands have none.
    let all = page("hbot.1");
    let named: Vec<&str> =
        all.lines().filter_map(|l| l.strip_prefix("hbot\\-")?.strip_suffix("(1)")).collect();
    assert!(named.len() > 10, "{all}");
    for name in named {
        page(&format!("hbot-{}.1", name.replace("\\-", "-")));
    }
    assert!(!folder.path().join("hbot-last-word.1").exists());

    // The usage names the values of options.
    assert!(page("hbot-info.1").contains(r"[\-\-server <ADDR>]"), "{}", page("hbot-info.1"));
    assert!(page("hbot-hand-turn.1").contains("<AXIS> <ANGLE>"), "{}", page("hbot-hand-turn.1"));

    // A folder that does not exist is made. A file cannot be one.
    let new = folder.path().join("new/man1");
    man(&new).success();
    assert!(new.join("hbot.1").exists());
    man(&new.join("hbot.1")).failure().stderr(contains("new/man1/hbot.1"));
}
