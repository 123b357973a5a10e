//! A recorded run of the prototype, and the hash of what the control law computes on it. The same
//! source serves both widths of the core and all machines.
//!
//! The recording contains what the motor controllers measured in 10,000 ticks at 1 kHz, while a
//! hand turned the sphere (`recording.bin`; tests/core/same_bits of the main workspace makes it).
//! What clients sent is in [`commands`].

use super::core as hbot;
use super::hash::Hash;
use hbot::design::rig::{
    Joint, LeadTime, Methods, OdometryMethod, PassivityLimit, PathFit, RateEstimate, Rig, RigParts, Traction,
    Zero,
};
use hbot::inputs::{Command, Complaints, Inputs, JointReadings, Stamp};
use hbot::outputs::Outputs;
use hbot::render::effects::{
    Anchor, Damper, Effect, Friction, Kind, Pendulum, Spring, SpringLaw, Texture, Vibration, Wave,
};
use hbot::{CompiledScene, Controller, Device, MAX_JOINTS, Mat3, Quat, Real, Vec3, WheelSpec, rotation};

/// The hashes of [`hashes`], equal on every machine. They change when the core computes something
/// else.
pub(crate) const GOLDEN: [u64; 2] = if Real::EPSILON < 1.0e-10 {
    [0x3065_CAB4_2D03_2393, 0xD035_22CC_97B8_0A4B]
} else {
    [0x8607_D0C4_9E67_7A74, 0x9A5F_3A34_2602_9843]
};

/// Number of ticks in the recording.
pub(crate) const TICKS: usize = 10_000;
/// Number of ticks after which the scene changes.
pub(crate) const CHANGE: usize = 3000;
/// Number of joints of the prototype.
const JOINTS: usize = 4;
/// Size of one tick in the recording, bytes: for each joint the change of its encoder count and its
/// rate, both as i16 in little-endian order.
pub(crate) const RECORD: usize = 4 * JOINTS;
/// Unit of the rates in the recording, rad/s. It is a power of two, so that a rate has the same
/// value in f32 and f64.
pub(crate) const RATE_UNIT: Real = 1.0 / 64.0;

static RECORDING: &[u8] = include_bytes!("recording.bin");

/// What the motor controllers measure in one tick: for each joint the change of its encoder count,
/// and its rate in units of [`RATE_UNIT`].
pub(crate) type Measured = [(i16, i16); JOINTS];

/// Returns tick number `k` of the recording, 0 to [`TICKS`] - 1.
fn recorded(k: usize) -> Measured {
    let word = |at: usize| i16::from_le_bytes([RECORDING[at], RECORDING[at + 1]]);
    core::array::from_fn(|j| {
        let at = k * RECORD + 4 * j;
        (word(at), word(at + 2))
    })
}

/// The inputs of one tick after another.
pub(crate) struct Feed {
    counts: [i32; MAX_JOINTS],
}

impl Feed {
    pub(crate) const START: Self = Self { counts: [0; MAX_JOINTS] };

    /// Returns the inputs of tick `tick`, in which the motor controllers have measured `measured`.
    /// Some readings are lost, and some frames damaged.
    pub(crate) fn next(&mut self, tick: u64, measured: &Measured) -> Inputs {
        let mut rates = [0.0; MAX_JOINTS];
        for (j, (change, rate)) in measured.iter().enumerate() {
            self.counts[j] = self.counts[j].wrapping_add(i32::from(*change));
            rates[j] = Real::from(*rate) * RATE_UNIT;
        }
        let complaints = Complaints { overtemperature: tick == 7000, ..Complaints::default() };
        let reading = JointReadings {
            sequence: (tick as u32).wrapping_sub(1),
            counts: self.counts,
            rates,
            index_seen: 0,
            complaints,
        };
        let lost = tick % 97 == 13 || tick % 1001 < 3;
        let mut inputs = Inputs { feedback: (!lost).then_some(reading), ..Inputs::quiet(tick) };
        inputs.corrupt_frames = u16::from(lost);
        for command in commands(tick).into_iter().flatten() {
            // There is room: a tick has at most two commands.
            let _ = inputs.commands.push(command);
        }
        inputs
    }
}

