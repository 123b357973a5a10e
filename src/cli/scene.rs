//! `hbot scene list`, `kinds`, `show`, `check`, `load` and `plot`.

mod kinds;
mod new;
pub(super) mod plot;
mod shelf;
mod watch;

use std::ffi::OsStr;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{anyhow, bail};
use clap::{Args, Subcommand};
use hbot_config::advice::{Abilities, in_vain};
use hbot_config::scene::ShelfScene;
use hbot_config::{LoadError, SceneFile, did_you_mean, guess};
use serde_json::json;

use super::out::{WrongLine, foreign, note, say, tell};
use super::{Commanding, ServerAddress, orders, style};

/// The subcommands of `hbot scene`.
#[derive(Debug, Subcommand)]
pub(crate) enum SceneCommand {
    /// List the ready-made scenes: name, one sentence, kinds of effects
    List {
        /// Print JSON, for programs
        #[arg(long)]
        json: bool,
    },
    /// List the kinds of effects and the phenomena of the simulated rig, or show one with its
    /// parameters
    Kinds {
        /// Show this kind or phenomenon with its parameters
        kind: Option<String>,
        /// Print JSON, for programs
        #[arg(long, conflicts_with = "kind")]
        json: bool,
    },
    /// Write a commented scene file with the effects that you choose
    New(new::NewArgs),
    /// Print the scene that a server renders, or a ready-made one, as a scene file
    Show {
        /// Name of a ready-made scene [default: the scene that the server renders]
        scene: Option<String>,
        #[command(flatten)]
        address: ServerAddress,
    },
    /// Check a scene without running it, and say what the rig cannot make of it
    Check {
        #[command(flatten)]
        which: Which,
        /// Check again on each save of the file, and load the scene into the server
        #[arg(long)]
        watch: bool,
        /// End with exit code 1 if there is a warning
        #[arg(long, conflicts_with = "watch")]
        strict: bool,
        #[command(flatten, next_help_heading = "With --watch")]
        to: Commanding,
    },
    /// Load a scene into a running server
    Load {
        /// Scene file (TOML), or the name of a ready-made scene
        scene: PathBuf,
        /// With an ideal simulated rig: no phenomena but the usual hand, whatever the scene says
        #[arg(long)]
        ideal: bool,
        #[command(flatten)]
        to: Commanding,
    },
    /// Plot a scene: its torque against angle with the limit of the rig, and the energy wells of
    /// snaps
    Plot(plot::PlotArgs),
    /// Write the page of the ready-made scenes, with their plots
    #[command(hide = true)]
    Page {
        /// The folder of the page
        folder: PathBuf,
    },
}

/// A scene, and the rig for which it is.
#[derive(Debug, Args)]
pub(crate) struct Which {
    /// Scene file (TOML), or the name of a ready-made scene
    scene: PathBuf,
    /// Rig file (TOML) [default: the prototype, built in]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
}

impl Which {
    fn load(&self) -> anyhow::Result<(SceneFile, Abilities)> {
        let rig = super::rig_file::load(self.rig.as_deref(), &[])?;
        Ok((scene(&self.scene)?, Abilities::of(&rig)))
    }
}

/// Reads a scene file. A name without a folder and without `.toml` names a scene of the shelf,
/// unless there is a file with this name.
pub(super) fn scene(path: &Path) -> anyhow::Result<SceneFile> {
    match path.to_str().and_then(ShelfScene::named) {
        Some(shelf) if !path.is_file() => Ok(shelf.scene()),
        _ => SceneFile::from_path(path).map_err(|error| pointed_out(path, error)),
    }
}

/// Where the names of scenes are found.
const LIST: &str = "`hbot scene list` prints the ready-made scenes";

/// Adds to the error about a scene file that does not exist which scene of the shelf is probably
/// meant.
fn pointed_out(path: &Path, error: LoadError) -> anyhow::Error {
    let absent = matches!(&error, LoadError::Read { source, .. } if source.kind() == ErrorKind::NotFound);
    let Some(stem) = path.file_stem().and_then(OsStr::to_str).filter(|_| absent) else { return error.into() };
    if path.as_os_str() == stem {
        let file = path.with_extension("toml");
        let file = file.is_file().then(|| file.display().to_string());
        let meant = file.or_else(|| ShelfScene::similar(stem).map(str::to_owned));
        return anyhow!(
            "{stem}: no file and no ready-made scene has this name{}; {LIST}",
            guess(meant.as_deref())
        );
    }
    match ShelfScene::named(stem) {
        Some(ShelfScene { file, .. }) => anyhow!(
            "{:#}; `{file}` without folder and `.toml` is a ready-made scene",
            anyhow::Error::from(error)
        ),
        None => error.into(),
    }
}

pub(crate) fn run(command: SceneCommand) -> anyhow::Result<ExitCode> {
    match command {
        SceneCommand::List { json } => shelf::list(json)?,
        SceneCommand::New(args) => new::run(&args)?,
        SceneCommand::Kinds { kind, json } => kinds::run(kind.as_deref(), json)?,
        SceneCommand::Show { scene: Some(name), .. } => match ShelfScene::named(&name) {
            None if name.contains(':') => bail!(WrongLine(format!("`--server {name}` names a server"))),
            Some(scene) => {
                refuse_options_of_server(
                    "is for the scene that a server renders: a ready-made scene comes from no server",
                )?;
                say!("{}", scene.text.trim_end())?;
            }
            None => bail!(
                "{name}: no ready-made scene has this name{}; {LIST}",
                guess(ShelfScene::similar(&name))
            ),
        },
        SceneCommand::Show { scene: None, address } => show(&address)?,
        SceneCommand::Check { which, watch: true, to, .. } => watch::run(&which, &to)?,
        SceneCommand::Check { which, strict, .. } => {
            refuse_options_of_server(
                "needs `--watch`, which loads the scene into a server. Without it, a check asks no server",
            )?;
            if check(&which)? && strict {
                return Ok(ExitCode::FAILURE);
            }
        }
        SceneCommand::Load { scene: path, ideal, to } => load(&scene(&path)?, ideal, &to)?,
        SceneCommand::Plot(args) => plot::run(&args)?,
        SceneCommand::Page { folder } => shelf::page(&folder)?,
    }
    Ok(ExitCode::SUCCESS)
}

