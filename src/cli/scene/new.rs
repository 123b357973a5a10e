//! `hbot scene new`: writes a commented scene file with the effects that a person chooses.

use std::io::Write as _;
use std::path::PathBuf;

use anyhow::{Context as _, bail};
use clap::Args;
use hbot_config::SceneFile;
use hbot_config::scene::{Listed, kinds};

use super::super::ask::{at_terminal, note_if_nobody_is_there, somebody_is_there};
use super::super::out::{create_new, note, refuse_missing_folder, tell};
use super::unknown;

/// Options of `hbot scene new`. On a terminal, the command asks for what is not given.
#[derive(Debug, Args)]
pub(crate) struct NewArgs {
    /// Scene file to write (TOML); it must not exist
    file: PathBuf,
    /// Name of the scene, shown to people
    #[arg(long)]
    name: Option<String>,
    /// Kinds of effects, as `hbot scene kinds` lists them, with commas between them
    #[arg(long = "effect", value_name = "KIND", value_delimiter = ',')]
    effects: Vec<String>,
}

pub(super) fn run(args: &NewArgs) -> anyhow::Result<()> {
    let file = args.file.display();
    if args.file.exists() {
        bail!("{file} exists already: name another file");
    }
    refuse_missing_folder(&args.file)?;
    let chosen = if args.effects.is_empty() { None } else { Some(named(&args.effects)?) };
    let name = match &args.name {
        Some(name) => name.clone(),
        None => ask_for_name()?,
    };
    let chosen = chosen.map_or_else(ask_for_kinds, Ok)?;
    let text = text(&name, &chosen);
    if let Err(mistakes) = SceneFile::from_toml(&text, "the scene") {
        bail!("{mistakes}");
    }
    create_new(&args.file)?
        .write_all(text.as_bytes())
        .with_context(|| format!("{file}: cannot be written"))?;
    tell!("{file} is written. Change what you like, then run")?;
    tell!("  hbot scene check {file}\n  hbot scene plot {file}\n  hbot scene load {file}")
}

/// Asks a question at the terminal. Returns the default for an empty answer, or if nobody is there.
fn asked(words: &str, default: &str) -> anyhow::Result<String> {
    let answer = at_terminal(&format!("{words} [{default}]: "))?.unwrap_or_default();
    Ok(if answer.is_empty() { default.to_owned() } else { answer })
}

/// Asks for the name of the scene. `?` explains it.
fn ask_for_name() -> anyhow::Result<String> {
    note_if_nobody_is_there();
    loop {
        match asked("name of the scene", "My scene")?.as_str() {
            "?" => note!("  Any text. Panel, recordings and messages show it."),
            name => return Ok(name.to_owned()),
        }
    }
}

/// Asks for kinds of effects until all of them exist. `?` lists them.
fn ask_for_kinds() -> anyhow::Result<Vec<Listed>> {
    loop {
        let answer = asked("kinds of effects, with commas between them; ? lists them", "spring")?;
        if ["?", "help"].contains(&answer.as_str()) {
            for Listed { name, description, .. } in kinds() {
                note!("  {name:14} {}", description.split_inclusive(". ").next().unwrap_or_default());
            }
            continue;
        }
        match named(&answer.split(',').map(|name| name.trim().to_owned()).collect::<Vec<_>>()) {
            Err(why) if somebody_is_there() => note!("  {why}"),
            chosen => return chosen,
        }
    }
}

/// Returns the kinds with these names.
fn named(names: &[String]) -> anyhow::Result<Vec<Listed>> {
    let all = kinds();
    let find = |name: &String| {
        all.iter().find(|kind| kind.name == *name).cloned().ok_or_else(|| {
            let legal: Vec<_> = all.iter().map(|kind| kind.name).collect();
            unknown(name, "no kind of effect", &legal)
        })
    };
    names.iter().map(find).collect()
}

/// Returns the text of the scene file. A kind that is chosen twice gets a number in its second id.
fn text(name: &str, chosen: &[Listed]) -> String {
    let mut text = format!(
        "# Written by `hbot scene new`. docs/effects.md describes every key; a key that you delete has its default.\n\
         # An angle can be a text such as \"30 deg\", and a stiffness three numbers, one for each axis.\n\n\
         name = {}\ndescription = \"\" # one sentence that says what it feels like\n",
        toml_edit::Value::from(name)
    );
    for (i, kind) in chosen.iter().enumerate() {
        let earlier = chosen[..i].iter().filter(|other| other.name == kind.name).count();
        // Without damping, what is stiff would swing for long.
        let snippet = kind.snippet().replace("damping = 0 #", "damping = 0.01 #");
        let id = format!("id = \"{}\"", kind.name);
        let snippet = match earlier {
            0 => snippet,
            _ => snippet.replacen(&id, &format!("id = \"{}{}\"", kind.name, earlier + 1), 1),
        };
        text.push_str(&format!("\n# {}\n{snippet}", kind.description));
    }
    text + "\n# Without hardware: a hand that sways the sphere, so that the scene is felt.\n[simulate]\nhand = { amplitude = 0.3 } # rad\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_spring_is_not_warned_of() {
        let text = text("Usual", &named(&["spring".to_owned()]).unwrap());
        let scene = SceneFile::from_toml(&text, "x.toml").unwrap();
        let abilities = hbot_config::advice::Abilities::of(&hbot_config::RigConfig::prototype());
        assert_eq!(abilities.warnings(&scene), []);
    }

    #[test]
    fn a_new_scene_of_every_kind_is_legal_and_ids_differ() {
        let mut chosen = kinds();
        chosen.extend(named(&["spring".to_owned()]).unwrap());
        let text = text("A \"test\"", &chosen);
        let scene = SceneFile::from_toml(&text, "x.toml").unwrap_or_else(|error| panic!("{error}\n{text}"));
        assert_eq!((scene.name(), scene.effects().len()), ("A \"test\"", chosen.len()));
        assert_eq!(scene.effects().last().unwrap().id(), "spring2");
        assert!(named(&["sprng".to_owned()]).unwrap_err().to_string().contains("legal: constant, spring"));
    }
}
