//! Equal inputs give equal bits, over a hundred thousand ticks of everything that can happen, in
//! debug and in release.

use crate::bench::assert_finite;
use crate::prelude::*;
use crate::same_bits::double::hash::Hash;
use hbot_core::design::rig::{AllocationMethod, Methods, OdometryMethod, PathFit};

const TICKS: u64 = 100_000;

/// The hash of all outputs, valid for every machine and every profile. It changes when the core
/// computes something else; the test then prints the new hash. Two builds with different hashes do
/// not compute the same outputs.
const GOLDEN: u64 = 0x0DF1_BB6D_F246_5C09;

/// The hash of all outputs with the optional stages of a rig.
const GOLDEN_STAGES: u64 = 0x4DA7_CB0D_EED3_6679;

/// The hash of all outputs of scenes that never change and do not fade, within the torque limit and
/// beyond it. It is older than the present law of changes of scene, and that law must not alter it.
const GOLDEN_UNCHANGED: u64 = 0x283D_288A_B550_0620;

/// A source of random inputs: joints that turn at random, and a server that sends random commands.
struct Weather {
    rng: Rng,
    counts: [i32; MAX_JOINTS],
    rates: [f64; MAX_JOINTS],
    tick: u64,
    scene: usize,
}

impl Weather {
    fn next(&mut self) -> (usize, Inputs) {
        let Self { rng, counts, rates, tick, scene } = self;
        *tick += if rng.once_in(500) { 1 + rng.below(5) } else { 1 };
        if rng.once_in(700) {
            *scene = rng.below(4) as usize;
        }
        for j in 0..MAX_JOINTS {
            // The rates are a random walk, with a decay that keeps them small.
            rates[j] = 0.98 * rates[j] + rng.between(-0.3, 0.3);
            counts[j] = counts[j].wrapping_add((rates[j] * if j % 2 == 0 { 2.6 } else { 44.3 }) as i32);
        }
        let mut inputs = Inputs::quiet(*tick);
        if !rng.once_in(50) {
            inputs.feedback = Some(JointReadings {
                sequence: (*tick as u32).wrapping_sub(1 + rng.once_in(30) as u32),
                counts: *counts,
                rates: *rates,
                index_seen: 0,
                complaints: Complaints { overtemperature: rng.once_in(20_000), ..Complaints::default() },
            });
        } else if rng.once_in(2) {
            inputs.corrupt_frames = rng.below(3) as u16;
        }
        inputs.lateness_ns = if rng.once_in(20_000) { 30_000_000 } else { rng.below(300_000) };
        while rng.once_in(12) {
            let _ = inputs.commands.push(Self::command(rng, *tick));
        }
        (*scene, inputs)
    }

    fn command(rng: &mut Rng, tick: u64) -> Command {
        let stamp = Stamp { seq: Some(rng.below(1000)), tick: Some(tick.saturating_sub(rng.below(60))) };
        match rng.below(40) {
            0..12 => Command::Enable,
            12..16 => Command::Reset,
            16 => Command::Disable,
            17 if rng.once_in(10) => Command::Estop,
            18 if rng.once_in(10) => Command::ClientLost(OnClientLost::Fault),
            19 => Command::ClientLost(OnClientLost::Ramp),
            20..28 => Command::Stream { torque: rng.vector(1.5), valid_ticks: rng.below(80) as u32, stamp },
            28..34 => {
                let q = rotation::exp(rng.vector(1.5));
                let (omega, valid_ticks) = (rng.vector(1.0), rng.below(50) as u32);
                let slot = rng.below(3) as u8;
                Command::Reference { slot, epoch: u32::from(slot) + 1, q, omega, valid_ticks, stamp }
            }
            _ => Command::Align {
                q: rotation::exp(rng.vector(0.8)),
                weight: rng.between(0.0, 1.0),
                tick: tick.saturating_sub(rng.below(1200)),
            },
        }
    }
}

