//! The guard against spheres that shake by themselves: it must fire on scenes that shake, and not in
//! any ready-made scene.

use std::path::PathBuf;

use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::Quat;
use hbot_core::device::MAX_JOINTS;
use hbot_core::inputs::{Command, Complaints, Inputs, JointReadings};
use hbot_core::outputs::State;
use hbot_core::rig::{Rig, Zero};
use hbot_core::{CompiledScene, Controller, Vec3};
use hbot_sim::hand::Grip;
use hbot_sim::phenomena::Hand;
use hbot_sim::plant::{Method, Plant, PlantState, SpringDamper, Sum};

use crate::bench::altered;

/// A sphere in a hand, or a free one with the losses of its own bearings, under a scene.
struct Run {
    rig: Rig,
    controller: Controller,
    scene: CompiledScene,
    plant: Plant,
    motion: PlantState,
    grip: Option<Grip>,
    held: [f64; MAX_JOINTS],
    tick: u64,
}

/// Own viscous damping of the sphere, N m s/rad.
const OWN: f64 = 0.0005;

impl Run {
    fn new(scene: &SceneFile, hand: Option<Hand>) -> Self {
        let rig = altered(&RigConfig::prototype().rig, |rig| {
            rig.joints.iter_mut().for_each(|joint| joint.zero = Zero::Assume);
            rig.methods.passivity = None;
        });
        let mut plant = Plant::new(&rig.device).unwrap();
        if let Some(hand) = hand {
            plant.set_sphere_inertia(plant.sphere_inertia() + hand.inertia);
        }
        let motion = PlantState::default();
        Self {
            rig,
            controller: Controller::new(rig),
            scene: RunningScene::new().load(scene.clone()),
            plant,
            motion,
            grip: hand.map(|hand| Grip::new(hand, 0.0, motion.q)),
            held: [0.0; MAX_JOINTS],
            tick: 1,
        }
    }

    /// Runs a tick. Every reading is a tick old when its torque begins. `push` is a torque on the
    /// sphere beside that of the motors, N m.
    fn step(&mut self) -> State {
        let (angles, speeds) = (self.motion.joints(), self.plant.joint_rates(&self.motion));
        let mut feedback = JointReadings {
            sequence: (self.tick - 1) as u32,
            counts: [0; MAX_JOINTS],
            rates: [0.0; MAX_JOINTS],
            index_seen: 0,
            complaints: Complaints::default(),
        };
        for j in 0..self.rig.device.joints() {
            let joint = &self.rig.joints[j];
            feedback.counts[j] = (angles[j] / joint.radians_per_count()).round() as i64 as i32;
            feedback.rates[j] = if joint.reversed { -speeds[j] } else { speeds[j] };
        }
        let h = self.rig.timing.period_s();
        let time = self.tick as f64 * h;
        let own = SpringDamper { stiffness: 0.0, damping: OWN, reference: Quat::IDENTITY };
        match self.grip {
            Some(grip) => {
                self.plant.step(Method::Rk4, &mut self.motion, time, h, &self.held, &Sum(own, grip))
            }
            None => self.plant.step(Method::Rk4, &mut self.motion, time, h, &self.held, &own),
        };
        let mut inputs = Inputs { feedback: Some(feedback), ..Inputs::quiet(self.tick) };
        if self.tick == 3 {
            inputs.commands.push(Command::Enable).unwrap();
        }
        let state = self.controller.tick(&self.scene, &inputs).state;
        self.held = state.joint_torque;
        self.tick += 1;
        state
    }

    /// Gives the sphere an angular velocity as a tap does.
    fn tap(&mut self, omega: Vec3) {
        self.motion.omega += omega;
    }
}

const DEFAULT: Hand = Hand { stiffness: 3.0, damping: 0.05, inertia: 2.0e-3, amplitude: 0.25, rate: 0.25 };

fn toml(text: &str) -> SceneFile {
    SceneFile::from_toml(text, "x.toml").unwrap_or_else(|e| panic!("{e}"))
}

fn effect(kind: &str, rest: &str) -> String {
    format!("[[effect]]\nid = '{kind}'\nkind = '{kind}'\n{rest}\n")
}

