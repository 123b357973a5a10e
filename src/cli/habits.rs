//! Command lines that people type out of habit, and what they mean in hbot.

use std::error::Error as _;
use std::ffi::OsString;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, ValueEnum as _};
use clap_complete::Shell;
use hbot_config::did_you_mean;
use hbot_config::scene::{ShelfScene, kinds};

use super::hand;
use super::numbers::LEGAL;
use super::orders::SHOW_SCENE;

/// Words that are no commands of hbot, and the command that does what they ask for.
const HABITS: [(&[&str], &str); 22] = [
    (&["start", "run", "serve", "up", "sim", "simulate"], "`hbot server` runs the rig, or a simulated one"),
    (
        &["load", "open"],
        "`hbot scene load NAME` loads a scene, and `hbot scene list` lists the ready-made ones",
    ),
    (&["list", "ls", "scenes"], "`hbot scene list` lists the ready-made scenes"),
    (&["kinds", "effects"], "`hbot scene kinds` lists the kinds of effects"),
    (
        &["status", "state", "ps"],
        "`hbot info` shows the mode and the scene, and `hbot watch` the state, live",
    ),
    (&["show", "get"], "`hbot info` shows the rig, and `hbot scene show` the running scene"),
    (&["check", "validate"], "`hbot scene check FILE` checks a scene, and `hbot rig check FILE` a rig"),
    (&["plot", "draw"], "`hbot scene plot FILE|NAME` draws a scene"),
    (&["new", "init"], "`hbot rig new FILE` writes a rig file, and `hbot scene new FILE` a scene"),
    (
        &["scan", "test", "calibrate"],
        "`hbot rig scan`, `hbot rig test` and `hbot rig calibrate` bring a rig up",
    ),
    (&["version"], "`hbot --version` tells the version"),
    (&["log", "logs"], "`hbot explain FILE` says what a flight log or a recording shows"),
    (
        &["quit", "exit", "kill", "shutdown"],
        "Ctrl-C in the terminal of `hbot server` ends it, and `hbot estop` stops the torque",
    ),
    (&["off", "pause"], "`hbot disable` ramps the torque down, and `hbot estop` stops at once"),
    (&["monitor", "top"], "`hbot watch` shows the state, live"),
    (
        &["convert", "export"],
        "recordings are MCAP; the Python client makes a CSV file of one: docs/recordings.md",
    ),
    (
        &["fault", "faults", "errors"],
        "`hbot info` shows the cause of a stop, and `hbot explain FILE` what came before it",
    ),
    (
        &["connect"],
        "each command connects by itself: `--server HOST:PORT` or the variable HBOT_SERVER names the server",
    ),
    (&["config", "configure"], "`hbot rig new FILE` writes a rig file, and `hbot rig check FILE` checks one"),
    (
        &["demo", "example", "examples"],
        "`hbot server` runs a simulated rig, and `hbot scene list` lists scenes",
    ),
    (&["turn"], "`hbot hand turn n3 40deg` lets the hand of a simulated rig turn the sphere"),
    (&["panel", "gui", "ui"], "the panel is a program by itself: `hbot-gui`, or `cargo run -p hbot-gui`"),
];

/// The same for words behind `hbot scene` and `hbot rig`.
const HABITS_OF_GROUPS: [(&str, &[&str], &str); 4] = [
    ("scene", &["validate", "test", "lint"], "`hbot scene check FILE|NAME` checks a scene"),
    ("scene", &["save", "export", "get"], "`hbot scene show > FILE` writes the running scene to a file"),
    ("scene", &["set"], "`hbot set EFFECT KEY=VALUE` changes the running scene"),
    ("rig", &["validate", "lint"], "`hbot rig check FILE` checks a rig file"),
];

/// Words of people who want the rig to stop, beside `estop`.
pub(crate) const STOPS: [&str; 6] = ["stop", "halt", "e-stop", "emergency-stop", "emergency", "panic"];

/// Options by which other servers write more.
const VERBOSE: [&str; 4] = ["-v", "-vv", "--verbose", "--debug"];

/// Words that ask for the studies, which are another program.
const STUDIES: [&str; 2] = ["study", "studies"];

