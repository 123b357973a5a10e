//! Random sessions: scenes at the edges of their parameters, with streams, leases, loads, enables
//! and stops in any order, and readings that are late or missing. Every tick of every session must
//! respect the limits of size, slew, motors and contacts, the ramps, and the largest age of its
//! reading.
//!
//! `HBOT_SESSION_TICKS=100000000 cargo test --release --test core sessions` runs more sessions.
//! `HBOT_SESSION=1245` runs a single one, whose number a failure reports.

mod judge;
mod scenes;

use crate::prelude::*;
use std::collections::VecDeque;

use hbot_config::{RunningScene, SceneFile};
use hbot_core::design::rig::AllocationMethod;

use self::judge::{Judge, Told};
use crate::bench::{Sphere, reading, rig_with_grip};

/// Number of ticks in one session.
const SESSION: u64 = 4000;
/// Default number of ticks in all sessions.
const TICKS: u64 = 1_000_000;

#[test]
fn whatever_comes_in_any_order_limits_slew_ramps_and_age_hold_in_every_tick() {
    if let Ok(seed) = std::env::var("HBOT_SESSION") {
        let mut seen = Seen::default();
        run(seed.parse().expect("the number of a session"), &mut seen);
        println!("{seen:?}");
        return;
    }
    let ticks = std::env::var("HBOT_SESSION_TICKS").map_or(TICKS, |n| n.parse().expect("a number of ticks"));
    let threads = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    let totals = std::thread::scope(|scope| {
        let worker = |first: u64| {
            move || {
                let mut seen = Seen::default();
                (first..ticks.div_ceil(SESSION)).step_by(threads as usize).for_each(|k| run(k, &mut seen));
                seen
            }
        };
        let workers: Vec<_> = (0..threads).map(|k| scope.spawn(worker(k))).collect();
        workers
            .into_iter()
            .map(|worker| worker.join().unwrap_or_else(|e| std::panic::resume_unwind(e)))
            .fold(Seen::default(), Seen::and)
    });
    println!("{totals:?}");
    // The situations under test do occur in the sessions.
    let per_million = |n: u64| n * 1_000_000 / ticks.max(1);
    assert!(per_million(totals.powered) > 300_000, "{totals:?}");
    assert!(per_million(totals.at_limit) > 10_000, "{totals:?}");
    assert!(totals.forced < totals.powered / 1000, "{totals:?}");
    for n in [totals.enables, totals.far_changes, totals.lost_links, totals.eased, totals.stops] {
        assert!(per_million(n) > 20, "{totals:?}");
    }
}

/// Counts of what happened in some sessions.
#[derive(Debug, Default, Clone, Copy)]
pub struct Seen {
    pub powered: u64,
    pub at_limit: u64,
    pub enables: u64,
    pub far_changes: u64,
    pub lost_links: u64,
    /// Ticks in which motors or contacts limited the torque while it changed at the slew limit.
    pub eased: u64,
    pub stops: u64,
    /// Ticks in which the motors could not hold the last torque closely enough for the slew limit.
    pub forced: u64,
}

impl Seen {
    fn and(self, other: Self) -> Self {
        Self {
            powered: self.powered + other.powered,
            at_limit: self.at_limit + other.at_limit,
            enables: self.enables + other.enables,
            far_changes: self.far_changes + other.far_changes,
            lost_links: self.lost_links + other.lost_links,
            eased: self.eased + other.eased,
            stops: self.stops + other.stops,
            forced: self.forced + other.forced,
        }
    }
}