fn scenes() -> [CompiledScene; 4] {
    let uneven = |x, y, z| {
        let m = Mat3::from_diagonal(Vec3::new(x, y, z));
        let r = Mat3::from_quat(rotation::exp(Vec3::new(0.3, 0.5, -0.2)));
        let m = r * m * r.transpose();
        (m + m.transpose()) * 0.5
    };
    let law = |law, anchor| {
        let reference = rotation::exp(Vec3::new(0.1, 0.2, 0.3));
        Kind::Spring(
            Spring::new(law, uneven(1.0, 4.0, 9.0), uneven(0.01, 0.02, 0.03), reference, anchor).unwrap(),
        )
    };
    let here = effect(0, 1, spring(3.0, 0.02, Quat::IDENTITY, Anchor::Here));
    let uneven_here = Effect { fade_s: 0.1, ..effect(1, 2, law(SpringLaw::Geodesic, Anchor::Here)) };
    let absolute = Effect { gain: 0.5, ..effect(2, 3, law(SpringLaw::Quaternion, Anchor::Absolute)) };
    let damper = effect(3, 4, Kind::Damper(Damper::new(uneven(0.02, 0.01, 0.03)).unwrap()));
    let scene = |revision, effects: &[Effect]| CompiledScene::new(revision, effects).unwrap();
    [
        scene(1, &[here, damper]),
        scene(2, &[uneven_here, here]),
        scene(3, &[absolute, damper]),
        scene(4, &[uneven_here, absolute, damper, here]),
    ]
}

fn rigs() -> [Rig; 3] {
    let plain = altered(&rig(), |rig| {
        rig.limits.speed = 60.0;
        rig.limits.slip = 0.3;
        rig.limits.enable_max_angle = 1.5;
        rig.joints[2].reversed = true;
    });
    let weak = altered(&plain, |rig| {
        for joint in &mut rig.joints {
            joint.peak *= 0.2;
            joint.continuous = joint.peak;
        }
        (rig.methods.odometry, rig.methods.rate) = (OdometryMethod::Midpoint, RateEstimate::Difference);
    });
    let slippery = altered(&plain, |rig| {
        rig.limits.traction = Some(Traction { mu: 0.8, normal_force: 10.0 });
        rig.methods.odometry = OdometryMethod::Euler;
    });
    [plain, weak, slippery]
}

/// Runs a controller with the random inputs of `seed`. Returns the inputs, and the number of ticks
/// in each mode.
fn run(rig: Rig, seed: u64, ticks: u64, hash: &mut Hash) -> (Vec<(usize, Inputs)>, [u64; 6]) {
    let scenes = scenes();
    let mut weather =
        Weather { rng: Rng(seed), counts: [0; MAX_JOINTS], rates: [0.0; MAX_JOINTS], tick: 0, scene: 0 };
    let mut controller = Controller::new(rig);
    let mut seen = [0; 6];
    let inputs = (0..ticks)
        .map(|_| {
            let (scene, inputs) = weather.next();
            let outputs = controller.tick(&scenes[scene], &inputs);
            assert_finite(&outputs);
            hash.outputs(&outputs);
            seen[outputs.state.mode as usize] += 1;
            (scene, inputs)
        })
        .collect();
    (inputs, seen)
}

#[test]
fn a_hundred_thousand_ticks_give_the_same_bits_on_every_machine() {
    let mut hash = Hash::START;
    let mut seen = [0; 6];
    for (seed, rig) in rigs().into_iter().enumerate() {
        let (_, modes) = run(rig, seed as u64, TICKS.div_ceil(3), &mut hash);
        (0..6).for_each(|k| seen[k] += modes[k]);
    }
    // The random inputs are varied enough for a meaningful test.
    for mode in [Mode::Idle, Mode::Enabling, Mode::Active, Mode::Fault, Mode::Estop] {
        assert!(seen[mode as usize] > 1000, "{mode:?} in {} ticks only: {seen:?}", seen[mode as usize]);
    }
    assert_eq!(hash.0, GOLDEN, "the outputs hash to 0x{:016X}", hash.0);
}

/// Returns rigs with the optional stages, in combination.
fn rigs_with_more_stages() -> [Rig; 3] {
    let [plain, weak, slippery] = rigs();
    let with = |rig: Rig, rate, path, damping| {
        let passivity = Some(PassivityLimit { damping, ..PassivityLimit::strict(&rig.device, 1e-3) });
        altered(&rig, |rig| {
            rig.methods =
                Methods { odometry: OdometryMethod::Magnus4, path, rate, passivity, ..Methods::BALANCED };
            // Counts that walk at random have large rates.
            rig.limits.speed = 500.0;
            rig.limits.slip = 50.0;
        })
    };
    let clipped = with(weak, RateEstimate::Kalman { acceleration: 100.0 }, PathFit::Cubic, 0.5);
    let clipped = altered(&clipped, |rig| rig.methods.allocation = AllocationMethod::Clipped);
    let window = RateEstimate::AdaptiveWindow { tolerance_counts: 2, longest_ticks: 40 };
    [
        clipped,
        with(plain, window, PathFit::Quadratic, 0.1),
        with(slippery, RateEstimate::LowPass { cutoff_hz: 40.0 }, PathFit::Cubic, 1.0),
    ]
}