/// Returns the arguments without the first `--` if an option follows it. `cargo run server --
/// --help` passes it on, because cargo takes only a first `--` for its own.
pub(crate) fn without_cargo_s_dashes(arguments: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut arguments: Vec<OsString> = arguments.collect();
    let at = arguments.iter().position(|argument| argument == "--");
    if let Some(at) = at {
        let next = arguments.get(at + 1).and_then(|argument| argument.to_str());
        if next.is_some_and(|next| next.starts_with("--") || ["-h", "-V"].contains(&next)) {
            arguments.remove(at);
        }
    }
    arguments
}

/// Options of `hbot estop` that take a value.
const STOP_OPTIONS: [&str; 3] = ["--server", "--token-file", "--ca"];

/// Returns whether a command line asks for an emergency stop, however it goes on.
pub(crate) fn is_stop(arguments: &[OsString]) -> bool {
    stop_word(arguments).is_some()
}

/// Returns where the word for an emergency stop is. Options can stand before it.
fn stop_word(arguments: &[OsString]) -> Option<usize> {
    let mut at = 1;
    while let Some(word) = arguments.get(at).and_then(|word| word.to_str()) {
        if !word.starts_with('-') {
            let is_stop = ["estop"].iter().chain(&STOPS).any(|stop| word.eq_ignore_ascii_case(stop));
            return is_stop.then_some(at);
        }
        at += if STOP_OPTIONS.contains(&word) { 2 } else { 1 };
    }
    None
}

/// Returns the command line of a stop with what is understood of `arguments`, and the rest.
pub(crate) fn stop_line(arguments: &[OsString]) -> (Vec<OsString>, Vec<String>) {
    let (mut line, mut odd) = (vec!["hbot".into(), "estop".into()], Vec::new());
    let stop = stop_word(arguments);
    let words = arguments.iter().enumerate().skip(1).filter(|(at, _)| Some(*at) != stop);
    let mut words = words.map(|(_, word)| word.clone()).peekable();
    let has_port = |text: &str| {
        text.rsplit_once(':').is_some_and(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok())
    };
    let mut bare = None;
    while let Some(word) = words.next() {
        let text = word.to_string_lossy().into_owned();
        let (name, has_value) = text.split_once('=').map_or((&*text, false), |(name, _)| (name, true));
        let known = STOP_OPTIONS.contains(&name);
        if known && has_value {
            line.push(word);
        } else if known && let Some(value) = words.next_if(|next| !next.to_string_lossy().starts_with('-')) {
            line.extend([word, value]);
        } else if bare.is_none() && has_port(&text) {
            bare = Some(word);
        } else {
            odd.push(format!("{text:?}"));
        }
    }
    let is_named = line.iter().any(|word| word.to_string_lossy().starts_with("--server"));
    match bare {
        Some(server) if !is_named => line.extend(["--server".into(), server]),
        Some(other) => odd.push(format!("{:?}", other.to_string_lossy())),
        None => {}
    }
    (line, odd)
}

/// Keeps of the commands or options that clap takes for similar to a mistyped one the most similar
/// one, or none if all are too different: a wrong hint is worse than none.
pub(crate) fn keep_the_most_similar(answer: &mut clap::Error) {
    let word = answer.get(ContextKind::InvalidSubcommand).cloned();
    let similar = answer.get(ContextKind::SuggestedSubcommand).cloned();
    if let (Some(ContextValue::String(word)), Some(ContextValue::Strings(similar))) = (word, similar) {
        match did_you_mean(&word, similar.iter().map(String::as_str)) {
            Some(best) => {
                answer.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(vec![best.to_owned()]))
            }
            None => answer.remove(ContextKind::SuggestedSubcommand),
        };
    }
    let word = answer.get(ContextKind::InvalidArg).cloned();
    let similar = answer.get(ContextKind::SuggestedArg).cloned();
    if let (Some(ContextValue::String(word)), Some(ContextValue::String(similar))) = (word, similar)
        && did_you_mean(&word, std::iter::once(similar.as_str())).is_none()
    {
        answer.remove(ContextKind::SuggestedArg);
    }
}

