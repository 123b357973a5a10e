//! What a client that is slower than the loop can make stable, on the simulated rig in virtual
//! time: torques that it computes, a spring whose reference it moves, and local models. And what
//! happens when it stalls, dies or jumps.

use crate::prelude::*;
use hbot_config::{Override, RigConfig};
use hbot_core::MAX_JOINTS;
use hbot_core::inputs::{Commands, ModelCommand};
use hbot_core::outputs::Drive;
use hbot_core::render::model::{HalfSpace, LocalModel};
use hbot_sim::exchange::Exchange;
use hbot_sim::phenomena::{Hand, Phenomena};
use hbot_sim::plant::PlantState;
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use serde_json::json;

/// Damping of every contact, N m s/rad: that of the stiffness that `info` tells.
const DAMPING: f64 = 0.02;
/// Torque by which the sphere is pressed into the contact, N m. It turns the sphere about n1.
const PRESS: f64 = 0.08;
/// Ticks from a state to the arrival of what a client computes from it.
const LATE: u64 = 1;
/// Soft start, ticks.
const START: u64 = 700;

/// How a client renders a contact that begins where the sphere is turned by 0 about n1.
#[derive(Debug, Clone, Copy, PartialEq)]
enum By {
    Torque,
    Reference,
    Model,
}

/// The prototype in simulation with a client.
struct World {
    controller: Controller,
    scene: CompiledScene,
    exchange: Exchange,
    drive: Drive,
    feedback: Option<JointReadings>,
    tick: u64,
    state: Option<State>,
    period_ns: u64,
}

impl World {
    fn new(lead: bool, hand: Option<Hand>, scene: CompiledScene) -> Self {
        let key = |path, value| Override { path, value, from: "the test" };
        let keys = [
            key("loop.lead", json!(lead)),
            key("loop.rate_estimate", json!(if lead { "auto" } else { "controller" })),
            // The stages that act on a sphere that shakes would hide that it does.
            key("loop.passivity", json!(false)),
            key("loop.shaking_guard", json!(false)),
        ];
        let config = RigConfig::load(None, &keys).unwrap();
        let phenomena = Phenomena { hand, ..Phenomena::default() };
        let simulated = SimulatedConfig { phenomena, ..SimulatedConfig::new(&config.rig) };
        Self {
            controller: Controller::new(config.rig),
            scene,
            exchange: Exchange::new(SimulatedRig::new(&simulated).unwrap(), config.rig.device.joints()),
            drive: Drive { enable: false, torque: [0.0; MAX_JOINTS] },
            feedback: None,
            tick: 0,
            state: None,
            period_ns: config.rig.timing.period_ns,
        }
    }

    fn step(&mut self, add: impl FnOnce(&mut Commands)) -> State {
        let mut inputs = Inputs { feedback: self.feedback.take(), ..Inputs::quiet(self.tick) };
        if self.tick == 6 {
            inputs.commands.push(Command::Enable).unwrap();
        }
        add(&mut inputs.commands);
        let outputs = self.controller.tick(&self.scene, &inputs);
        self.drive = outputs.drive;
        self.feedback = self.exchange.tick(self.tick * self.period_ns, self.tick as u32, &self.drive);
        self.tick += 1;
        self.state = Some(outputs.state);
        outputs.state
    }

    fn tap(&mut self, omega: Vec3) {
        let rig = self.exchange.rig_mut();
        let state = PlantState { omega, ..*rig.state() };
        rig.set_state(state);
    }
}

fn depth(q: Quat) -> f64 {
    rotation::log(q).x
}

/// Returns the contact as a client sees it from `seen`.
fn wall(seen: &State, stiffness: f64) -> LocalModel {
    let mut model = LocalModel::new(Vec3::ZERO, Mat3::ZERO, Mat3::ZERO, Some(seen.q));
    let plane = HalfSpace { normal: Vec3::X, offset: -depth(seen.q), stiffness, damping: DAMPING };
    model.add_plane(plane).unwrap();
    model
}

fn send(commands: &mut Commands, by: By, seen: &State, stiffness: f64, every: u64) {
    let stamp = Stamp { seq: None, tick: Some(seen.tick) };
    // Three periods, as clients are told to choose.
    let valid_ticks = (3 * every).max(20) as u32;
    let inside = depth(seen.q).max(0.0);
    match by {
        By::Torque => {
            let push = if inside > 0.0 { stiffness * inside + DAMPING * seen.omega.x } else { 0.0 };
            let torque = Vec3::X * -push.max(0.0);
            commands.push(Command::Stream { torque, valid_ticks, stamp }).unwrap();
        }
        By::Reference => {
            // The place on the contact that is nearest to the sphere.
            let q = rotation::exp(Vec3::X * -inside) * seen.q;
            let (slot, epoch, omega) = (0, 1, Vec3::ZERO);
            commands.push(Command::Reference { slot, epoch, q, omega, valid_ticks, stamp }).unwrap();
        }
        By::Model => {
            let command = ModelCommand { valid_ticks, blend_ticks: None, stamp };
            commands.push_model(command, &wall(seen, stiffness)).unwrap();
        }
    }
}

fn scene(by: By, stiffness: f64) -> CompiledScene {
    let law = spring(stiffness, DAMPING, Quat::IDENTITY, Anchor::Here);
    let effects = [effect(0, 1, law)];
    CompiledScene::new(1, if by == By::Reference { &effects } else { &[] }).unwrap()
}