/// Returns the rigs of the sessions. Each has another limiting factor.
fn rigs() -> [(&'static str, Rig); 7] {
    let with = |alter: fn(&mut hbot_core::RigParts)| altered(&rig(), alter);
    [
        ("plain", rig()),
        ("weak motors", with(|rig| rig.limits.torque = 8.0)),
        ("slippery", rig_with_grip(6.0)),
        ("slow torque", with(|rig| (rig.limits.torque, rig.limits.torque_rate) = (0.9, 8.0))),
        ("passive", with(|rig| rig.methods.passivity = Some(PassivityLimit::of(&rig.device, DT)))),
        (
            "clipped and slippery",
            with(|rig| {
                rig.methods.allocation = AllocationMethod::Clipped;
                rig.limits.torque = 8.0;
                rig.limits.traction = Some(Traction { mu: 0.5, normal_force: 20.0 });
            }),
        ),
        ("a dead motor", with(|rig| rig.joints[1].peak = 0.0)),
    ]
}

/// A session with a server that acts at random and a sphere that turns at random.
struct Session {
    rng: Rng,
    rig: Rig,
    controller: Controller,
    running: RunningScene,
    scene: Box<CompiledScene>,
    sphere: Sphere,
    omega: Vec3,
    /// Readings on the line, each with the tick in which it arrives.
    line: VecDeque<(u64, JointReadings)>,
    /// Delay of readings, ticks.
    delay: u64,
    tick: u64,
    mode: Mode,
}

fn run(seed: u64, seen: &mut Seen) {
    let (name, rig) = rigs()[(seed % 7) as usize];
    let mut session = Session {
        rng: Rng(seed),
        rig,
        controller: Controller::new(rig),
        running: RunningScene::new(),
        scene: Box::new(CompiledScene::empty()),
        sphere: Sphere::new(rig.device),
        omega: Vec3::ZERO,
        line: VecDeque::new(),
        delay: 0,
        tick: 1,
        mode: Mode::Unreferenced,
    };
    let mut judge = Judge::new(rig, format!("session {seed}, {name}"));
    while session.tick < SESSION {
        session.step(&mut judge, seen);
    }
}

impl Session {
    fn step(&mut self, judge: &mut Judge, seen: &mut Seen) {
        let mut told = Told::default();
        if self.rng.once_in(400) {
            self.load(&mut told);
        } else if self.rng.once_in(150) {
            self.set(&mut told);
        }
        let mut inputs = Inputs::quiet(self.tick);
        self.hear(&mut inputs);
        for _ in 0..2 {
            if let Some(command) = self.command() {
                let _ = inputs.commands.push(command);
            }
        }
        let outputs = self.controller.tick(&self.scene, &inputs);
        self.mode = outputs.state.mode;
        told.enabled = inputs.commands.iter().zip(outputs.replies).any(|(command, reply)| {
            *command == Command::Enable && reply == Some(hbot_core::outputs::Reply::Done)
        });
        judge.judge(&inputs, &told, &self.scene, &outputs, seen);
        self.turn();
        self.tick += if self.rng.once_in(500) { 1 + self.rng.below(4) } else { 1 };
    }

    fn load(&mut self, told: &mut Told) {
        let scene = SceneFile::from_json(scenes::scene(&mut self.rng));
        // Scenes that a file must not contain are refused before the loop.
        if let Ok(file) = scene {
            *self.scene = self.running.load(file);
            told.placed = self.scene.effects().iter().map(|effect| effect.slot).collect();
        }
    }

    fn set(&mut self, told: &mut Told) {
        let ids: Vec<_> =
            self.running.file().effects().iter().map(|e| (e.id().to_owned(), e.kind_name())).collect();
        if ids.is_empty() {
            return;
        }
        let (id, kind) = &ids[self.rng.below(ids.len() as u64) as usize];
        let parameters = scenes::parameters(&mut self.rng, kind);
        if let Ok(scene) = self.running.set(id, &parameters) {
            *self.scene = scene;
            if parameters.contains_key("reference") || parameters.contains_key("anchor") {
                told.placed.extend(self.running.slot_of(id).map(|place| place.slot));
            }
        }
    }

    fn hear(&mut self, inputs: &mut Inputs) {
        while self.line.front().is_some_and(|(at, _)| *at <= self.tick) {
            inputs.feedback = self.line.pop_front().map(|(_, feedback)| feedback);
        }
        if self.rng.once_in(200) {
            inputs.corrupt_frames = 1;
        }
    }

    fn command(&mut self) -> Option<Command> {
        let rng = &mut self.rng;
        if matches!(self.mode, Mode::Fault | Mode::Estop) && rng.once_in(40) {
            return Some(Command::Reset);
        }
        if self.mode == Mode::Idle && rng.once_in(40) {
            return Some(Command::Enable);
        }
        let size = [0.1, 1.0, 1e6][rng.below(3) as usize];
        let stamp = Stamp::default();
        match rng.below(6000) {
            0..60 => Some(Command::Stream {
                torque: rng.vector(size),
                valid_ticks: 1 + rng.below(200) as u32,
                stamp,
            }),
            60..80 => Some(Command::ClientLost(OnClientLost::Ramp)),
            80..84 => Some(Command::Disable),
            84..86 => Some(Command::Estop),
            86..89 => Some(Command::Enable),
            89..110 => {
                let effect = *self.scene.effects().first()?;
                Some(Command::Reference {
                    slot: effect.slot,
                    epoch: effect.epoch,
                    q: rotation::exp(rng.vector(2.0)),
                    omega: rng.vector(size),
                    valid_ticks: rng.below(100) as u32,
                    stamp,
                })
            }
            110..115 => Some(Command::Align {
                q: rotation::exp(rng.vector(2.0)),
                weight: rng.between(0.0, 1.0),
                tick: self.tick.saturating_sub(1),
            }),
            _ => None,
        }
    }

    fn turn(&mut self) {
        let rng = &mut self.rng;
        if rng.once_in(300) {
            self.omega = if rng.once_in(2) { Vec3::ZERO } else { rng.vector(0.5 * self.rig.limits.speed) };
        }
        let answer = reading(&self.rig, &self.sphere, self.tick as u32);
        // The rate changes slowly enough that no joint turns too far between two readings, and fast
        // enough for the wheels to steer.
        let omega = self.sphere.omega + (self.omega - self.sphere.omega) * 0.05;
        self.sphere.turn(omega, DT);
        if rng.once_in(700) {
            self.delay = [0, 0, 0, 0, 5, 15, 19, 25, 60][rng.below(9) as usize];
        }
        if !rng.once_in(60) {
            self.line.push_back((self.tick + 1 + self.delay, answer));
        }
    }
}
