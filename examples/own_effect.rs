//! Shows how to write an effect that no scene has: a ratchet. It lets the sphere turn forwards
//! about n3, and prevents it from turning back past the last tooth.
//!
//! ```text
//! cargo run --example own_effect
//! ```
//!
//! The kinds of effects in a scene are fixed, because each one is tested with everything that a
//! hand can do. A program that needs another haptic law computes its torque from the state of a
//! tick and streams it. The torque acts in the next tick, within all limits of the rig. Here the
//! law runs in one process with the controller and a simulated rig, in which a simulated hand turns
//! the sphere back and forth. The example `stream_torque` streams a torque over TCP.

use std::error::Error;

use hbot_config::RigConfig;
use hbot_core::design::rig::Rig;
use hbot_core::inputs::{Command, Inputs, Stamp};
use hbot_core::outputs::State;
use hbot_core::{CompiledScene, Controller, Vec3};
use hbot_sim::exchange::Exchange;
use hbot_sim::phenomena::Hand;
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};

/// Angle between two teeth, rad.
const TOOTH: f64 = 0.1;
/// Stiffness of the torque that pushes the sphere back to the last tooth, N m/rad.
const STIFFNESS: f64 = 8.0;
/// Damping of the torque that pushes the sphere back to the last tooth, N m s/rad.
const DAMPING: f64 = 0.02;
/// Number of ticks in a run. At 1 kHz they take 10 s.
const TICKS: u64 = 10_000;

/// State of a ratchet: a virtual mechanism that lets the sphere turn forwards about n3, but not
/// back past the last tooth.
#[derive(Default)]
struct Ratchet {
    /// Angle by which the sphere has turned about n3 since the start, rad.
    angle: f64,
    /// Angle of the last tooth that was passed, rad.
    held: f64,
}

impl Ratchet {
    /// Updates the ratchet with the sphere's motion in one tick of `dt` seconds. Returns the torque
    /// on the sphere in frame N, in N m.
    fn render(&mut self, state: &State, dt: f64) -> Vec3 {
        self.angle += state.omega.z * dt;
        self.held = self.held.max((self.angle / TOOTH).floor() * TOOTH);
        let depth = self.held - self.angle;
        if depth > 0.0 { Vec3::Z * (STIFFNESS * depth - DAMPING * state.omega.z) } else { Vec3::ZERO }
    }
}

/// Runs a simulated rig for [`TICKS`] ticks, with or without a ratchet. Returns the largest angle
/// that the sphere reached about n3, and the most that it turned back from its furthest point, in
/// rad.
fn run(rig: &Rig, mut ratchet: Option<Ratchet>) -> Result<[f64; 2], Box<dyn Error>> {
    let mut simulated = SimulatedRig::new(&SimulatedConfig::new(rig))?;
    simulated.set_hand(Some(Hand { stiffness: 1.0, ..Hand::default() }));
    let mut line = Exchange::new(simulated, rig.device.joints());
    let mut controller = Controller::new(*rig);
    let scene = CompiledScene::empty();
    let dt = rig.timing.period_s();

    let (mut heard, mut torque) = (None, Vec3::ZERO);
    let (mut angle, mut most, mut back) = (0.0_f64, 0.0_f64, 0.0_f64);
    for tick in 1..=TICKS {
        let mut inputs = Inputs { feedback: heard, ..Inputs::quiet(tick) };
        let command = if tick == 3 {
            Command::Enable
        } else {
            // The torque is valid for this tick and the next. If the program stopped sending, its
            // torque would end.
            let stamp = Stamp { seq: None, tick: Some(tick - 1) };
            Command::Stream { torque, valid_ticks: 2, stamp }
        };
        inputs.commands.push(command).map_err(|_| "no room for a command")?;
        let outputs = controller.tick(&scene, &inputs);
        heard = line.tick(tick * rig.timing.period_ns, tick as u32, &outputs.drive);

        let state = &outputs.state;
        if let Some(cause) = state.cause {
            return Err(format!("a fault in tick {tick}: {cause:?}").into());
        }
        torque = ratchet.as_mut().map_or(Vec3::ZERO, |ratchet| ratchet.render(state, dt));
        angle += state.omega.z * dt;
        most = most.max(angle);
        back = back.max(most - angle);
    }
    Ok([most, back])
}

fn main() -> Result<(), Box<dyn Error>> {
    let rig = RigConfig::prototype().rig;
    let [free, free_back] = run(&rig, None)?;
    let [most, back] = run(&rig, Some(Ratchet::default()))?;
    println!("without: the hand turns the sphere by {free:.3} rad and brings it back by {free_back:.3} rad");
    println!("with it: by {most:.3} rad, and back by {back:.3} rad; a tooth is {TOOTH} rad");
    // With the ratchet, the sphere can turn back by one tooth, and by the angle to which the
    // simulated hand can push the spring of the tooth.
    if back < TOOTH + 0.6 / STIFFNESS && free_back > 2.0 * back {
        Ok(())
    } else {
        Err("the ratchet does not hold".into())
    }
}
