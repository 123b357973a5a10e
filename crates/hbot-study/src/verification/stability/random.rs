//! A search for scenes that break the simulated rig: random effects and phenomena within their
//! legal ranges, loaded one after another while the loop runs.
//!
//! The scenes are made from the schemas of the catalogue. New kinds and phenomena take part without
//! a change here.

use hbot_config::rig::RigConfig;
use hbot_config::scene::{Listed, kinds, phenomena};
use hbot_config::{RunningScene, SceneFile};
use hbot_core::inputs::Command;
use hbot_plot::short;
use serde_json::{Map, Value, json};

use crate::report::Report;
use crate::rng::Rng;
use crate::whole::{Whole, prototype, scene_of};

/// Number of ticks of the search, and of the search with `--quick`.
const TICKS: [u64; 2] = [10_000_000, 30_000];
/// Number of scenes that one loop runs one after another.
const SCENES: u32 = 20;
/// Largest angular speed of the sphere that is not a sign of an unstable simulation, rad/s.
///
/// The fastest legal hand moves its target at up to 3 rad x 2 pi 20 Hz = 377 rad/s about each axis.
/// In the coordinates of the target, a turn of 3 rad can make this up to twice as fast.
const FASTEST: f64 = 1.0e4;

/// What the search found.
#[derive(Debug, Default)]
pub(super) struct Search {
    ticks: u64,
    scenes: u64,
    rigs: u64,
    /// Number of scenes in which the state of the plant was not finite, or too fast.
    broken: u64,
    /// Number of ticks after which the solver of the nonsmooth plant had not converged.
    unsolved: u64,
    /// Largest angular speed of the sphere, rad/s.
    fastest: f64,
    /// The first scene that broke the plant, with its rig's seed.
    first: Option<String>,
}

