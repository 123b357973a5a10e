//! The guard against spheres that shake by themselves: it must fire on scenes that shake, and not
//! in any ready-made scene.

use crate::prelude::*;
use std::path::PathBuf;

use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_sim::hand::Grip;
use hbot_sim::phenomena::Hand;
use hbot_sim::plant::{Method, Plant, PlantState, SpringDamper, Sum};

/// A sphere in a hand, or a free one with the losses of its own bearings, under a scene.
struct Run {
    rig: Rig,
    controller: Controller,
    running: RunningScene,
    scene: CompiledScene,
    plant: Plant,
    motion: PlantState,
    grip: Option<Grip>,
    held: [f64; MAX_JOINTS],
    tick: u64,
    /// Own viscous damping of the sphere, N m s/rad.
    own: f64,
}

/// Own viscous damping of the sphere, N m s/rad.
const OWN: f64 = 0.0005;

impl Run {
    fn new(scene: &SceneFile, hand: Option<Hand>) -> Self {
        Self::guarded(scene, hand, true)
    }

    fn guarded(scene: &SceneFile, hand: Option<Hand>, on: bool) -> Self {
        let rig = altered(&RigConfig::prototype().rig, |rig| {
            // Without the lead more scenes shake.
            rig.lead = None;
            rig.joints.iter_mut().for_each(|joint| joint.zero = Zero::Assume);
            rig.methods.passivity = None;
        });
        let mut plant = Plant::new(&rig.device).unwrap();
        if let Some(hand) = hand {
            plant.set_sphere_inertia(plant.sphere_inertia() + hand.inertia);
        }
        let motion = PlantState::default();
        let mut running = RunningScene::new();
        let scene = running.load(scene.clone());
        Self {
            rig,
            controller: Controller::new(rig).with_shaking_guard(on),
            running,
            scene,
            plant,
            motion,
            grip: hand.map(|hand| Grip::new(hand, 0.0, motion.q)),
            held: [0.0; MAX_JOINTS],
            tick: 1,
            own: OWN,
        }
    }

    fn step(&mut self) -> State {
        self.step_with(None)
    }