fn show(address: &ServerAddress) -> anyhow::Result<()> {
    let mut client = orders::connect(address, "hbot scene show")?;
    let json = client.info().map_err(orders::remedied)?.scene;
    // A later server can have kinds that this program does not know. They are shown as JSON.
    match SceneFile::from_json(json.clone()) {
        Ok(scene) => say!("{}", scene.to_toml().trim_end()),
        Err(_) => say!("{}", serde_json::to_string_pretty(&json)?),
    }
}

/// Fails if the command line has an option about a server. `why` ends the sentence that begins with
/// the option. A variable such as HBOT_SERVER, which is for all commands, is no reason to fail.
fn refuse_options_of_server(why: &str) -> anyhow::Result<()> {
    let arguments: Vec<_> = std::env::args_os().take_while(|argument| argument != "--").collect();
    let is_given = |option: &&str| {
        let is_it = |text: &str| text.split('=').next() == Some(option);
        arguments.iter().filter_map(|argument| argument.to_str()).any(is_it)
    };
    match ["--server", "--token-file", "--ca", "--steal"].iter().find(|option| is_given(option)) {
        None => Ok(()),
        Some(option) => bail!(WrongLine(format!("{option} {why}"))),
    }
}

/// Checks a scene. Returns whether there are warnings.
fn check(which: &Which) -> anyhow::Result<bool> {
    let (scene, abilities) = which.load()?;
    let effects = match scene.effects().len() {
        0 => "no effects, so the scene makes no torque".to_owned(),
        1 => "1 effect, all legal".to_owned(),
        n => format!("{n} effects, all legal"),
    };
    let warnings = abilities.warnings(&scene);
    let warned = match warnings.len() {
        0 => String::new(),
        1 => ", 1 warning".to_owned(),
        n => format!(", {n} warnings"),
    };
    tell!("{}{}{}: {effects}{warned}", style::NAME, scene.name(), style::OFF)?;
    for effect in scene.effects() {
        tell!("  {:12} {}", effect.id(), effect.kind_name())?;
    }
    warn(&warnings);
    note_if_nobody_holds(&scene);
    Ok(!warnings.is_empty())
}

/// Says it if the simulated rig has no hand with a scene that names its phenomena.
fn note_if_nobody_holds(scene: &SceneFile) {
    if scene.simulate().is_some_and(|simulate| simulate.hand.is_none()) {
        note!(
            "[simulate] names no hand, so nothing turns the simulated sphere; `hand = {{}}` is the usual one"
        );
    }
}

fn load(scene: &SceneFile, ideal: bool, to: &Commanding) -> anyhow::Result<()> {
    let mut client = orders::connect(&to.address, "hbot scene load")?;
    let mut json = scene.to_json();
    if ideal {
        json["simulate"] = json!({"hand": {}});
    }
    let loaded = orders::holding(&mut client, to.steal, |client| client.load_scene(json))?;
    let torque = if scene.effects().is_empty() { "; it has no effects, so it makes no torque" } else { "" };
    tell!("{}{}{} is loaded{torque}", style::NAME, scene.name(), style::OFF)?;
    if !scene.description().is_empty() {
        tell!("  {}", scene.description())?;
    }
    for effect in &loaded.effects {
        let [id, kind] = [&effect.id, &effect.kind].map(|text| foreign(text).to_string());
        tell!("  {id:12} {kind:12} {:>5} ns a tick", effect.cost_ns)?;
    }
    if !loaded.ignored.is_empty() {
        let ignored = loaded.ignored.join(", ");
        note!("  {}ignored on a real rig:{} {}", style::WARN, style::OFF, foreign(&ignored));
    }
    // The scene is sent with all parameters, so the server does not know which ones the file names.
    let own = in_vain(scene)
        .map(|warning| warning.to_string())
        .filter(|warning| !loaded.warnings.contains(warning));
    warn(&loaded.warnings.iter().cloned().chain(own).collect::<Vec<_>>());
    // On a real rig the phenomena are ignored.
    if loaded.ignored.is_empty() && !ideal {
        note_if_nobody_holds(scene);
    }
    if let Ok(info) = client.info() {
        super::show::note_without_torque(&info);
    }
    Ok(())
}

/// Prints the warnings about a scene on standard error.
pub(super) fn warn<W: ToString>(warnings: &[W]) {
    for warning in warnings {
        note!("  {}warning:{} {}", style::WARN, style::OFF, foreign(&warning.to_string()));
    }
}

/// Returns the error about a name that is not among the legal ones.
fn unknown(name: &str, what: &str, legal: &[&str]) -> anyhow::Error {
    let meant = did_you_mean(name, legal.iter().copied());
    anyhow!("{name:?} is {what}{}; legal: {}", guess(meant), legal.join(", "))
}
