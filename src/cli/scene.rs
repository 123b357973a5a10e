//! `hbot scene check`, `load`, `plot` and `list`.

mod list;
mod plot;
mod sweep;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Subcommand;
use hbot_config::SceneFile;

use super::out::{foreign, say};
use super::{ServerAddress, orders, style};

/// The subcommands of `hbot scene`.
#[derive(Debug, Subcommand)]
pub(crate) enum SceneCommand {
    /// Check a scene file without running it
    Check {
        /// The scene file (TOML)
        file: PathBuf,
    },
    /// Load a scene file into a running server
    Load {
        /// The scene file (TOML)
        file: PathBuf,
        #[command(flatten)]
        address: ServerAddress,
    },
    /// Plot a scene: its torque against angle, and the energy wells of snaps
    Plot(plot::PlotArgs),
    /// List every kind of effect with its parameters, and the phenomena of the simulated rig
    List {
        /// Print JSON, for programs
        #[arg(long)]
        json: bool,
    },
}

pub(crate) fn run(command: SceneCommand) -> anyhow::Result<ExitCode> {
    match command {
        SceneCommand::Check { file } => {
            let scene = SceneFile::from_path(&file)?;
            say!(
                "{}{}{}: {} effect{}, all legal",
                style::NAME,
                scene.name(),
                style::OFF,
                scene.effects().len(),
                if scene.effects().len() == 1 { "" } else { "s" }
            )?;
            for effect in scene.effects() {
                say!("  {:12} {}", effect.id(), effect.kind_name())?;
            }
        }
        SceneCommand::Load { file, address } => {
            let scene = SceneFile::from_path(&file)?;
            let mut client = orders::connect(&address, "hbot scene load")?;
            let loaded = orders::holding(&mut client, |client| client.load_scene(scene.to_json()))?;
            say!("{}{}{} is loaded", style::NAME, scene.name(), style::OFF)?;
            for effect in &loaded.effects {
                let [id, kind] = [&effect.id, &effect.kind].map(|text| foreign(text).to_string());
                say!("  {id:12} {kind:12} {:>5} ns a tick", effect.cost_ns)?;
            }
            if !loaded.ignored.is_empty() {
                let ignored = loaded.ignored.join(", ");
                say!("  {}ignored on a real rig:{} {}", style::WARN, style::OFF, foreign(&ignored))?;
            }
        }
        SceneCommand::Plot(args) => plot::run(&args)?,
        SceneCommand::List { json } => list::run(json)?,
    }
    Ok(ExitCode::SUCCESS)
}