    /// Runs a tick with a command. Every reading is a tick old when its torque begins.
    fn step_with(&mut self, command: Option<Command>) -> State {
        let (angles, rates) = (self.motion.joints(), self.plant.joint_rates(&self.motion));
        let feedback = encoders(&self.rig, &angles, &rates, self.tick - 1);
        let h = self.rig.timing.period_s();
        let time = self.tick as f64 * h;
        let own = SpringDamper { stiffness: 0.0, damping: self.own, reference: Quat::IDENTITY };
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
        command.into_iter().for_each(|command| inputs.commands.push(command).unwrap());
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

/// The default hand of the simulated rig.
const DEFAULT: Hand = Hand::USUAL;
/// The same hand, holding still.
const STILL: Hand = Hand { amplitude: 0.0, ..DEFAULT };
/// A strong hand that swings far, and one that swings as fast as a hand can.
const STRONG: Hand =
    Hand { stiffness: 20.0, damping: 0.3, inertia: 4e-3, amplitude: 0.5, rate: 1.5, ..DEFAULT };
const FAST: Hand =
    Hand { stiffness: 20.0, damping: 0.1, inertia: 2e-3, amplitude: 0.1, rate: 6.0, ..DEFAULT };
/// A tap, rad/s.
const TAP: Vec3 = Vec3::new(0.4, -0.5, 0.45);

fn toml(text: &str) -> SceneFile {
    SceneFile::from_toml(text, "x.toml").unwrap_or_else(|e| panic!("{e}"))
}

fn effect(kind: &str, rest: &str) -> String {
    format!("[[effect]]\nid = '{kind}'\nkind = '{kind}'\n{rest}\n")
}

/// Scenes that shake in the hand that holds still, with the slots of the effects that can be
/// blamed.
fn shaking() -> Vec<(&'static str, String, &'static [u8])> {
    let many = |n: usize, rest: &str| -> String {
        (0..n)
            .map(|i| format!("[[effect]]\nid = 's{i}'\nkind = 'spring'\nanchor = 'here'\n{rest}\n"))
            .collect()
    };
    let spring = |k: f64, rest: &str| effect("spring", &format!("anchor = 'here'\nstiffness = {k}\n{rest}"));
    let wall = "cone = 2.7\nstiffness = 1\ndamping = 0.7";
    let dial = "axis = [1,0,0]\nstrength = 0\ndamping = 0.1";
    let stop = "cone = 0\nanchor = 'here'\nstiffness = 200\ndamping = 0.45";
    vec![
        ("three springs", many(3, "stiffness = 15\ndamping = 0.01"), &[0, 1, 2]),
        ("damping about one axis", spring(40.0, "damping = [[0.1,0,0],[0,0,0],[0,0,0]]"), &[0]),
        ("a far wall that damps", spring(300.0, "") + &effect("end_stop", wall), &[0]),
        ("a dead band", spring(40.0, "") + &effect("damper", "damping = 0.1\ndeadband = 100"), &[0]),
        ("a dial that damps", effect("detents", dial) + &spring(40.0, ""), &[1]),
        ("a wall", effect("end_stop", stop), &[0]),
        ("snaps", effect("snaps", "strength = 0.9\nwidth = 0.01"), &[0]),
        ("a magnet", effect("magnet", "anchor = 'here'\nstrength = 0.9\nwidth = 0.01"), &[0]),
        ("a pendulum", effect("pendulum", "mass = 100\ncentre = [0,0,-10]\ngravity = 100"), &[0]),
        ("friction", effect("friction", "torque = 0.3\nstiffness = 100"), &[0]),
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

/// Taps the sphere after a second, and runs five seconds more. Returns all states since the tap.
fn tapped(run: &mut Run) -> Vec<State> {
    for _ in 0..1000 {
        run.step();
    }
    run.tap(TAP);
    (0..5000).map(|_| run.step()).collect()
}

/// Returns the largest rate in the last second of `states`, rad/s.
fn at_last(states: &[State]) -> f64 {
    states[states.len() - 1000..].iter().map(|state| state.omega.length()).fold(0.0, f64::max)
}

#[test]
fn what_shakes_in_a_still_hand_is_found_blamed_and_stopped() {
    for (name, text, blamed) in shaking() {
        let file = toml(&text);
        let bare = tapped(&mut Run::guarded(&file, Some(STILL), false));
        let states = tapped(&mut Run::new(&file, Some(STILL)));
        let found =
            states.iter().find_map(|state| state.shaking).unwrap_or_else(|| panic!("{name}: not found"));
        let after_s = 1e-3 * (found.tick as f64 - 1000.0);
        assert!(bare.iter().all(|state| state.shaking.is_none()), "{name}: off");
        assert!(found.slot.is_some_and(|slot| blamed.contains(&slot)), "{name}: {found:?}");
        assert!(after_s < 1.0 && (5.0..60.0).contains(&found.frequency), "{name}: {found:?}");
        assert!((0.2..10.0).contains(&found.amplitude), "{name}: {found:?}");
        assert!(at_last(&states) < 0.3, "{name}: {} rad/s", at_last(&states));
    }
}

#[test]
fn a_free_sphere_that_swings_by_itself_is_found() {
    for (name, text, _) in shaking() {
        let states = tapped(&mut Run::new(&toml(&text), None));
        // A free sphere leaves the short reach of this magnet.
        let found = states.iter().any(|state| state.shaking.is_some());
        assert!(found || name == "a magnet", "{name}");
    }
}

#[test]
fn no_ready_made_scene_is_taken_for_shaking_in_any_hand_and_with_taps() {
    for (name, file) in ready_made() {
        for hand in [None, Some(DEFAULT), Some(STILL), Some(STRONG), Some(FAST)] {
            let mut run = Run::new(&file, hand);
            for tick in 0..8000 {
                if tick > 900 && tick % 700 == 0 {
                    run.tap(Vec3::new(0.6, -0.8, 0.7) * (0.3 + 0.2 * f64::from(tick % 7)));
                }
                let state = run.step();
                assert_eq!(state.shaking, None, "{name}, {hand:?}, tick {tick}");
            }
        }
    }
}

#[test]
fn a_swing_with_a_reason_is_none_of_the_guards() {
    let spring = effect("spring", "anchor = 'here'\nstiffness = 4\ndamping = 0.01");
    let vibration = effect("vibration", "axis = [0,1,0]\namplitude = 0.3\nfrequency = 9");
    let pulse = effect("pulse", "axis = [0,1,0]\nstrength = 0.8\nduration_s = 0.02\nperiod_s = 0.11");
    let cases = [
        ("vibration", spring.clone() + &vibration),
        ("stream", spring.clone()),
        ("reference", spring.clone()),
        ("pulses", spring + &pulse),
    ];
    for (name, text) in cases {
        let mut run = Run::new(&toml(&text), Some(STILL));
        let mut swing = 0.0_f64;
        for tick in 0..4000_u32 {
            let phase = libm::sin(f64::from(tick) * 0.001 * 9.0 * core::f64::consts::TAU);
            let command = match name {
                "stream" if tick > 900 => Some(crate::bench::stream(Vec3::Y * 0.3 * phase, 30)),
                "reference" if tick > 900 => {
                    let epoch = run.scene.effects()[0].epoch;
                    let q = hbot_core::rotation::exp(Vec3::Y * 0.05 * phase);
                    Some(crate::bench::reference(0, epoch, q, Vec3::ZERO, 5))
                }
                _ => None,
            };
            let state = run.step_with(command);
            assert_eq!(state.shaking, None, "{name}, tick {tick}");
            swing = swing.max(state.omega.y.abs());
        }
        assert!(swing > 0.4, "{name}: {swing} rad/s is no swing");
    }
}

#[test]
fn the_torque_comes_back_slowly_with_another_scene_and_stays_low_with_this_one() {
    let file = toml(&effect("spring", "anchor = 'here'\nstiffness = 40"));
    let mut run = Run::new(&file, Some(STILL));
    let lowered = tapped(&mut run);
    assert!(lowered.iter().any(|state| state.shaking.is_some()));
    // Whoever touches the sphere again and again makes it shake only a few times.
    let mut findings = std::collections::BTreeSet::new();
    for tick in 0..60_000 {
        if tick % 900 == 0 {
            run.tap(TAP);
        }
        findings.extend(run.step().shaking.map(|found| found.tick));
    }
    assert!((1..=8).contains(&findings.len()), "{findings:?}");
    // A calm scene has its full torque after four seconds.
    run.scene = run.running.load(toml(&effect("spring", "stiffness = 2\ndamping = 0.02")));
    let gains: Vec<f64> = (0..6000).map(|_| run.step().shaking.map_or(1.0, |found| found.gain)).collect();
    assert!(gains.windows(2).all(|pair| pair[1] - pair[0] <= 0.001 / 4.0 + 1e-9), "no jump");
    assert!(gains[0] < 0.9 && gains[5999] == 1.0, "{} to {}", gains[0], gains[5999]);
}

/// A spring that is stable for the loop, but hardly damped: its damping of 0.02 N m s/rad is more
/// than the 0.015 N m s/rad that the age of 1.5 ticks takes away. It swings at 9 Hz for seconds
/// after a push, about axes of different inertia, and gives to the sphere's own friction what it
/// had stored. The pushes are those of a client's stream.
#[test]
fn a_spring_that_rings_out_is_not_taken_for_shaking() {
    for own in [0.0, OWN, 0.002] {
        for stiffness in [5.0, 10.0, 12.0] {
            let damping = 0.002 * stiffness;
            let text =
                effect("spring", &format!("anchor = 'here'\nstiffness = {stiffness}\ndamping = {damping}"));
            let mut run = Run::new(&toml(&text), None);
            run.own = own;
            let mut swings = 0;
            for tick in 0..6000 {
                let push = match tick {
                    1000..1020 => Some(Vec3::Y * 0.1),
                    1100..1120 => Some(Vec3::new(0.1, 0.0, 0.05)),
                    3000..3020 => Some(Vec3::new(-0.2, 0.1, 0.3)),
                    _ => None,
                };
                let state = run.step_with(push.map(|torque| crate::bench::stream(torque, 1)));
                assert_eq!(state.shaking, None, "{stiffness} N m/rad, own damping {own}, tick {tick}");
                swings += u32::from(state.omega.length() > 0.3);
            }
            assert!(swings > 500, "{stiffness} N m/rad: {swings} ticks are no ringing");
        }
    }
}

/// At any moment of its swing, the stiff spring is blamed, and not one that is stable and takes
/// energy in.
#[test]
fn the_stiff_spring_is_blamed_and_not_the_calm_one_beside_it() {
    let spring =
        |id: &str, rest: &str| format!("[[effect]]\nid = '{id}'\nkind = 'spring'\nanchor = 'here'\n{rest}\n");
    let text = spring("calm", "stiffness = 1\ndamping = 0.02") + &spring("stiff", "stiffness = 300");
    for hand in [None, Some(STILL), Some(DEFAULT)] {
        for k in 0..100 {
            let mut run = Run::new(&toml(&text), hand);
            for _ in 0..1000 + 7 * k {
                run.step();
            }
            // Taps about one axis or several.
            let a = f64::from(k);
            run.tap(Vec3::new(0.5 * (1.7 * a).sin(), 0.5, 0.5 * (0.9 * a).sin()));
            let mut states = (0..3000).map(|_| run.step());
            let found = states.find_map(|state| state.shaking).expect("it shakes");
            assert_eq!(found.slot, Some(1), "{hand:?}, {k}: {found:?}");
        }
    }
}