#[test]
fn the_stages_that_are_chosen_give_the_same_bits_too() {
    let mut hash = Hash::START;
    let mut seen = [0; 6];
    for (seed, rig) in rigs_with_more_stages().into_iter().enumerate() {
        let (_, modes) = run(rig, 10 + seed as u64, TICKS / 5, &mut hash);
        (0..6).for_each(|k| seen[k] += modes[k]);
    }
    assert!(seen[Mode::Active as usize] > 1000, "{seen:?}");
    assert_eq!(hash.0, GOLDEN_STAGES, "the outputs hash to 0x{:016X}", hash.0);
}

#[test]
fn a_recording_of_inputs_replays_to_the_same_bits() {
    let (scenes, rig) = (scenes(), rigs()[0]);
    let mut hash = Hash(1);
    let (recording, _) = run(rig, 77, 20_000, &mut hash);
    let mut replayed = Hash(1);
    let mut controller = Controller::new(rig);
    for (scene, inputs) in &recording {
        replayed.outputs(&controller.tick(&scenes[*scene], inputs));
    }
    assert_eq!(replayed.0, hash.0);

    // A change of one bit of one input changes the hash.
    let mut altered = Hash(1);
    let mut controller = Controller::new(rig);
    for (k, (scene, inputs)) in recording.iter().enumerate() {
        let mut inputs = *inputs;
        if k == 10_000 {
            inputs.feedback.iter_mut().for_each(|f| f.rates[0] = f64::from_bits(f.rates[0].to_bits() ^ 1));
        }
        altered.outputs(&controller.tick(&scenes[*scene], &inputs));
    }
    assert_ne!(altered.0, hash.0);
}

/// Checks that the law of fades and blends leaves the torque alone if nothing fades. The sphere
/// rests until the soft start has ended, so that no blend has anything to fade.
#[test]
fn a_scene_that_does_not_change_gives_the_bits_that_it_always_gave() {
    let mut hash = Hash::START;
    // Without a torque at rest, there is no step at enable that could fade.
    let here = |k, d| effect(0, 1, spring(k, d, Quat::IDENTITY, Anchor::Here));
    let damper = |d| effect(1, 2, Kind::Damper(Damper::new(Mat3::from_diagonal(d)).unwrap()));
    let damped = Effect { gain: 0.3, ..damper(Vec3::new(0.05, 0.1, 0.02)) };
    let soft = CompiledScene::new(1, &[here(0.4, 0.01), damped]).unwrap();
    let strong = CompiledScene::new(1, &[here(9.0, 0.05), damper(Vec3::splat(0.2))]).unwrap();
    let mut beyond = 0;
    for (seed, (rig, scene)) in
        rigs().into_iter().chain(rigs_with_more_stages()).zip([soft, strong].iter().cycle()).enumerate()
    {
        let rig = altered(&rig, |rig| {
            (rig.limits.speed, rig.limits.slip, rig.limits.enable_max_angle) = (500.0, 50.0, 3.1);
        });
        let mut rng = Rng(seed as u64);
        let (mut counts, mut rates) = ([0_i32; MAX_JOINTS], [0.0; MAX_JOINTS]);
        let mut controller = Controller::new(rig);
        let mut seen = [0; 6];
        for tick in 0..TICKS / 6 {
            let mut inputs = Inputs::quiet(tick);
            if tick > 600 {
                for j in 0..MAX_JOINTS {
                    rates[j] = 0.98 * rates[j] + rng.between(-0.3, 0.3);
                    counts[j] =
                        counts[j].wrapping_add((rates[j] * if j % 2 == 0 { 2.6 } else { 44.3 }) as i32);
                }
                if rng.once_in(30) {
                    let (torque, valid_ticks) = (rng.vector(1.5), rng.below(80) as u32);
                    let _ = inputs.commands.push(Command::Stream {
                        torque,
                        valid_ticks,
                        stamp: Stamp::default(),
                    });
                }
            }
            if tick == 5 {
                let _ = inputs.commands.push(Command::Enable);
            }
            let sequence = (tick as u32).wrapping_sub(1);
            inputs.feedback = (!rng.once_in(50)).then_some(JointReadings::new(sequence, counts, rates));
            let outputs = controller.tick(scene, &inputs);
            hash.outputs(&outputs);
            seen[outputs.state.mode as usize] += 1;
            beyond += u32::from(outputs.state.scale < 1.0);
        }
        assert!(seen[Mode::Active as usize] > TICKS / 6 - 600, "{seen:?}");
    }
    assert!((10_000..90_000).contains(&beyond), "{beyond} ticks at the limit");
    assert_eq!(hash.0, GOLDEN_UNCHANGED, "the outputs hash to 0x{:016X}", hash.0);
}
