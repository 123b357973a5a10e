//! The commands `hbot scene plot`, `list`, `kinds`, `page` and `check --watch`.

use std::path::{Path, PathBuf};
use std::process::Stdio;

use serde_json::Value;

use crate::process::*;

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// Runs `hbot scene` in a folder. Returns whether it succeeds, and what it says.
fn scene_in(folder: &Path, args: &[&str]) -> (bool, String) {
    let output = hbot().arg("scene").args(args).current_dir(folder).output().expect("the binary runs");
    let said = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8(said).expect("UTF-8"))
}

fn scene(args: &[&str]) -> (bool, String) {
    scene_in(Path::new("."), args)
}

fn plot(args: &[&str]) -> (bool, String) {
    scene(&[&["plot"], args].concat())
}

/// The pictures in docs/effects.md are those that the command draws now. With HBOT_BLESS set, the
/// test writes them.
#[test]
fn the_pictures_in_the_docs_are_what_the_command_draws() {
    let temporary = tempfile::tempdir().expect("a folder");
    let kinds = hbot_config::scene::kinds();
    for kind in kinds {
        let scene = folder(&format!("docs/effects/{}.toml", kind.name));
        let picture = scene.with_extension("svg");
        let drawn = temporary.path().join("drawn.svg");
        let out = if std::env::var_os("HBOT_BLESS").is_some() { &picture } else { &drawn };
        let (ok, said) = plot(&[scene.to_str().expect("UTF-8"), "--out", out.to_str().expect("UTF-8")]);
        assert!(ok, "{said}");
        let [have, want] = [&picture, out].map(|path| std::fs::read_to_string(path).expect("readable"));
        assert!(
            have == want,
            "{} is not what `hbot scene plot` draws (HBOT_BLESS=1 draws it)",
            picture.display()
        );
        assert!(want.starts_with("<svg") && want.len() < 300_000, "{} bytes", want.len());
    }
}

/// Clay gives another torque on the way back. A spring without damping has one curve.
#[test]
fn a_plot_says_what_the_black_and_the_dashed_line_are() {
    let temporary = tempfile::tempdir().expect("a folder");
    let out = temporary.path().join("x.svg");
    let drawn = |scene: &str| {
        let (ok, said) = plot(&[scene, "--out", out.to_str().expect("UTF-8")]);
        assert!(ok, "{said}");
        std::fs::read_to_string(&out).expect("readable")
    };
    let (clay, spring) = (drawn("clay"), drawn("docs/effects/spring.toml"));
    assert!(clay.contains("\nwhole scene\n") && clay.contains("\non the way back\n"));
    assert!(spring.contains("\nwhole scene\n") && !spring.contains("\non the way back\n"));
}

#[test]
fn a_plot_shows_a_range_of_angles_and_is_named_after_its_scene() {
    let temporary = tempfile::tempdir().expect("a folder");
    let command = |args: &[&str]| scene_in(temporary.path(), &[&["plot"], args].concat());
    let (ok, said) = command(&["notched-dial", "--axis", "z", "--from", "-20deg", "--to", "20"]);
    assert!(ok && said.starts_with("notched-dial.svg shows the torque"), "{said}");
    let near = std::fs::read_to_string(temporary.path().join("notched-dial.svg")).expect("a picture");
    // The axis is labelled in steps of some degrees, and curves have tenths of a pixel.
    assert!(near.contains("\n-20\n") && near.contains("\n20\n") && !near.contains("\n100\n"), "{near}");
    let curve = near.split("points=\"").filter(|part| part.contains('.')).count();
    assert!(curve >= 1, "{near}");
    let (ok, said) = command(&["notched-dial", "--from", "20", "--to", "-20"]);
    assert!(!ok && said.contains("--from 20 is not below --to -20"), "{said}");
    // An earlier picture is replaced, and no other file.
    let out = temporary.path().join("notched-dial.svg");
    assert!(command(&["notched-dial"]).0 && std::fs::read_to_string(&out).expect("a picture") != near);
    std::fs::write(&out, "<?xml version='1.0'?><svg/>").expect("writable");
    let (ok, said) = command(&["notched-dial"]);
    assert!(!ok && said.contains("notched-dial.svg: the file exists already. Name another one"), "{said}");
    assert!(std::fs::read_to_string(&out).expect("kept").starts_with("<?xml"));
}