/// Writes the usage of the command anew into clap's answer. clap counts an option with a variable
/// that is set among those that have to be given.
pub(crate) fn usual_usage(answer: &mut clap::Error, arguments: &[OsString], mut all: Command) {
    if answer.get(ContextKind::Usage).is_none() {
        return;
    }
    all.build();
    let mut command = &mut all;
    for argument in arguments.iter().skip(1) {
        if command.find_subcommand(argument).is_none() {
            break;
        }
        let Some(sub) = command.find_subcommand_mut(argument) else { return };
        command = sub;
    }
    answer.insert(ContextKind::Usage, ContextValue::StyledStr(command.render_usage()));
}

/// Returns what a user means whose command line clap refuses. Returns `None` if that is not known.
/// `arguments` is the whole command line.
pub(crate) fn meant(answer: &clap::Error, arguments: &[OsString]) -> Option<String> {
    match answer.kind() {
        ErrorKind::InvalidSubcommand => command(answer, arguments),
        ErrorKind::UnknownArgument => argument(answer, arguments),
        ErrorKind::ValueValidation => turned_round(arguments).or_else(|| number(answer)),
        ErrorKind::MissingRequiredArgument if is_command(arguments, &["set"]) => {
            Some(format!("name an effect and its new values: `hbot set EFFECT KEY=VALUE`; {SHOW_SCENE}"))
        }
        ErrorKind::MissingRequiredArgument if is_command(arguments, &["recover"]) => Some(
            "this mends a recording: `hbot recover CUT.mcap MENDED.mcap`. After a fault or a stop of the rig, run `hbot \
             reset`, then `hbot enable`"
                .to_owned(),
        ),
        ErrorKind::MissingRequiredArgument if is_command(arguments, &["rig", "identify"]) => Some(
            "name recordings of a hand's turns, which show the geometry: `hbot rig identify RUN.mcap`; or let the motors \
             move the free sphere, for torque constants and friction: `hbot rig identify --motors`"
                .to_owned(),
        ),
        ErrorKind::MissingRequiredArgument if is_command(arguments, &["completions"]) => {
            let shells: Vec<String> = Shell::value_variants().iter().map(Shell::to_string).collect();
            Some(format!(
                "name the shell, as in `hbot completions bash` (legal: {}), or install for bash and fish: \
                 `hbot completions --install`",
                shells.join(", ")
            ))
        }
        _ => None,
    }
}

/// Returns the command line of a turn whose angle stands before the axis.
fn turned_round(arguments: &[OsString]) -> Option<String> {
    let words: Vec<&str> = arguments.iter().map(|argument| argument.to_str()).collect::<Option<_>>()?;
    match words[1..] {
        ["hand", "turn", angle, axis, ..] if hand::axis(axis).is_ok() && hand::axis(angle).is_err() => {
            Some(format!("the axis stands before the angle: `hbot hand turn {axis} {angle}`"))
        }
        _ => None,
    }
}

/// Returns the error about a number, without clap's words around it.
fn number(answer: &clap::Error) -> Option<String> {
    let why = answer.source()?.to_string();
    let Some(ContextValue::String(option)) = answer.get(ContextKind::InvalidArg) else { return None };
    let option = option.split(' ').next().unwrap_or(option);
    why.contains(LEGAL).then(|| format!("{option}: {why}"))
}

/// Commands that are clients of a server.
const CLIENTS: [&[&str]; 12] = [
    &["info"],
    &["stats"],
    &["watch"],
    &["set"],
    &["enable"],
    &["disable"],
    &["reset"],
    &["recover"],
    &["record"],
    &["hand"],
    &["scene", "show"],
    &["scene", "load"],
];

/// Returns whether a command line begins with these words, after the name of the program.
fn is_command(arguments: &[OsString], words: &[&str]) -> bool {
    arguments.len() > words.len() && arguments[1..].iter().zip(words).all(|(argument, word)| argument == word)
}