/// Returns what clients send in tick `tick`.
fn commands(tick: u64) -> [Option<Command>; 2] {
    let stamp = Stamp { seq: Some(tick), tick: Some(tick - 1) };
    let about = |x: Real, y: Real, z: Real| rotation::exp(Vec3::new(x, y, z));
    let first = match tick {
        5 | 6200 | 7250 | 8300 => Some(Command::Enable),
        6000 => Some(Command::Disable),
        7200 | 8200 => Some(Command::Reset),
        8100 => Some(Command::Estop),
        2000 | 9000 => Some(Command::Align { q: about(0.1, -0.05, 0.02), weight: 0.5, tick: tick - 20 }),
        4000..4500 if tick.is_multiple_of(4) => Some(Command::Reference {
            slot: 0,
            epoch: 1,
            q: about(0.0, 0.0, (tick - 4000) as Real * 0.001),
            omega: Vec3::new(0.0, 0.0, 1.0),
            valid_ticks: 8,
            stamp,
        }),
        _ => None,
    };
    let stream = (1000..1500).contains(&tick) && tick.is_multiple_of(5);
    let torque = Vec3::new(0.2, -0.1, 0.05) * ((tick % 50) as Real * 0.02);
    [first, stream.then_some(Command::Stream { torque, valid_ticks: 10, stamp })]
}

/// Returns the prototype with usual methods, or with the stages that a rig can add.
pub(crate) fn rig(more: bool) -> Rig {
    let wheel = |side: Real| WheelSpec {
        axis: Vec3::new(side, 0.0, -1.0),
        cone: 0.1745,
        radius: 0.0155,
        steer_inertia: 2.7e-5,
        drive_inertia: 3.5e-6,
        ..WheelSpec::default()
    };
    let device = Device::new(0.102, 0.467, &[wheel(1.0), wheel(-1.0)]).expect("a legal device");
    let joint = |peak| Joint { zero: Zero::Assume, ..Joint::new(16384, peak) };
    let mut parts = RigParts::new(device).with_joints(joint(0.93), Joint { gear: 17.0, ..joint(0.14) });
    // The recorded hand does not yield to torques, and the rates are rounded.
    (parts.limits.slip, parts.limits.enable_max_angle) = (5.0, 3.0);
    if more {
        parts.joints[1].reversed = true;
        parts.limits.traction = Some(Traction { mu: 0.8, normal_force: 4.0 });
        parts.limits.slip = 50.0;
        parts.methods = Methods {
            odometry: OdometryMethod::Magnus4,
            path: PathFit::Cubic,
            rate: RateEstimate::Kalman { acceleration: 100.0 },
            passivity: Some(PassivityLimit::strict(&device, parts.timing.period_s())),
            ..Methods::BALANCED
        };
    }
    Rig::new(parts).expect("a legal rig")
}