fn shaking() -> Vec<(&'static str, String)> {
    let many = |n: usize, rest: &str| -> String {
        (0..n)
            .map(|i| format!("[[effect]]\nid = 's{i}'\nkind = 'spring'\nanchor = 'here'\n{rest}\n"))
            .collect()
    };
    let spring = |k: f64, rest: &str| effect("spring", &format!("anchor = 'here'\nstiffness = {k}\n{rest}"));
    vec![
        ("3 springs of 15", many(3, "stiffness = 15\ndamping = 0.01")),
        ("20 springs of 20", many(20, "stiffness = 20\ndamping = 0.002")),
        ("spring 40 one axis", spring(40.0, "damping = [[0.1,0,0],[0,0,0],[0,0,0]]")),
        (
            "spring 300 wall",
            spring(300.0, "") + &effect("end_stop", "cone = 2.7\nstiffness = 1\ndamping = 0.7"),
        ),
        ("spring 40 damper deadband", spring(40.0, "") + &effect("damper", "damping = 0.1\ndeadband = 100")),
        (
            "spring 40 detents",
            spring(40.0, "") + &effect("detents", "axis = [1,0,0]\nstrength = 0\ndamping = 0.1"),
        ),
        ("wall at 0", effect("end_stop", "cone = 0\nanchor = 'here'\nstiffness = 200\ndamping = 0.45")),
        ("snaps .9", effect("snaps", "strength = 0.9\nwidth = 0.01")),
        ("snaps .3", effect("snaps", "strength = 0.3\nwidth = 0.02\ndamping = 0")),
        ("magnet .9 .01", effect("magnet", "anchor = 'here'\nstrength = 0.9\nwidth = 0.01")),
        ("magnet .9 .1", effect("magnet", "anchor = 'here'\nstrength = 0.9\nwidth = 0.1")),
        ("detents 720", effect("detents", "count = 720\nstrength = 0.9")),
        ("texture 500", effect("texture", "waves = 500\ndepth = 0.9")),
        ("texture 100", effect("texture", "waves = 100\ndepth = 0.1")),
        ("pendulum 100", effect("pendulum", "mass = 100\ncentre = [0,0,-10]\ngravity = 100")),
        ("friction .9", effect("friction", "torque = 0.9\nstiffness = 1000\ndamping = 0")),
        ("friction .3", effect("friction", "torque = 0.3\nstiffness = 100")),
        ("friction .3 defaults", effect("friction", "torque = 0.3")),
    ]
}

fn ready_made() -> Vec<(String, SceneFile)> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let mut all: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    all.retain(|path| path.extension().is_some_and(|e| e == "toml"));
    all.sort();
    all.iter()
        .map(|p| {
            (
                p.file_stem().unwrap().to_string_lossy().into_owned(),
                SceneFile::from_path(p).unwrap_or_else(|e| panic!("{e}")),
            )
        })
        .collect()
}

struct Channel {
    sign: i32,
    last: u64,
    energy: f64,
    peak: f64,
    period: u64,
    run: Vec<(f64, f64, f64)>,
    best: Vec<(f64, f64, f64)>,
}

fn measure(
    run: &mut Run,
    ticks: u64,
    mut act: impl FnMut(&mut Run, u64),
    a: f64,
) -> (usize, Vec<(f64, f64, f64)>, f64) {
    let mut ch: Vec<Channel> = (0..3)
        .map(|_| Channel { sign: 0, last: 0, energy: 0.0, peak: 0.0, period: 0, run: vec![], best: vec![] })
        .collect();
    let mut most = 0.0_f64;
    for k in 0..ticks {
        act(run, k);
        let s = run.step();
        if k + 1000 > ticks {
            most = most.max(s.omega.length());
        }
        for (i, c) in ch.iter_mut().enumerate() {
            let w = s.omega[i];
            c.peak = c.peak.max(w.abs());
            let up = w > a && c.sign <= 0;
            if up {
                let period = k - c.last;
                if period < 100 {
                    c.run.push((1000.0 / period as f64, c.peak, s.energy - c.energy));
                } else {
                    c.run.clear();
                }
                if c.run.len() > c.best.len() {
                    c.best = c.run.clone();
                }
                c.last = k;
                c.energy = s.energy;
                c.peak = 0.0;
                c.sign = 1;
            }
            if w < -a {
                c.sign = -1;
            }
            let _ = c.period;
        }
    }
    let c = ch.into_iter().max_by_key(|c| c.best.len()).unwrap();
    (c.best.len(), c.best, most)
}

#[test]
fn measured() {
    let hands: [(&str, Option<Hand>); 4] = [
        ("free", None),
        ("default", Some(DEFAULT)),
        ("still", Some(Hand { amplitude: 0.0, ..DEFAULT })),
        ("strong", Some(Hand { stiffness: 20.0, damping: 0.3, inertia: 4e-3, amplitude: 0.5, rate: 1.5 })),
    ];
    let show = |name: &str, hand: &str, r: (usize, Vec<(f64, f64, f64)>, f64)| {
        let pick = |k: usize| {
            r.1.get(k).map(|(f, p, e)| format!("{f:.0}Hz {p:.2} {:.2}mJ", e * 1e3)).unwrap_or_default()
        };
        if r.0 > 0 {
            println!(
                "{name:28} {hand:8} cycles {:4} last {:.2} rad/s | {} | {} | {} | {} | {}",
                r.0,
                r.2,
                pick(1),
                pick(3),
                pick(6),
                pick(12),
                pick(r.0 - 1)
            );
        }
    };
    for (name, text) in shaking() {
        for (hand, h) in &hands[..3] {
            let mut run = Run::new(&toml(&text), *h);
            let r = measure(
                &mut run,
                3200,
                |run, k| {
                    if k == 900 {
                        run.tap(Vec3::new(0.0, 0.5, 0.0))
                    } else if k == 1000 {
                        run.tap(Vec3::new(0.5, 0.0, 0.25))
                    }
                },
                0.15,
            );
            show(name, hand, r);
        }
    }
    println!("--- ready-made");
    for (name, file) in ready_made() {
        for (hand, h) in &hands {
            let mut run = Run::new(&file, *h);
            let r = measure(
                &mut run,
                6000,
                |run, k| {
                    if k % 700 == 699 && k > 1000 {
                        run.tap(Vec3::new(0.6, -0.8, 0.7) * (1.0 + (k / 700) as f64 * 0.3))
                    }
                },
                0.15,
            );
            show(&name, hand, r);
        }
    }
}