#[test]
fn a_new_scene_is_written_from_options_checked_and_drawn() {
    let temporary = tempfile::tempdir().expect("a folder");
    let scene = |args: &[&str]| scene_in(temporary.path(), args);
    let (ok, said) = scene(&["new", "mine.toml", "--name", "Mine", "--effect", "spring,detents"]);
    assert!(ok && said.contains("hbot scene load mine.toml"), "{said}");
    let (ok, said) = scene(&["check", "mine.toml"]);
    assert!(ok && said.starts_with("Mine: 2 effects, all legal\n"), "{said}");
    let (ok, said) = scene(&["new", "mine.toml"]);
    assert!(!ok && said.contains("mine.toml exists already"), "{said}");
    let (ok, said) = scene(&["new", "other.toml", "--effect", "sprng"]);
    assert!(
        !ok && said
            .contains("\"sprng\" is no kind of effect (did you mean `spring`?); legal: constant, spring"),
        "{said}"
    );
    let (ok, said) = scene(&["kinds", "sprng"]);
    assert!(!ok && said.contains("is no kind and no phenomenon (did you mean `spring`?)"), "{said}");
}

#[test]
fn what_cannot_be_drawn_is_told() {
    let spring = folder("scenes/spring.toml");
    let spring = spring.to_str().expect("UTF-8");
    for (args, said) in [
        (&[spring, "--out", "/nowhere/x.svg"][..], "/nowhere/x.svg: there is no folder /nowhere"),
        (&["/nowhere.toml", "--out", "x.svg"], "/nowhere.toml: cannot be read"),
        (&[spring, "--out", "x.svg", "--axis", "0,0,0"], "three numbers, not all zero"),
        (&[spring, "--out", "x.svg", "--axis", "w"], "three numbers, not all zero"),
        (&[spring, "--out", "x.png"], "a name that ends in .svg"),
        (&["rigs/prototype.toml", "--out", "x.svg"], "this is a rig file, not a scene file"),
    ] {
        let (ok, error) = plot(args);
        assert!(!ok && error.contains(said), "{args:?}: {error}");
    }
}

#[test]
fn every_kind_is_listed_in_one_line_and_shown_with_its_parameters_ranges_and_defaults() {
    let kinds_command = |args: &[&str]| {
        let (ok, text) = scene(&[&["kinds"], args].concat());
        assert!(ok && !text.contains('\u{1b}'), "no colours but on a terminal");
        text
    };
    let list = kinds_command(&[]);
    let all: Vec<_> =
        hbot_config::scene::kinds().into_iter().chain(hbot_config::scene::phenomena()).collect();
    let mut columns = std::collections::BTreeSet::new();
    for listed in &all {
        let line = list.lines().find(|line| line.split_whitespace().next() == Some(listed.name));
        let words = line.and_then(|line| line.trim_start().split_once(' ')).expect(listed.name).1.trim();
        columns.insert(line.and_then(|line| line.find(words)));
        assert!(listed.description.starts_with(words) && words.ends_with('.'), "{}: {words}", listed.name);
    }
    assert_eq!(columns.len(), 1, "{list}");
    // The others are two empty lines, the heading of the phenomena, and the last line.
    assert_eq!(list.lines().count(), all.len() + 4, "{list}");
    assert!(list.ends_with("`hbot scene kinds KIND` shows one of them with its parameters\n"), "{list}");
    for kind in hbot_config::scene::kinds() {
        let text = kinds_command(&[kind.name]);
        for parameter in kind.parameters() {
            assert!(!parameter.legal.is_empty() && !parameter.default.is_empty(), "{}", parameter.name);
            assert!(
                text.contains(&parameter.description) && text.contains(&parameter.legal),
                "{}",
                parameter.name
            );
        }
        if kind.name == "detents" {
            assert!(text.contains("a number, 0 to 100 N m; default 0.05"), "{text}");
        }
    }
    let json: Value = serde_json::from_str(&kinds_command(&["--json"])).expect("JSON");
    assert_eq!(json["effects"].as_array().map(Vec::len), Some(hbot_config::scene::kinds().len()));
    assert_eq!(json["effects"][5]["name"], "detents");
    assert_eq!(json["effects"][5]["schema"]["properties"]["strength"]["unit"], "N m");
}

#[test]
fn one_kind_or_phenomenon_can_be_listed_alone() {
    for (name, parameter) in [("spring", "stiffness"), ("gear", "backlash")] {
        let (ok, text) = scene(&["kinds", name]);
        assert!(ok && text.starts_with(name) && text.contains(parameter), "{text}");
        assert!(!text.contains("\nfriction  "), "only {name}: {text}");
    }
    let (ok, said) = scene(&["kinds", "sprung"]);
    assert!(!ok && said.contains("legal: constant, spring"), "{said}");
}

