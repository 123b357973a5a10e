//! What a rig cannot make of a scene or may not keep stable, and what has no effect in it.

use std::sync::LazyLock;

use hbot_core::CompiledScene;
use hbot_core::render::around::Spot;
use serde_json::{Map, Value};

use super::bound::StiffnessBound;
use super::finding::{Finding, Why};
use super::judge::Judge;
use super::sampled::HOLDS;
use super::warning::Warning;
use crate::scene::{IdleKey, Listed, RunningScene, SceneEffect, kinds};
use crate::{RigConfig, SceneFile};

/// The kinds of effects with their schemas, which name the unit of each parameter.
static KINDS: LazyLock<Vec<Listed>> = LazyLock::new(kinds);

/// Units of the parameters that a rig limits.
const TORQUE: &str = "N m";
const STIFFNESS: &str = "N m/rad";
const DAMPING: &str = "N m s/rad";
const MASS: &str = "kg";
const INERTIA: &str = "kg m²";
/// Units of the parameters that make an effect stiff, the most direct one first.
const STIFF: [&str; 3] = [STIFFNESS, TORQUE, MASS];

/// The torque that a rig can make, and the loop that decides what it keeps stable.
#[derive(Debug, Clone)]
pub struct Abilities {
    /// Largest torque on the sphere, N m.
    pub torque: f64,
    /// Rate of the loop, Hz.
    pub rate_hz: u32,
    /// Inertia of the sphere, kg m². `None` if it is not known.
    pub inertia: Option<f64>,
    /// Judges what the loop keeps stable. `None` if the inertias in the rig file contradict each
    /// other.
    pub judge: Option<Judge>,
    /// Time constant of the motors' torque by which stiffness is judged, s. `None` if a scene
    /// cannot make the motors later, because the rig is real.
    pub simulated_lag: Option<f64>,
}

impl Abilities {
    /// Computes the abilities of a rig.
    #[must_use]
    pub fn of(config: &RigConfig) -> Self {
        let judge = StiffnessBound::of(config).map(|bound| Judge {
            sampled: bound.sampled().clone(),
            torque: config.rig.limits.torque,
            torque_rate: config.rig.limits.torque_rate,
            speed: config.rig.limits.speed,
            passive: config.rig.methods.passivity.is_some(),
        });
        Self {
            torque: config.rig.limits.torque,
            rate_hz: config.rate_hz,
            inertia: Some(config.rig.device.sphere_inertia()),
            simulated_lag: judge
                .as_ref()
                .filter(|_| config.link.port.is_simulated())
                .map(|judge| judge.sampled.lag),
            judge,
        }
    }

    /// Returns a warning for each effect that the rig does not keep stable, for each parameter
    /// that asks for more torque than the rig makes or a larger virtual mass than the loop renders,
    /// and for each that has no effect because of the values of others.
    ///
    /// Stability is judged by [`Judge`]: for a sphere without friction, free and in two hands, at
    /// each place where a law is steepest or changes.
    #[must_use]
    pub fn warnings(&self, scene: &SceneFile) -> Vec<Warning> {
        let compiled = RunningScene::new().load(scene.clone());
        let mut found = self.unstable(scene, &compiled);
        for effect in scene.effects() {
            for (name, torque) in values(effect, TORQUE).filter(|(_, torque)| *torque > self.torque) {
                let (id, most) = (effect.id(), self.torque);
                found.push(Warning::of(id, format!(
                    "{name} {torque} N m is more than this rig makes; the sum of all torques is cut off at {most} N m \
                     (limits.torque)"
                )));
            }
        }
        found.extend(self.too_heavy(scene, &compiled));
        found.extend(in_vain(scene));
        found.extend(self.too_late(scene));
        found
    }

    /// Returns a warning for each virtual mass of which the loop renders only a part.
    fn too_heavy(&self, scene: &SceneFile, compiled: &CompiledScene) -> Vec<Warning> {
        let period = 1.0 / f64::from(self.rate_hz);
        let part = self.inertia.map_or(1.0, |inertia| compiled.masses(inertia, period, |_, _| {}));
        let asked = scene
            .effects()
            .iter()
            .flat_map(|effect| values(effect, INERTIA).map(move |(name, mass)| (effect.id(), name, mass)));
        let told = asked.filter(|(.., mass)| part < 1.0 && *mass > 0.0).map(|(id, name, mass)| {
            let rendered = rounded_down(part * mass);
            Warning::of(id, format!(
                "{name} {mass} kg m² is more than this loop keeps stable; it renders {rendered} kg m². With a longer \
                 smoothing it renders more"
            ))
        });
        told.collect()
    }