/// Returns what an argument means that the command does not have.
fn argument(answer: &clap::Error, arguments: &[OsString]) -> Option<String> {
    let Some(ContextValue::String(word)) = answer.get(ContextKind::InvalidArg) else { return None };
    // An option that is only mistyped is named by clap.
    if answer.get(ContextKind::SuggestedArg).is_some() {
        return None;
    }
    let is_client = CLIENTS.iter().any(|client| is_command(arguments, client));
    let option = word.strip_prefix("--");
    let meaning = match option.map(|option| option.split_once('=').map_or(option, |(name, _)| name)) {
        _ if is_command(arguments, &["server"]) && VERBOSE.contains(&word.as_str()) => {
            "the variable HBOT_LOG says what is logged, as in `HBOT_LOG=debug hbot server`".to_owned()
        }
        None if is_command(arguments, &["server"]) && word.ends_with(".toml") => {
            format!("say what the file is: `--rig {word}` or `--scene {word}`")
        }
        None if is_command(arguments, &["server"]) => {
            let scene =
                ShelfScene::named(word).map(|_| word.as_str()).or_else(|| ShelfScene::similar(word))?;
            format!("`--scene {scene}` starts with a ready-made scene")
        }
        Some("json") if is_command(arguments, &["set"]) => {
            "`hbot set` prints for people; `hbot info --json` prints the scene for programs".to_owned()
        }
        Some(key) if is_command(arguments, &["set"]) => {
            format!("write a parameter without dashes, as in `{key}=VALUE`; {SHOW_SCENE}")
        }
        Some("kind") if is_command(arguments, &["scene", "new"]) => {
            "the kinds of the scene's effects are `--effect KIND`".to_owned()
        }
        None if is_client && word.contains(':') => format!("`--server {word}` names the server"),
        Some("port") if is_client => "`--server HOST:PORT` names the server".to_owned(),
        _ => return None,
    };
    Some(format!("{word:?} is no argument here: {meaning}"))
}

/// Returns what an unknown command means.
fn command(answer: &clap::Error, arguments: &[OsString]) -> Option<String> {
    let Some(ContextValue::String(word)) = answer.get(ContextKind::InvalidSubcommand) else { return None };
    if is_command(arguments, &["scene", word]) && ShelfScene::named(word).is_some() {
        return Some(format!(
            "`hbot scene load {word}` loads this scene, and `hbot scene plot {word}` draws it"
        ));
    }
    let behind = |group| is_command(arguments, &[group, word]);
    let of_group =
        HABITS_OF_GROUPS.iter().find(|(group, words, _)| behind(group) && words.contains(&word.as_str()));
    if let Some((group, _, meaning)) = of_group {
        return Some(format!("{word:?} is no command of `hbot {group}`: {meaning}"));
    }
    if behind("hand") && hand::axis(word).is_ok() {
        let rest: Vec<_> = arguments[2..].iter().map(|word| word.to_string_lossy()).collect();
        return Some(format!("say what the hand does: `hbot hand turn {}`", rest.join(" ")));
    }
    // The commands of `hbot scene` and `hbot rig` have other names.
    if arguments.get(1).is_none_or(|first| first != word.as_str()) {
        return None;
    }
    if STUDIES.contains(&word.as_str()) {
        let words: Vec<_> = arguments[2..].iter().map(|word| word.to_string_lossy()).collect();
        let words = if words.is_empty() { "--help".to_owned() } else { words.join(" ") };
        return Some(format!(
            "studies are a program by themselves; run `cargo run --release -p hbot-study -- {words}`"
        ));
    }
    if ShelfScene::named(word).is_some() {
        return Some(format!("{word:?} is a ready-made scene: `hbot scene load {word}` loads it"));
    }
    if kinds().iter().any(|kind| kind.name == word.as_str()) {
        return Some(format!(
            "{word:?} is a kind of effect: `hbot scene new FILE --effect {word}` writes a scene with one"
        ));
    }
    if let Some((_, meaning)) = HABITS.iter().find(|(words, _)| words.contains(&word.as_str())) {
        return Some(format!("{word:?} is no command: {meaning}"));
    }
    did_you_mean(&word.to_lowercase(), ["estop"].into_iter().chain(STOPS))?;
    Some(format!("NOT STOPPED: {word:?} is no command. `hbot estop` stops the rig"))
}