#[test]
fn the_shelf_is_listed_with_a_sentence_and_the_kinds_of_each_scene() {
    let text = scene(&["list"]).1;
    for entry in hbot_config::scene::SHELF {
        let scene = entry.scene();
        assert!(text.contains(entry.file) && text.contains(scene.description()), "{}: {text}", entry.file);
    }
    assert!(text.contains("guide, detents"), "{text}");
    assert_eq!(scene(&["show", "hinge"]).1, include_str!("../../scenes/hinge.toml"));
    let json: Value = serde_json::from_str(&scene(&["list", "--json"]).1).expect("JSON");
    assert_eq!(
        (&json[0]["file"], &json[0]["kinds"]),
        (&Value::from("spring"), &serde_json::json!(["spring"]))
    );
}

#[test]
fn a_check_says_what_the_rig_cannot_make_and_what_has_no_effect() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("wall.toml");
    let wall = "[[effect]]\nid = 'w'\nkind = 'end_stop'\nstiffness = 900\ntwist = [-0.5, 0.5]\n";
    std::fs::write(&file, wall).expect("written");
    let check = |args: &[&str]| scene(&[&["check", file.to_str().expect("UTF-8")], args].concat()).1;
    let said = check(&[]);
    assert!(said.contains("warning: w: may shake the sphere") && said.contains("with any damping"), "{said}");
    assert!(said.contains("warning: w: twist has no effect here; to make it count, set walls"), "{said}");
    // At 10 kHz and without the lead a key of the wall can mend it.
    let rig = folder.path().join("fast.toml");
    let fast = include_str!("../../rigs/prototype.toml")
        .replace("rate_hz = 1000 ", "rate_hz = 10000 ")
        .replace("\nlead = true", "\nlead = false");
    std::fs::write(&rig, fast).expect("written");
    let said = check(&["--rig", rig.to_str().expect("UTF-8")]);
    assert!(said.contains("at 10000 Hz at most") && said.contains("damping = "), "{said}");
}

/// docs/scenes.md and its plots are what the command writes now. With HBOT_BLESS set, the test
/// writes them.
#[test]
fn the_page_of_scenes_is_what_the_command_writes() {
    let temporary = tempfile::tempdir().expect("a folder");
    let docs = folder("docs");
    let out =
        if std::env::var_os("HBOT_BLESS").is_some() { docs.clone() } else { temporary.path().to_owned() };
    let (ok, said) = scene(&["page", out.to_str().expect("UTF-8")]);
    assert!(ok, "{said}");
    let read =
        |path: PathBuf| std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    assert!(
        read(docs.join("scenes.md")) == read(out.join("scenes.md")),
        "docs/scenes.md is old (HBOT_BLESS=1)"
    );
    for entry in hbot_config::scene::SHELF {
        let file = format!("scenes/{}.svg", entry.file);
        assert!(read(docs.join(&file)) == read(out.join(&file)), "docs/{file} is old (HBOT_BLESS=1)");
    }
}

fn rendered(server: &Process, name: &str) {
    let mut client = JsonLines::greeted(&server.address);
    eventually(name, || client.ask(r#"{"id": 1, "op": "info"}"#)["ok"]["scene"]["name"] == name);
}

#[test]
fn check_with_watch_loads_a_scene_on_each_save_and_tells_mistakes() {
    let server = Process::patient(&[]);
    let path = server.folder().join("mine.toml");
    let write = |name: &str, stiffness: f64| {
        let effect = format!("[[effect]]\nid = \"s\"\nkind = \"spring\"\nstiffness = {stiffness}\n");
        std::fs::write(&path, format!("name = \"{name}\"\n{effect}")).expect("written");
    };
    write("First", 1.0);
    let errors = server.folder().join("errors");
    let watching = hbot()
        .args(["scene", "check", path.to_str().expect("UTF-8"), "--watch", "--server", &server.address])
        .stdout(Stdio::null())
        .stderr(std::fs::File::create(&errors).expect("a file"))
        .spawn();
    let watching = Killed(watching.expect("the binary runs"));
    rendered(&server, "First");
    write("A mistake", -1.0);
    eventually("the mistake", || std::fs::read_to_string(&errors).expect("a file").contains("mine.toml:5"));
    rendered(&server, "First");
    write("Second", 2.0);
    rendered(&server, "Second");
    drop(watching);
    let said = scene(&["check", "spring", "--watch"]).1;
    assert!(said.contains("spring: a ready-made scene does not change"), "{said}");
}