    /// Returns a warning for each effect that the rig does not keep stable.
    fn unstable(&self, scene: &SceneFile, compiled: &CompiledScene) -> Vec<Warning> {
        let Some(judge) = &self.judge else { return Vec::new() };
        judge.findings(compiled).iter().map(|finding| self.warning(scene, finding)).collect()
    }

    fn warning(&self, scene: &SceneFile, finding: &Finding) -> Warning {
        let effect = &scene.effects()[finding.effect];
        let (id, rate) = (effect.id(), self.rate_hz);
        let place = place(scene, finding);
        let about = finding.axis.map_or(String::new(), |axis| {
            format!(" about {:?}", axis.to_array().map(|x| (x * 100.0).round() / 100.0 + 0.0))
        });
        let whom = if finding.hold == HOLDS[0] { "the sphere" } else { "the sphere in a hand" };
        // What the effect's own key must become for its law to become `part` of what it is.
        let key = |units: &[&'static str]| {
            units.iter().find_map(|unit| values(effect, unit).max_by(|a, b| a.1.total_cmp(&b.1)))
        };
        let gain = effect.gain().max(1.0e-9);
        let softer = |units: &[&'static str], part: f64| {
            let (name, value) = key(units).filter(|_| part > 0.0)?;
            Some(format!("{name} = {} or less", rounded_down(value * part / gain)))
        };
        // Effects of many kinds have no damping of their own.
        let damped = |added: f64| match key(&[DAMPING]) {
            Some((name, own)) => format!("set {name} = {} or more", rounded_up((own + added) / gain)),
            None => format!("add a damper with damping = {} or more", rounded_up(added)),
        };
        // A tap on a sphere makes swings that a torque at its limits cannot end.
        let after = match &self.judge {
            Some(judge) if finding.limited => format!(
                " after a tap that takes the torque to its limits ({} N m, {} N m/s)",
                near(judge.torque),
                near(judge.torque_rate)
            ),
            _ => String::new(),
        };
        let shakes = |why, cure| Warning {
            why: Some(why),
            remedy: Some(cure),
            shakes: true,
            ..Warning::of(id, format!("may shake {whom}{about} {place}"))
        };
        match finding.why {
            Why::Stiff { stiffness, stable, damping, cure } => {
                let most = rounded_down(stiffness * stable);
                let whatever = if cure.added.is_none() { ", with any damping" } else { "" };
                let added = cure.added.map(damped);
                // Softer, a wall is touched at another place, where no more than `most` is stable.
                let own = match key(&[STIFFNESS]) {
                    Some((_, value)) => cure.own.min(stiffness * stable / value.max(1.0e-9)),
                    None => cure.own,
                };
                let softer = softer(&STIFF, own).map(|key| format!("set {key}"));
                let cures: Vec<String> = added.into_iter().chain(softer).collect();
                let cure = match &cures[..] {
                    [] => "make the effects of the scene softer".to_owned(),
                    cures => cures.join(", or "),
                };
                let why = format!(
                    "the scene has {} N m/rad and a damping of {} N m s/rad there, and at {rate} Hz at most {most} N m/rad is \
                     stable{after}{whatever}",
                    near(stiffness),
                    near(damping),
                );
                shakes(why, cure)
            }
            Why::Damped { damping, stable, own } => {
                let cure = softer(&[DAMPING], own).map_or("damp less".to_owned(), |key| format!("set {key}"));
                let why = format!(
                    "the damping of the scene, {} N m s/rad, acts too late, and at {rate} Hz at most {} is stable{after}",
                    near(damping),
                    rounded_down(damping * stable),
                );
                shakes(why, cure)
            }
            Why::Rings { added } => {
                let what = format!("a free sphere swings for more than 3 s after a tap{about} {place}");
                Warning { remedy: Some(damped(added)), ..Warning::of(id, what) }
            }
            Why::Bounces { times } => {
                // A wall that damps more is touched for a shorter time, so a fifth more is told.
                let cure = match key(&[DAMPING]) {
                    Some((name, own)) if own > 0.0 => {
                        format!("set {name} = {} or more", rounded_up(1.2 * own * times / gain))
                    }
                    _ => "give it a damping".to_owned(),
                };
                let what = format!(
                    "walls throw a free sphere back and forth for more than 3 s after a tap{about} {place}"
                );
                Warning { remedy: Some(cure), ..Warning::of(id, what) }
            }
            Why::Turning { speed, damping } => {
                let reaches = if speed.is_finite() {
                    format!(" up to {} rad/s", rounded_down(speed))
                } else {
                    String::new()
                };
                let what = format!(
                    "a free sphere that turns{about} gains speed{reaches}, because its torque acts late"
                );
                let cure = format!(
                    "add {} N m s/rad of damping, or set passivity = true in the rig file",
                    rounded_up(damping)
                );
                Warning { remedy: Some(cure), ..Warning::of(id, what) }
            }
        }
    }