/// Returns true if a sphere that is pressed against the contact and tapped comes to rest there.
fn is_stable(lead: bool, hand: Option<Hand>, by: By, rate_hz: u64, stiffness: f64) -> bool {
    let every = 1000 / rate_hz;
    let mut world = World::new(lead, hand, scene(by, stiffness));
    let mut waiting: Option<(u64, State)> = None;
    let mut swings = [0.0_f64; 2];
    for k in 0..START + 4000 {
        if k == START / 2 {
            world.exchange.rig_mut().set_external(Vec3::X * PRESS);
        }
        if k == START {
            world.tap(Vec3::new(0.15, 0.0, 0.0));
        }
        let due = waiting.take_if(|(at, _)| *at <= world.tick);
        let state = world.step(|commands| {
            if let Some((_, seen)) = due {
                send(commands, by, &seen, stiffness, every);
            }
        });
        if k % every == 0 {
            waiting = Some((state.tick + LATE, state));
        }
        if !world.drive.enable && k > 20 {
            return false;
        }
        let part = if k < START { continue } else { (k - START) / 500 };
        let rate = world.exchange.rig().state().omega.length();
        match part {
            0 => swings[0] = swings[0].max(rate),
            7 => swings[1] = swings[1].max(rate),
            _ => {}
        }
    }
    // The swing decays: a free sphere has no other damping than that of the contact.
    swings[1] < 0.5 * swings[0]
}

/// Returns the largest stiffness of at most 80 N m/rad that is stable, N m/rad: sought in steps of
/// 2.4 times, and beyond the last stable one in steps of 25 %.
fn border(lead: bool, hand: Option<Hand>, by: By, rate_hz: u64) -> f64 {
    const LARGEST: i32 = 29;
    let stiffness = |step: i32| 0.1 * 1.25_f64.powi(step);
    let stable = |step: i32| step <= LARGEST && is_stable(lead, hand, by, rate_hz, stiffness(step));
    let coarse = (0..=LARGEST).step_by(4).take_while(|step| stable(*step)).last().unwrap_or(-1);
    let last = (coarse + 1..=LARGEST).take_while(|step| stable(*step)).last().unwrap_or(coarse);
    stiffness(last)
}

#[test]
fn a_model_keeps_a_contact_as_stiff_at_60_messages_a_second_as_at_1000() {
    let still = Hand { amplitude: 0.0, ..Hand::default() };
    for (lead, least) in [(false, 5.0), (true, 50.0)] {
        for hand in [None, Some(still)] {
            for rate_hz in [60, 200, 1000] {
                let [torque, reference, model] =
                    [By::Torque, By::Reference, By::Model].map(|by| border(lead, hand, by, rate_hz));
                println!(
                    "lead {lead}, hand {}, {rate_hz} Hz: torque {torque:.2}, reference {reference:.2}, model {model:.1} N m/rad",
                    hand.is_some()
                );
                assert!(model >= least, "lead {lead}, {rate_hz} Hz: {model} N m/rad");
                // The spring of a reference is computed in the loop too. It drags instead, because
                // its reference lags behind a sphere that turns freely.
                assert!(rate_hz == 1000 || model > 2.0 * torque, "{rate_hz} Hz: {torque} {model}");
            }
        }
    }
}

/// A client that holds a wall in the hand stalls for 100 ms, comes back, jumps for one message, and
/// dies.
#[test]
fn a_client_that_stalls_jumps_or_dies_neither_kicks_nor_gives_out_energy() {
    for (lead, stiffness) in [(false, 5.0), (true, 50.0)] {
        let still = Hand { amplitude: 0.0, ..Hand::default() };
        let mut world = World::new(lead, Some(still), CompiledScene::empty());
        let slew = world.controller.rig().limits.torque_rate * 1e-3;
        let mut waiting: Option<(u64, State)> = None;
        let (mut before, mut least, mut most, mut step) = (Vec3::ZERO, 0.0_f64, 0.0_f64, 0.0_f64);
        for k in 0..START + 1500_u64 {
            if k == START / 2 {
                world.exchange.rig_mut().set_external(Vec3::X * 0.02);
            }
            let (stalls, jumps) = ((900..1000).contains(&k), (1400..1416).contains(&k));
            let due = waiting.take_if(|(at, _)| *at <= world.tick).filter(|_| !stalls && k < 1900);
            let state = world.step(|commands| {
                if let Some((_, mut seen)) = due {
                    // It believes that the sphere is 1 mrad deeper.
                    if jumps {
                        seen.q = rotation::exp(Vec3::X * 1e-3) * seen.q;
                    }
                    let mut model = wall(&seen, stiffness);
                    model.pose = None;
                    let stamp = Stamp { seq: None, tick: Some(seen.tick) };
                    let command = ModelCommand { valid_ticks: 50, blend_ticks: None, stamp };
                    commands.push_model(command, &model).unwrap();
                }
                if k == 1900 {
                    commands.push(Command::ClientLost(OnClientLost::Ramp)).unwrap();
                }
            });
            if k % 16 == 0 {
                waiting = Some((state.tick + LATE, state));
            }
            if k >= START {
                let change = (state.torque - before).length();
                assert!(change <= slew + 1e-9, "lead {lead}, tick {k}: {change} N m");
                step = step.max(change);
                if k == START {
                    least = state.energy;
                }
                least = least.min(state.energy);
                most = most.max(state.energy - least);
            }
            before = state.torque;
        }
        println!("lead {lead}: {stiffness} N m/rad, {:.3} mJ given out, steps of {step:.4} N m", 1e3 * most);
        assert!(most < 1e-3, "lead {lead}: {most} J given out");
        assert!(before.length() < 1e-6, "the torque of the dead client: {before}");
    }
}
