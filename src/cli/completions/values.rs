//! The values that are offered for arguments: scenes, kinds of effects, files, ports, axes, and
//! what a running server renders.

use std::ffi::OsStr;
use std::os::unix::fs::FileTypeExt as _;
use std::path::Path;
use std::time::Duration;

use clap::{ArgMatches, FromArgMatches as _};
use clap_complete::engine::{ArgValueCompleter, CompletionCandidate, PathCompleter, ValueCompleter as _};
use hbot_config::scene::{SHELF, kinds, phenomena};
use serde_json::Value;

use super::super::{ServerAddress, command, orders};
use super::bash::whole;

/// Longest time for each of the server's two answers. A shell waits for them.
const PATIENCE: Duration = Duration::from_millis(100);
/// The beginnings of the names of serial devices in /dev.
const SERIAL: [&str; 4] = ["ttyACM", "ttyUSB", "ttyAMA", "ttyS"];
/// The keys of an effect that `hbot set` does not change.
const FIXED: [&str; 2] = ["id", "kind"];

/// Returns what completes an argument of a command, if it is not its usual completion: files for
/// paths, and the words of a choice.
pub(super) fn of(command: &str, argument: &str) -> Option<ArgValueCompleter> {
    Some(match (command, argument) {
        (_, "scene") => ArgValueCompleter::new(scenes),
        ("kinds", "kind") => ArgValueCompleter::new(|typed: &OsStr| {
            named(typed, kinds().iter().chain(&phenomena()).map(|it| it.name))
        }),
        ("new", "effects") => {
            ArgValueCompleter::new(|typed: &OsStr| named(typed, kinds().iter().map(|it| it.name)))
        }
        ("explain" | "replay" | "recover", "file") => files(&["mcap", "csv"]),
        (_, "runs") => files(&["mcap"]),
        ("check", "file" | "named") | (_, "rig" | "rig_file" | "built") => files(&["toml"]),
        ("server", "port") => ArgValueCompleter::new(|typed: &OsStr| ports(typed, &["sim", "sim:pty"])),
        (_, "port") => ArgValueCompleter::new(|typed: &OsStr| ports(typed, &["sim"])),
        (_, "axis" | "axes") => ArgValueCompleter::new(|typed: &OsStr| named(typed, ["n1", "n2", "n3"])),
        ("set", "effect") => ArgValueCompleter::new(effects),
        ("set", "values") => ArgValueCompleter::new(parameters),
        _ => return None,
    })
}

/// Returns those of some words that begin as typed.
fn named<T: AsRef<str>>(typed: &OsStr, words: impl IntoIterator<Item = T>) -> Vec<CompletionCandidate> {
    let typed = typed.to_string_lossy();
    let words = words.into_iter().filter(|word| word.as_ref().starts_with(&*typed));
    words.map(|word| CompletionCandidate::new(word.as_ref())).collect()
}

/// Completes files with one of these endings, and the folders on the way.
fn files(endings: &'static [&'static str]) -> ArgValueCompleter {
    ArgValueCompleter::new(PathCompleter::any().filter(move |path| has_ending(path, endings)))
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    path.is_file() && path.extension().and_then(OsStr::to_str).is_some_and(|end| endings.contains(&end))
}

/// Completes the ready-made scenes, and scene files.
fn scenes(typed: &OsStr) -> Vec<CompletionCandidate> {
    let mut all = named(typed, SHELF.iter().map(|scene| scene.file));
    all.extend(
        PathCompleter::any().filter(|path| has_ending(path, &["toml"]) && !is_rig(path)).complete(typed),
    );
    all
}

/// Whether a file has a wheel, as every rig file does.
fn is_rig(path: &Path) -> bool {
    std::fs::read_to_string(path).is_ok_and(|text| text.contains("[[wheel]]"))
}

/// Completes names of the simulated rig, and serial devices.
fn ports(typed: &OsStr, simulated: &[&str]) -> Vec<CompletionCandidate> {
    if typed.to_string_lossy().starts_with("/dev/") {
        let is_device = |path: &Path| path.metadata().is_ok_and(|found| found.file_type().is_char_device());
        return PathCompleter::any().filter(is_device).complete(typed);
    }
    let devices = std::fs::read_dir("/dev").into_iter().flatten().flatten();
    let mut devices: Vec<String> = devices
        .filter_map(|entry| entry.file_name().into_string().ok())
        .filter(|name| SERIAL.iter().any(|start| name.starts_with(start)))
        .map(|name| format!("/dev/{name}"))
        .collect();
    devices.sort();
    named(typed, simulated.iter().map(|name| (*name).to_owned()).chain(devices))
}

/// Completes the id of an effect in the scene that runs.
fn effects(typed: &OsStr) -> Vec<CompletionCandidate> {
    let effects = running().map(|(_, effects)| effects).unwrap_or_default();
    named(typed, effects.iter().filter_map(|effect| effect["id"].as_str()))
}

/// Completes the parameters of the effect that was typed before, and words that are legal values.
fn parameters(typed: &OsStr) -> Vec<CompletionCandidate> {
    let Some((line, effects)) = running() else { return Vec::new() };
    let id = line.get_one::<String>("effect");
    let effect = effects.iter().find(|effect| effect["id"].as_str() == id.map(String::as_str));
    let Some(effect) = effect.and_then(Value::as_object) else { return Vec::new() };
    if let Some((key, _)) = typed.to_str().and_then(|typed| typed.split_once('=')) {
        let kind = kinds().into_iter().find(|kind| effect.get("kind").is_some_and(|it| it == kind.name));
        let mut legal = Vec::new();
        kind.iter().for_each(|kind| words(&kind.schema["properties"][key], &mut legal));
        return named(typed, legal.iter().map(|word| format!("{key}={word}")));
    }
    let keys = effect.keys();
    named(typed, keys.filter(|key| !FIXED.contains(&key.as_str())).map(|key| format!("{key}=")))
}

/// Collects the words that a JSON schema allows.
fn words(schema: &Value, legal: &mut Vec<String>) {
    let constants = schema["enum"].as_array().into_iter().flatten().chain(schema.get("const"));
    legal.extend(constants.filter_map(Value::as_str).map(str::to_owned));
    let parts = ["oneOf", "anyOf"].into_iter().filter_map(|key| schema[key].as_array()).flatten();
    parts.for_each(|part| words(part, legal));
}

/// Returns the line of `hbot set` that is typed, and the effects that the server renders. Returns
/// `None` if no server answers at once.
fn running() -> Option<(ArgMatches, Vec<Value>)> {
    // The script writes the line behind two dashes. Its last word is not whole.
    let mut words = whole(std::env::args_os().skip_while(|word| word != "--").skip(1));
    words.pop();
    let line = command().ignore_errors(true).try_get_matches_from(words).ok()?;
    let line = line.subcommand_matches("set")?.clone();
    let address = ServerAddress::from_arg_matches(&line).ok()?;
    let mut client = orders::connect_within(&address, "hbot completions", PATIENCE).ok()?;
    let scene = client.info().ok()?.scene;
    Some((line, scene["effect"].as_array()?.clone()))
}