/// Returns the two scenes of the run. The second one follows after [`CHANGE`] ticks.
pub(crate) fn scene(second: bool) -> CompiledScene {
    let diagonal = |x, y, z| Mat3::from_diagonal(Vec3::new(x, y, z));
    let spring = |law, stiffness| {
        Spring::new(
            law,
            stiffness,
            diagonal(0.01, 0.02, 0.01),
            rotation::exp(Vec3::X * 0.1),
            Anchor::Absolute,
        )
        .map(Kind::Spring)
        .expect("a legal spring")
    };
    let damper = Kind::Damper(Damper::new(diagonal(0.02, 0.01, 0.03)).expect("a legal damper"));
    let effect = |slot: u8, kind| Effect::new(slot, u32::from(slot) + 1, kind);
    let geodesic = effect(0, spring(SpringLaw::Geodesic, diagonal(1.0, 2.0, 1.5)));
    let scene = if second {
        let friction = Kind::Friction(Friction { torque: 0.05, stiffness: 4.0, damping: 0.005 });
        let vibration = Kind::Vibration(Vibration {
            axis: Vec3::Y,
            amplitude: 0.02,
            frequency: 35.0,
            wave: Wave::Sine,
            attack: 0.1,
            hold: 0.0,
            release: 0.0,
            repeat: 0.0,
        });
        let texture = Kind::Texture(Texture { at: Vec3::Z, wave_number: 40.0, depth: 0.02 });
        let pendulum = Kind::Pendulum(Pendulum {
            centre: Vec3::new(0.0, 0.02, 0.01),
            weight: Vec3::new(0.0, 0.0, -3.0),
        });
        let quaternion =
            Effect { fade_s: 0.1, ..effect(1, spring(SpringLaw::Quaternion, diagonal(0.5, 0.5, 0.8))) };
        let all = [
            geodesic,
            quaternion,
            effect(2, friction),
            effect(3, vibration),
            effect(4, texture),
            effect(5, pendulum),
        ];
        CompiledScene::new(2, &all)
    } else {
        CompiledScene::new(1, &[geodesic, effect(6, damper)])
    };
    scene.expect("a legal scene")
}

/// Runs the recording through the control law of one rig, and calls `each` with the outputs of each
/// tick.
pub(crate) fn follow(more: bool, mut each: impl FnMut(&Outputs)) {
    let mut controller = Controller::new(rig(more));
    let mut feed = Feed::START;
    for second in [false, true] {
        let scene = scene(second);
        let ticks = if second { CHANGE..TICKS } else { 0..CHANGE };
        for k in ticks {
            let inputs = feed.next(k as u64 + 1, &recorded(k));
            each(&controller.tick(&scene, &inputs));
        }
    }
}

/// Runs the control law with a lead and the guard against shaking, and calls `each` with the
/// outputs of each tick. The sphere turns to and fro, and a stiff spring drives it.
pub(crate) fn follow_led(mut each: impl FnMut(&Outputs)) {
    let lead = LeadTime { factor: 0.5, ..LeadTime::default() };
    let rig = rig(false).with(|rig| (rig.lead, rig.torque_lag) = (Some(lead), 1.0e-3)).expect("a legal rig");
    let mut controller = Controller::new(rig).with_shaking_guard(true);
    let stiff = Mat3::from_diagonal(Vec3::splat(8.0));
    let spring = Spring::new(SpringLaw::Geodesic, stiff, Mat3::ZERO, Quat::IDENTITY, Anchor::Here);
    let spring = Effect::new(0, 1, Kind::Spring(spring.expect("a legal spring")));
    let scene = CompiledScene::new(3, &[spring]).expect("a legal scene");
    let mut feed = Feed::START;
    for k in 0..1500 {
        let (back, step) = (k % 40 >= 20, k % 20);
        let measured = recorded(if back { 119 - step } else { 100 + step });
        let measured = if back { measured.map(|(change, rate)| (-change, -rate)) } else { measured };
        let mut inputs = feed.next(k as u64 + 1, &measured);
        let (q, sigma) = (rotation::exp(Vec3::X * 0.01), Vec3::new(0.01, 0.02, 0.03));
        if k == 900 {
            let _ = inputs.commands.push(Command::AlignBySigma { q, sigma, weight: 0.5, tick: 890 });
        }
        each(&controller.tick(&scene, &inputs));
    }
}

/// Returns the hash of the outputs of both rigs as it was at first, and that of all outputs, also
/// with a lead.
pub(crate) fn hashes() -> [u64; 2] {
    let [mut first, mut all] = [Hash::START; 2];
    for more in [false, true] {
        follow(more, |outputs| {
            first.outputs(outputs);
            all.all(outputs);
        });
    }
    follow_led(|outputs| all.all(outputs));
    [first.0, all.0]
}