/// Searches with the seed `seed` for `ticks` ticks.
pub(super) fn search(seed: u64, ticks: u64) -> Search {
    let mut found = Search::default();
    let lists = [kinds(), phenomena()];
    while found.ticks < ticks {
        let of_rig = seed.wrapping_add(found.rigs.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let mut rng = Rng(of_rig);
        let config = rig(&mut rng);
        found.rigs += 1;
        run(&mut found, &mut rng, &config, &lists, of_rig);
    }
    found
}

/// Runs random scenes one after another on one rig, until one breaks the plant.
fn run(found: &mut Search, rng: &mut Rng, config: &RigConfig, lists: &[Vec<Listed>; 2], seed: u64) {
    let ideal = json!({"name": "none"});
    let mut whole = Whole::new(config, scene_of(ideal), Default::default());
    let mut running = RunningScene::new();
    for _ in 0..SCENES {
        let Some(file) = scene(rng, lists) else { continue };
        let text = file.to_json();
        whole.rig_mut().set_phenomena(file.simulate().copied().unwrap_or_default());
        whole.load(running.load(file));
        found.scenes += 1;
        let ticks = 1 << (4 + (rng.unit() * 7.0) as u32);
        for tick in 0..ticks {
            let command = match tick {
                1 => Some(Command::Reset),
                2 => Some(Command::Enable),
                _ => None,
            };
            whole.step(command);
            found.ticks += 1;
            let (state, effort) = (whole.rig().state(), whole.rig().dynamics().effort());
            found.unsolved += u64::from(effort.is_some_and(|effort| !effort.converged));
            let speed = state.omega.length();
            let finite = state.q.is_finite() && state.joints().iter().all(|angle| angle.is_finite());
            if !(finite && speed < FASTEST) {
                found.broken += 1;
                found
                    .first
                    .get_or_insert_with(|| format!("seed {seed}, tick {tick}, {speed:.1e} rad/s: {text}"));
                return;
            }
            found.fastest = found.fastest.max(speed);
        }
    }
}

/// Returns the prototype, or in one case of two a rig of another size, mass and rate.
fn rig(rng: &mut Rng) -> RigConfig {
    if rng.unit() < 0.5 {
        return prototype(&[]);
    }
    let mut decade = |low: f64, high: f64| low * libm::pow(high / low, rng.unit());
    prototype(&[
        ("sphere.mass", json!(decade(0.02, 5.0))),
        ("sphere.radius", json!(decade(0.03, 0.3))),
        ("loop.rate_hz", json!(decade(250.0, 4000.0) as u32)),
        ("limits.speed", json!(decade(3.0, 1000.0))),
    ])
}

/// Returns a random scene of up to four effects, or `None` if the values drawn do not fit each
/// other.
fn scene(rng: &mut Rng, [kinds, phenomena]: &[Vec<Listed>; 2]) -> Option<SceneFile> {
    let effects: Vec<Value> = (0..(rng.unit() * 4.0) as usize)
        .map(|i| {
            let kind = &kinds[(rng.unit() * kinds.len() as f64) as usize];
            let mut effect = table(rng, &kind.schema, 0.3);
            effect.insert("kind".to_owned(), json!(kind.name));
            effect.insert("id".to_owned(), json!(format!("e{i}")));
            effect.into()
        })
        .collect();
    let mut simulate = Map::new();
    for phenomenon in phenomena {
        if rng.unit() < 0.35 {
            simulate.insert(phenomenon.name.to_owned(), table(rng, &phenomenon.schema, 0.6).into());
        }
    }
    SceneFile::from_json(json!({"name": "random", "effect": effects, "simulate": simulate})).ok()
}

/// Returns random values for some of the properties of `schema`, each with the probability `share`.
fn table(rng: &mut Rng, schema: &Value, share: f64) -> Map<String, Value> {
    let mut table = Map::new();
    for (name, property) in schema["properties"].as_object().into_iter().flatten() {
        if rng.unit() < share
            && let Some(value) = value(rng, property)
        {
            table.insert(name.clone(), value);
        }
    }
    table
}

/// Returns a random legal value for a property: a bound of its range, zero, or a number whose
/// logarithm is uniformly distributed. Returns `None` if the property is no number, list of
/// numbers, or truth value.
fn value(rng: &mut Rng, schema: &Value) -> Option<Value> {
    if schema["type"] == "boolean" {
        return Some(json!(rng.unit() < 0.5));
    }
    if schema["type"] == "array" {
        let count = schema["minItems"].as_u64().unwrap_or(3);
        return (0..count).map(|_| value(rng, &schema["items"])).collect::<Option<Vec<_>>>().map(Value::from);
    }
    let above = schema["exclusiveMinimum"].as_f64();
    let low = above.or(schema["minimum"].as_f64())?;
    let high = schema["maximum"].as_f64()?;
    let sign = if low < 0.0 && rng.unit() < 0.5 { -1.0 } else { 1.0 };
    let number = match (rng.unit() * 8.0) as u32 {
        0 => high,
        1 => low,
        2 => 0.0,
        _ => sign * high * libm::pow(10.0, rng.between(-5.0, 0.0)),
    };
    let number = number.clamp(low, high);
    if schema["type"] == "integer" { Some(json!(number as i64)) } else { Some(json!(number)) }
}

/// Adds what the search found to the report.
pub(super) fn study(report: &mut Report, found: &Search) {
    report.heading("Random scenes");
    report.say(&format!(
        "{} random scenes on {} random rigs, {} ticks of the whole loop in virtual time: effects and phenomena of all kinds with values in their whole ranges, one scene after another \
         without a pause. The plant stays finite in all but {}. The sphere's largest speed is {} rad/s: a hand that moves as fast as a scene may ask turns it so. In {} ticks the last step of \
         the nonsmooth plant was not solved to the last digit.",
        found.scenes, found.rigs, found.ticks, found.broken, short(found.fastest), found.unsolved
    ));
    report.family("random_{what} | 1 | number of ticks and scenes of the search, of scenes that broke the plant, and of ticks that the solver left unsolved");
    report.family("random_fastest | rad/s | largest angular speed of the sphere in the search");
    report.figure("random_ticks".to_owned(), found.ticks as f64);
    report.figure("random_scenes".to_owned(), found.scenes as f64);
    report.figure("random_broken".to_owned(), found.broken as f64);
    report.figure("random_unsolved".to_owned(), found.unsolved as f64);
    report.figure("random_fastest".to_owned(), found.fastest);
    let first = found.first.clone().unwrap_or_else(|| "none".to_owned());
    report.check("random scenes: none breaks the simulated rig", first, found.broken == 0);
}

/// Runs the search as part of the study.
pub(super) fn measure(quick: bool) -> Search {
    search(1, TICKS[usize::from(quick)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rig on which an earlier version of the plant broke: stiff contacts behind gears with a
    /// large loss.
    #[test]
    fn a_rig_that_once_broke_the_plant_does_not() {
        let found = search(2_647_579_110_490_112_412, 1);
        assert_eq!(found.broken, 0, "{found:?}");
    }

    /// A short search breaks nothing, reaches the nonsmooth plant and fast spheres, and gives the
    /// same result again.
    #[test]
    fn a_short_search_finds_nothing() {
        let found = search(6, 40_000);
        assert_eq!(found.broken, 0, "{found:?}");
        assert!(found.scenes > 100 && found.rigs > 5 && found.fastest > 30.0, "{found:?}");
        assert_eq!(search(6, 40_000).fastest.to_bits(), found.fastest.to_bits());
    }
}
