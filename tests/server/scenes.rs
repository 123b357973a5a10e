//! The commands `hbot scene plot` and `hbot scene list`.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::process::hbot;

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn plot(args: &[&str]) -> (bool, String) {
    let output = hbot().args(["scene", "plot"]).args(args).output().expect("the binary runs");
    (output.status.success(), String::from_utf8(output.stderr).expect("UTF-8"))
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

#[test]
fn every_scene_of_the_shelf_can_be_drawn_about_any_axis() {
    let temporary = tempfile::tempdir().expect("a folder");
    let out = temporary.path().join("x.svg");
    let out = out.to_str().expect("UTF-8");
    for entry in std::fs::read_dir(folder("scenes")).expect("scenes") {
        let path = entry.expect("readable").path();
        if path.extension().is_some_and(|e| e == "toml") {
            let (ok, said) = plot(&[path.to_str().expect("UTF-8"), "--out", out, "--axis", "1,-1,0.5"]);
            assert!(ok, "{}: {said}", path.display());
        }
    }
}

#[test]
fn what_cannot_be_drawn_is_told() {
    let spring = folder("scenes/spring.toml");
    let spring = spring.to_str().expect("UTF-8");
    for (args, said) in [
        (&[spring, "--out", "/nowhere/x.svg"][..], "/nowhere/x.svg: cannot be written"),
        (&["/nowhere.toml", "--out", "x.svg"], "/nowhere.toml: cannot be read"),
        (&[spring, "--out", "x.svg", "--axis", "0,0,0"], "three numbers, not all zero"),
        (&[spring, "--out", "x.svg", "--axis", "w"], "three numbers, not all zero"),
    ] {
        let (ok, error) = plot(args);
        assert!(!ok && error.contains(said), "{args:?}: {error}");
    }
}

#[test]
fn every_kind_is_listed_with_its_parameters_ranges_and_defaults() {
    let output = hbot().args(["scene", "list"]).output().expect("the binary runs");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    assert!(output.status.success() && !text.contains('\u{1b}'), "no colours but on a terminal");
    for kind in hbot_config::scene::kinds() {
        assert!(text.contains(kind.name), "{}", kind.name);
        for parameter in kind.parameters() {
            assert!(!parameter.legal.is_empty() && !parameter.default.is_empty(), "{}", parameter.name);
            assert!(
                text.contains(&parameter.description) && text.contains(&parameter.legal),
                "{}",
                parameter.name
            );
        }
    }
    assert!(text.contains("a number, 0 to 100 N m; default 0.05"), "{text}");
    let output = hbot().args(["scene", "list", "--json"]).output().expect("the binary runs");
    let json: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(json["effects"].as_array().map(Vec::len), Some(15));
    assert_eq!(json["effects"][5]["name"], "detents");
    assert_eq!(json["effects"][5]["schema"]["properties"]["strength"]["unit"], "N m");
}
