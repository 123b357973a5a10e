//! The loop of an embedded program: the prototype with a spring wound up by a quarter of a radian,
//! for 600 ticks.
//!
//! [`run`] is the loop. [`rig`] and [`scene`] state the rig and how it feels. [`Controllers`]
//! stands for the other end of the line: motor controllers whose sphere does not move. A real
//! program has a serial port there.

use hbot_core::design::device::{Device, MAX_JOINTS, WheelSpec};
use hbot_core::render::effects::{Anchor, Effect, Kind, Spring, SpringLaw};
use hbot_core::inputs::{Command, Inputs, JointReadings};
use hbot_core::safety::mode::Mode;
use hbot_core::design::rig::{Joint, Methods, PassivityLimit, RateEstimate, Rig, RigParts, Zero};
use hbot_core::{CompiledScene, Controller, Mat3, Vec3, rotation};
use hbot_link::{
    ControllerFlags, Decoder, Feedback, FromController, JointFlags, JointReading, MAX_COMMAND_FRAME,
    MAX_FEEDBACK_FRAME, ToController, encode,
};

const JOINTS: usize = 4;
/// Stiffness of the spring, N m/rad.
const STIFFNESS: f64 = 2.0;
/// Angle by which the spring is wound up about n1, rad.
const WOUND: f64 = 0.25;

/// Runs the loop. Fails with the number of the first wrong result.
pub fn run() -> Result<(), i32> {
    let scene = scene().ok_or(1)?;
    let mut controller = Controller::new(rig().ok_or(2)?);
    let mut controllers = Controllers::default();
    let mut heard = None;
    for tick in 1..=600 {
        let mut inputs = Inputs { feedback: heard, ..Inputs::quiet(tick) };
        if tick == 3 {
            inputs.commands.push(Command::Enable).map_err(|_| 3)?;
        }
        let outputs = controller.tick(&scene, &inputs);

        // Sends the command on the line. Its sequence number is the tick, and the answer repeats
        // the number.
        let mut torque = heapless::Vec::new();
        for j in 0..JOINTS {
            torque.push(outputs.drive.torque[j] as f32).map_err(|_| 4)?;
        }
        let enable = outputs.drive.enable;
        let command = hbot_link::Command { sequence: tick as u32, enable, watchdog_ms: 20, torque };
        heard = Some(controllers.answer(&command)?);

        // Checks the result of the tick.
        let state = &outputs.state;
        match tick {
            1 if state.mode != Mode::Unreferenced => return Err(10),
            2 if state.mode != Mode::Idle || state.torque != Vec3::ZERO => return Err(11),
            3 if state.mode != Mode::Enabling || !enable => return Err(12),
            // The soft start is half way: a gain of 250 ticks out of 500, to the rounding of their
            // sum.
            252 if !near(state.torque, 0.5) => return Err(13),
            600 if state.mode != Mode::Active || !near(state.torque, 1.0) => return Err(14),
            _ => {}
        }
        if tick > 2 && controllers.torque.iter().zip(&outputs.drive.torque).any(|(a, b)| *a != *b as f32) {
            return Err(15);
        }
    }
    Ok(())
}

/// Returns whether `torque` is the given part of the spring's whole torque, to rounding.
fn near(torque: Vec3, part: f64) -> bool {
    (torque - Vec3::X * (part * STIFFNESS * WOUND)).length() < 1e-12
}

/// The motor controllers' end of the line.
#[derive(Default)]
struct Controllers {
    commands: Decoder<ToController>,
    feedback: Decoder<FromController>,
    torque: [f32; JOINTS],
}

impl Controllers {
    /// Sends the command over the line and returns the reading that comes back.
    fn answer(&mut self, command: &hbot_link::Command) -> Result<JointReadings, i32> {
        let mut line = [0; MAX_COMMAND_FRAME];
        let length = encode(&ToController::Command(command.clone()), &mut line).map_err(|_| 20)?;
        let mut arrived = None;
        self.commands.feed(&line[..length], |message| arrived = message.ok());
        let Some(ToController::Command(arrived)) = arrived else { return Err(21) };
        if arrived != *command {
            return Err(22);
        }
        self.torque.copy_from_slice(&arrived.torque);

        let mut feedback =
            Feedback { sequence: arrived.sequence, flags: ControllerFlags::empty(), ..Feedback::default() };
        for j in 0..JOINTS {
            let reading =
                JointReading { count: -7 * j as i32, flags: JointFlags::empty(), ..JointReading::default() };
            feedback.joints.push(reading).map_err(|_| 23)?;
        }
        let mut line = [0; MAX_FEEDBACK_FRAME];
        let length = encode(&FromController::Feedback(feedback.clone()), &mut line).map_err(|_| 24)?;
        // A damaged frame comes first. It must be refused and must not spoil the next one.
        let mut damaged = line;
        damaged[2] ^= 0x40;
        let mut refused = 0;
        self.feedback.feed(&damaged[..length], |message| refused += i32::from(message.is_err()));
        let mut back = None;
        self.feedback.feed(&line[..length], |message| back = message.ok());
        let Some(FromController::Feedback(back)) = back else { return Err(25) };
        if refused == 0 || back != feedback {
            return Err(26);
        }
        let mut heard = JointReadings::new(back.sequence, [0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        for (j, reading) in back.joints.iter().enumerate() {
            (heard.counts[j], heard.rates[j]) = (reading.count, f64::from(reading.rate));
        }
        Ok(heard)
    }
}

fn scene() -> Option<CompiledScene> {
    let stiffness = Mat3::from_diagonal(Vec3::splat(STIFFNESS));
    let reference = rotation::exp(Vec3::X * WOUND);
    let spring = Spring::new(SpringLaw::Geodesic, stiffness, Mat3::ZERO, reference, Anchor::Absolute)?;
    let kind = Kind::Spring(spring);
    let effect = Effect::new(0, 1, kind);
    CompiledScene::new(1, &[effect]).ok()
}

fn rig() -> Option<Rig> {
    let wheel = |side| WheelSpec {
        axis: Vec3::new(side, 0.0, -1.0),
        cone: 0.1745,
        radius: 0.0155,
        ..WheelSpec::default()
    };
    let device = Device::new(0.102, 0.467, &[wheel(1.0), wheel(-1.0)]).ok()?;
    let joint = Joint { zero: Zero::Assume, ..Joint::new(16384, 2.0) };
    let mut parts = RigParts::new(device).with_joints(joint, joint);
    parts.limits.torque = 2.0;
    // The stages that need the most memory.
    parts.methods = Methods {
        rate: RateEstimate::AdaptiveWindow { tolerance_counts: 1, longest_ticks: 64 },
        passivity: Some(PassivityLimit::strict(&device, parts.timing.period_s())),
        ..Methods::EXACT
    };
    Rig::new(parts).ok()
}
