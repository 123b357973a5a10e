//! `hbot scene list`: lists the ready-made scenes. The hidden command `hbot scene page` writes
//! docs/scenes.md from them.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Context as _;
use hbot_config::advice::Abilities;
use hbot_config::scene::SHELF;
use hbot_config::{RigConfig, SceneFile};
use serde_json::json;

use super::{plot, say, style, tell};

pub(super) fn list(as_json: bool) -> anyhow::Result<()> {
    if as_json {
        let all: Vec<_> = SHELF
            .iter()
            .map(|entry| {
                let scene = entry.scene();
                json!({
                    "file": entry.file, "name": scene.name(), "description": scene.description(), "kinds": kinds(&scene),
                })
            })
            .collect();
        return say!("{}", json!(all));
    }
    for entry in SHELF {
        let scene = entry.scene();
        tell!("  {}{:22}{} {}", style::NAME, entry.file, style::OFF, scene.description())?;
        tell!("  {:22} {}{}{}", "", style::DIM, kinds(&scene).join(", "), style::OFF)?;
    }
    tell!(
        "\n`hbot scene load NAME` loads one into a running server, and `hbot server --scene NAME` starts with it"
    )
}

/// Returns the kinds of a scene's effects, each once, in the order of the scene.
fn kinds(scene: &SceneFile) -> Vec<&'static str> {
    let mut all = Vec::new();
    for effect in scene.effects() {
        if !all.contains(&effect.kind_name()) {
            all.push(effect.kind_name());
        }
    }
    all
}

/// Writes the page `scenes.md` and the plots `scenes/FILE.svg` into a folder.
pub(super) fn page(folder: &Path) -> anyhow::Result<()> {
    let plots = folder.join("scenes");
    std::fs::create_dir_all(&plots).with_context(|| format!("{}: cannot be made", plots.display()))?;
    let abilities = Abilities::of(&RigConfig::prototype());
    for entry in SHELF {
        let axes = plot::usual_axes()?;
        plot::write(
            &plots.join(format!("{}.svg", entry.file)),
            &plot::draw(&entry.scene(), &axes, plot::WHOLE_TURN, &abilities),
        )?;
    }
    let path = folder.join("scenes.md");
    std::fs::write(&path, text()?).with_context(|| format!("{}: cannot be written", path.display()))?;
    say!("{}", path.display())
}

fn text() -> anyhow::Result<String> {
    let mut text = String::from(HEAD);
    for entry in SHELF {
        let (file, scene) = (entry.file, entry.scene());
        let name = scene.name();
        let links: Vec<_> = kinds(&scene).iter().map(|kind| format!("`{kind}`")).collect();
        let source = format!("Kinds: {}. File: [`{file}.toml`](../scenes/{file}.toml).", links.join(", "));
        let (words, source) = (wrapped(scene.description()), wrapped(&source));
        write!(
            text,
            "\n## {name}\n\n{words}\n\n{source}\n\n![{name}: torque against angle](scenes/{file}.svg)\n"
        )?;
    }
    Ok(text)
}

/// The beginning of the page.
const HEAD: &str = "\
# Scenes

For everybody who looks for something to feel: the scenes that come with hbot.

`hbot scene list` prints this list. `hbot scene load clay`, for example, loads a scene into a running server, and
`hbot server --scene clay` starts a server with it. To write a scene of your own, begin with a copy: `hbot scene show
clay > my.toml`. [files.md](files.md#the-scene-file) has every key, and [effects.md](effects.md) every kind of effect.

Each plot shows the torque about an axis while the sphere turns about this axis and back. Black is the whole scene, and
each colour is one of its effects. Dashed is the whole scene on the way back, where it differs. Grey lines are the
largest torque of the prototype, and what lies beyond them is cut off.

This page is generated from the files by `cargo run -- scene page docs`.
";

/// Breaks a text into lines of at most 120 characters.
fn wrapped(text: &str) -> String {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let last = lines.last_mut().map_or(0, |line| line.chars().count());
        if last > 0 && last + 1 + word.chars().count() > 120 {
            lines.push(String::new());
        }
        if let Some(line) = lines.last_mut() {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines.join("\n")
}