    /// Returns a warning if the simulated motors of a scene are later than those by which a
    /// stiffness is judged.
    fn too_late(&self, scene: &SceneFile) -> Option<Warning> {
        let (simulated, judged) = (scene.simulate()?.motor?.lag_s, self.simulated_lag?);
        (simulated > judged).then(|| {
            Warning::plain(format!(
                "simulate.motor: lag_s {simulated} s is more than the lag of {judged} s by which a stiffness is judged \
                 (torque_lag of the rig file's joints); springs buzz sooner"
            ))
        })
    }
}

/// Returns where a finding is, in words.
fn place(scene: &SceneFile, finding: &Finding) -> String {
    let whose = match &scene.effects()[finding.place.effect] {
        _ if finding.place.effect == finding.effect => "its".to_owned(),
        other => format!("the {}'s", other.id()),
    };
    match finding.place.spot {
        _ if finding.away => "when it has turned away from its rest".to_owned(),
        // The sphere's rest, whichever effects bring it there.
        Spot::Rest => "at its rest".to_owned(),
        Spot::Notch => format!("in {whose} notch"),
        Spot::Wall => format!("at {whose} wall"),
        Spot::Edge => format!("at the end of {whose} dead band"),
        Spot::Bump => format!("on {whose} bumps"),
    }
}

/// Returns a number with two digits, or with three if it has more: what the user has chosen is told
/// as it is.
fn near(x: f64) -> String {
    let [two, three] = [2, 3].map(|digits| rounded(x, digits, f64::round));
    if two.parse() == three.parse::<f64>() { two } else { three }
}

/// Returns a number with two digits, rounded down so that what is stable stays so. Borders of
/// stability are found to a few per cent, so that more digits would mean nothing.
#[must_use]
pub fn rounded_down(x: f64) -> String {
    rounded(x, 2, f64::floor)
}

/// Returns a number with two digits, rounded up.
fn rounded_up(x: f64) -> String {
    rounded(x, 2, f64::ceil)
}

fn rounded(x: f64, digits: i32, round: fn(f64) -> f64) -> String {
    if !(x > 1.0e-9 && x.is_finite()) {
        return if x > 1.0e-9 { format!("{x}") } else { "0".to_owned() };
    }
    let unit = 10.0_f64.powf(x.log10().floor() - f64::from(digits - 1));
    // A value that has these digits already stays as it is, in spite of rounding errors.
    let units = x / unit;
    let whole = if (units - units.round()).abs() < 1.0e-9 * units { units.round() } else { round(units) };
    let places = (f64::from(digits - 1) - x.log10().floor()).max(0.0) as usize;
    format!("{:.places$}", whole * unit)
}

/// Returns a warning for each parameter that the file of the scene names although it has no effect
/// because of the values of others.
pub fn in_vain(scene: &SceneFile) -> impl Iterator<Item = Warning> {
    scene.effects().iter().flat_map(|effect| {
        effect.in_vain().iter().map(move |IdleKey { name, remedy, .. }| Warning {
            remedy: Some(format!("to make it count, {remedy}")),
            ..Warning::of(effect.id(), format!("{name} has no effect here"))
        })
    })
}

/// Returns the names of the parameters of `effect` that have the unit `unit`, with their values
/// times the effect's gain. Of a vector it is the length. Of a matrix it is the largest sum of a
/// row's absolute values, which its largest eigenvalue does not exceed. Parameters that have no
/// effect because of the values of others are left out.
fn values(effect: &SceneEffect, unit: &'static str) -> impl Iterator<Item = (String, f64)> {
    let kind = KINDS.iter().find(|kind| kind.name == effect.kind_name());
    let written = effect.to_json().as_object().cloned().unwrap_or_else(Map::new);
    let gain = effect.gain();
    written.into_iter().filter_map(move |(name, value)| {
        let property = &kind?.schema["properties"][&name];
        let is_idle = effect.idle().iter().any(|key| key.name == name);
        let size = size(&value).filter(|_| property["unit"] == unit && !is_idle)?;
        Some((name, gain * size))
    })
}

fn size(value: &Value) -> Option<f64> {
    let Some(rows) = value.as_array() else { return value.as_f64().map(f64::abs) };
    let numbers = |row: &Value| -> Option<Vec<f64>> { row.as_array()?.iter().map(Value::as_f64).collect() };
    match rows.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>() {
        Some(vector) => Some(vector.iter().map(|x| x * x).sum::<f64>().sqrt()),
        None => {
            let sums = rows.iter().map(|row| Some(numbers(row)?.iter().map(|x| x.abs()).sum()));
            sums.collect::<Option<Vec<f64>>>().map(|sums| sums.into_iter().fold(0.0, f64::max))
        }
    }
}
