//! What is known of a rig's imperfections is fed forward: each stage by itself on a sphere whose
//! motion the test sets, and all of them on a simulated plant with friction.

use crate::prelude::*;
use hbot_core::design::rig::{Compensation, Friction, Harmonic, Imperfect};
use hbot_sim::phenomena::{CageFriction, Eccentric, Gear, JointFriction, Phenomena};
use hbot_sim::plant::{Dynamics, Method, PlantState};

const TRUE: JointFriction =
    JointFriction { coulomb: 2.0e-4, viscous: 1.0e-5, breakaway: 2.0e-4, stribeck_rate: 0.5 };

/// Returns [`rig`] with `known`, and with limits that do not interfere.
fn knowing(known: Compensation) -> Rig {
    altered(&rig(), |rig| {
        rig.compensation = Some(known);
        rig.limits.slip = 10.0;
        rig.limits.speed = 100.0;
    })
}

fn joints(alter: impl Fn(&mut Imperfect)) -> Compensation {
    let mut known = Compensation::default();
    known.joints.iter_mut().for_each(alter);
    known
}

fn rubbing(coulomb: f64, viscous: f64) -> Compensation {
    joints(|joint| joint.friction = Friction { coulomb, viscous })
}

fn turned(bench: &mut Bench, omega: Vec3, ticks: u32) -> Outputs {
    (0..ticks).map(|_| bench.turn(omega)).last().unwrap()
}

#[test]
fn friction_is_fed_forward_by_a_smooth_sign_of_each_rate() {
    let known = Compensation { part: 0.8, smoothing: 0.02, ..rubbing(2.0e-4, 3.0e-5) };
    for size in [1.0e-4, 1.0e-3, 5.0e-3, 0.05] {
        let mut bench = Bench::active(knowing(known), CompiledScene::empty());
        // It rises within 0.2 s.
        let early = turned(&mut bench, Vec3::new(0.6, -0.5, 0.3) * size, 20);
        for j in 0..4 {
            let most = 0.8 * (0.12 * 2.0e-4 + 3.0e-5 * early.state.rate[j].abs());
            assert!(early.state.joint_torque[j].abs() <= most, "joint {j}, {size}");
        }
        let out = turned(&mut bench, Vec3::new(0.6, -0.5, 0.3) * size, 200);
        for j in 0..4 {
            let rate = out.state.rate[j];
            let x = rate / 0.02;
            let want = 0.8 * (2.0e-4 * x.powi(3) / (1.0 + x * x).powf(1.5) + 3.0e-5 * rate);
            assert!((out.state.joint_torque[j] - want).abs() < 1e-15, "joint {j}, {size}");
            assert_eq!(out.drive.torque[j], out.state.joint_torque[j]);
        }
        assert_eq!(out.state.torque, Vec3::ZERO, "the hand is to feel nothing");
    }
    // At rest nothing is fed forward.
    let mut bench = Bench::active(knowing(known), CompiledScene::empty());
    assert_eq!(bench.step().drive.torque, [0.0; MAX_JOINTS]);
}

#[test]
fn friction_of_the_cage_is_fed_forward_along_the_motion_of_the_sphere() {
    let sphere = Friction { coulomb: 2.0e-3, viscous: 1.0e-3 };
    let known = Compensation { sphere, part: 0.9, smoothing: 0.02, ..Compensation::default() };
    let mut bench = Bench::active(knowing(known), CompiledScene::empty());
    let omega = Vec3::new(0.6, -0.5, 0.3);
    let out = turned(&mut bench, omega, 220);
    let posture = Posture::new(&bench.rig().device, &[out.state.angle[0], out.state.angle[2]]);
    let made = posture.torque_on_sphere(&out.state.joint_torque[..4]);
    let (omega, speed) = (out.state.omega, out.state.omega.length());
    let x = speed / 0.02;
    let want = 0.9 * (2.0e-3 * x.powi(3) / (1.0 + x * x).powf(1.5) + 1.0e-3 * speed);
    assert!((made - omega / speed * want).length() < 1e-15, "{made}");
}

/// It stays for half a second at rest, so that a sphere in slow motion does not stick and slip, and
/// ends at once if the sphere turns back.
#[test]
fn fed_friction_outlasts_a_short_rest_and_no_turn_back() {
    let known = Compensation { part: 0.8, ..rubbing(2.0e-4, 0.0) };
    let size = |out: &Outputs| out.state.joint_torque[..4].iter().map(|t| t.abs()).fold(0.0, f64::max);
    let mut bench = Bench::active(knowing(known), CompiledScene::empty());
    let omega = Vec3::new(0.6, -0.5, 0.3);
    let all = size(&turned(&mut bench, omega, 300));
    assert!((all - 1.6e-4).abs() < 1e-7, "{all}");
    let held = size(&turned(&mut bench, Vec3::ZERO, 250));
    assert!((held / all - 0.5).abs() < 0.03, "{held}");
    assert_eq!(size(&turned(&mut bench, Vec3::ZERO, 270)), 0.0);
    turned(&mut bench, omega, 300);
    let out = turned(&mut bench, -omega, 3);
    for j in 0..4 {
        assert!(out.state.joint_torque[j] * out.state.rate[j] >= 0.0, "joint {j} is not pushed on");
    }
    assert!(size(&out) < 0.05 * all);
}

/// A gear that loses a tenth of its torque gets it back, in the direction of its motion, whether
/// the torque of the scene moves the joint or brakes it.
#[test]
fn a_gears_loss_is_fed_forward_in_proportion_to_the_torque() {
    let known = Compensation { part: 0.8, ..joints(|joint| joint.gear_loss = 0.1) };
    let plain = altered(&knowing(known), |rig| rig.compensation = None);
    for omega in [Vec3::new(0.6, -0.5, 0.3), Vec3::new(-0.6, 0.5, -0.3)] {
        let run = |rig| {
            let scene = spring_scene(1, 2.0, Vec3::new(0.1, 0.05, -0.1));
            turned(&mut Bench::active(rig, scene), omega, 40)
        };
        let (without, with) = (run(plain), run(knowing(known)));
        for j in 0..4 {
            let (torque, rate) = (without.state.joint_torque[j], without.state.rate[j]);
            let want = torque + 0.08 * torque.abs() * rate.signum();
            // The smooth sign of rates above 0.3 rad/s is 1 to within 1e-3.
            assert!((with.state.joint_torque[j] - want).abs() < 2e-4 * torque.abs() + 1e-12, "joint {j}");
        }
    }
}

#[test]
fn the_weight_of_an_unbalanced_sphere_is_held_in_every_orientation() {
    let imbalance = Vec3::new(0.02, -0.01, 0.015);
    let known = Compensation { imbalance, ..Compensation::default() };
    let mut bench = Bench::active(knowing(known), CompiledScene::empty());
    for axis in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X] {
        let out = turned(&mut bench, axis, 700);
        let posture = Posture::new(&bench.rig().device, &[out.state.angle[0], out.state.angle[2]]);
        let made = posture.torque_on_sphere(&out.state.joint_torque[..4]);
        // The weight pulls down at the centre of mass.
        let pulled = (out.state.q * imbalance).cross(-Vec3::Z);
        assert!((made + pulled).length() < 1e-12, "{made} against {pulled}");
        assert_eq!(out.state.torque, Vec3::ZERO);
    }
}

#[test]
fn cogging_is_fed_forward_at_the_angle_at_which_the_torque_acts() {
    let steer = Harmonic { per_turn: 7, amplitude: 3.0e-3, phase: 0.4 };
    let drive = Harmonic { per_turn: 2, amplitude: 1.0e-3, phase: -1.0 };
    let mut known = Compensation::default();
    known.joints[0].cogging[1] = steer;
    known.joints[3].cogging[0] = drive;
    let mut bench = Bench::active(knowing(known), CompiledScene::empty());
    for _ in 0..50 {
        let out = turned(&mut bench, Vec3::new(0.2, 0.1, -0.15), 37);
        let at = |j: usize, gear: f64, harmonic: Harmonic| {
            let angle = gear * (out.state.angle[j] + out.state.rate[j] * 1.5 * DT);
            -harmonic.amplitude * (f64::from(harmonic.per_turn) * angle + harmonic.phase).sin()
        };
        let want = [at(0, 1.0, steer), 0.0, 0.0, at(3, 17.0, drive)];
        for j in 0..4 {
            assert!((out.state.joint_torque[j] - want[j]).abs() < 1e-12, "joint {j}");
        }
    }
    // A rotor that turns by more than a radian of the harmonic in a tick is not followed.
    let out = turned(&mut bench, Vec3::X * 12.0, 20);
    let fast = out.state.rate[3].abs() * 17.0 * 2.0 * DT;
    assert!(fast > 1.0 && out.state.joint_torque[3] == 0.0, "{fast}");
}

#[test]
fn a_weak_motor_gets_a_larger_command_within_its_limit() {
    let mut known = Compensation::default();
    (known.joints[0].torque_scale, known.joints[1].torque_scale) = (0.8, 1.25);
    let scene = spring_scene(1, 2.0, Vec3::new(0.1, 0.05, -0.1));
    let plain = Bench::active(altered(&knowing(known), |rig| rig.compensation = None), scene.clone()).step();
    let out = Bench::active(knowing(known), scene).step();
    assert_eq!(out.state.joint_torque, plain.state.joint_torque);
    assert_eq!(out.state.torque, plain.state.torque);
    let want = plain.drive.torque;
    assert_eq!(out.drive.torque[..3], [want[0] / 0.8, want[1] / 1.25, want[2]]);
    // With weak motors that saturate, the command is at its limit and the torque is what it makes.
    let weak = |known| {
        altered(&knowing(known), |rig| {
            rig.joints.iter_mut().for_each(|joint| (joint.peak, joint.continuous) = (0.01, 0.01));
        })
    };
    let out =
        Bench::active(weak(joints(|joint| joint.torque_scale = 0.8)), spring_scene(1, 9.0, Vec3::X * 0.4))
            .step();
    let most = out.drive.torque.iter().map(|t| t.abs()).fold(0.0, f64::max);
    assert!((most - 0.01).abs() < 1e-12, "{most}");
}

/// Joint torques, the torque on the sphere and the load of the contacts stay within their limits,
/// although the scene alone reaches them and much more is to be fed forward.
#[test]
fn no_limit_is_exceeded_by_what_is_fed_forward() {
    let mut rng = Rng(11);
    let mut loaded = 0;
    for _ in 0..200 {
        let mut known = rubbing(0.5 * rng.between(0.0, 1.0), 0.01 * rng.between(0.0, 1.0));
        known.imbalance = rng.vector(0.3);
        known.sphere = Friction { coulomb: 0.2 * rng.between(0.0, 1.0), viscous: 0.0 };
        known.joints.iter_mut().for_each(|joint| joint.torque_scale = 0.7 + 0.6 * rng.between(0.0, 1.0));
        let (torque, grip) = (0.1 + 0.8 * rng.between(0.0, 1.0), 2.0 + 8.0 * rng.between(0.0, 1.0));
        let rig = altered(&knowing(known), |rig| {
            rig.limits.torque = torque;
            rig.limits.traction = Some(Traction { mu: 1.0, normal_force: grip });
            for (joint, least, more) in [(0, 0.05, 0.5), (3, 0.02, 0.1)] {
                let peak = least + more * rng.between(0.0, 1.0);
                (rig.joints[joint].peak, rig.joints[joint].continuous) = (peak, peak);
            }
        });
        let mut bench = Bench::active(rig, spring_scene(1, 8.0, rng.vector(0.25)));
        let omega = rng.vector(2.0);
        for _ in 0..50 {
            let out = bench.turn(omega);
            for j in 0..4 {
                assert!(out.drive.torque[j].abs() <= rig.joints[j].peak * (1.0 + 1e-12), "joint {j}");
            }
            let posture = Posture::new(&rig.device, &[out.state.angle[0], out.state.angle[2]]);
            let made = posture.torque_on_sphere(&out.state.joint_torque[..4]).length();
            assert!(made <= torque * (1.0 + 1e-9), "{made} of {torque}");
            assert!(out.state.traction <= 1.0);
            loaded += usize::from(made > 0.999 * torque || out.state.traction > 0.999);
        }
    }
    assert!(loaded > 1000, "{loaded} ticks at a limit");
}

#[test]
fn nothing_is_fed_forward_while_the_motors_are_off() {
    let mut known = rubbing(2.0e-4, 1.0e-5);
    known.imbalance = Vec3::X * 0.02;
    let mut bench = Bench::active(knowing(known), CompiledScene::empty());
    let most = |out: &Outputs| out.drive.torque.iter().map(|t| t.abs()).fold(0.0, f64::max);
    assert!(most(&turned(&mut bench, Vec3::X, 5)) > 1e-4);
    let out = bench.command(Command::Estop);
    assert!(!out.drive.enable && most(&out) == 0.0);
    assert_eq!(most(&turned(&mut bench, Vec3::X, 5)), 0.0);
    bench.sphere.omega = Vec3::ZERO;
    bench.command(Command::Reset);
    bench.command(Command::Enable);
    let mut last = [0.0; MAX_JOINTS];
    for _ in 0..501 {
        let out = bench.step();
        for j in 0..4 {
            // The soft start takes half a second, so a tick adds about a five hundredth.
            let step = (out.drive.torque[j] - last[j]).abs();
            assert!(step < 2.0 * 0.02 / 500.0, "a step of {step} N m at joint {j}");
        }
        last = out.drive.torque;
    }
    assert!(last.iter().any(|t| t.abs() > 1e-4));
}

/// Without a word about imperfections the outputs have the same bits as ever, and a word that says
/// that there are none adds no stage.
#[test]
fn a_rig_without_imperfections_has_no_such_stage() {
    let run = |known: Option<Compensation>| {
        let rig = altered(&rig(), |rig| rig.compensation = known);
        let mut bench = Bench::active(rig, spring_scene(1, 2.0, Vec3::X * 0.1));
        (0..200).map(|_| format!("{:?}", bench.turn(Vec3::Y * 0.3))).collect::<Vec<_>>()
    };
    assert_eq!(run(None), run(Some(Compensation::default())));
}

/// A control loop around a plant with friction. Motor controllers answer each command with a
/// reading, and hold the torque for one tick.
struct Loop {
    controller: Controller,
    scene: CompiledScene,
    plant: Dynamics,
    motion: PlantState,
    held: [f64; MAX_JOINTS],
    tick: u64,
    rig: Rig,
    push: Vec3,
}

impl Loop {
    fn new(rig: Rig, scene: CompiledScene, phenomena: Phenomena) -> Self {
        let motion = PlantState::default();
        let mut run = Self {
            controller: Controller::new(rig),
            scene,
            plant: Dynamics::new(&rig.device, &phenomena, Method::Rk4, &motion).unwrap(),
            motion,
            held: [0.0; MAX_JOINTS],
            tick: 1,
            rig,
            push: Vec3::ZERO,
        };
        run.step(None);
        run.step(Some(Command::Enable));
        (0..600).for_each(|_| {
            run.step(None);
        });
        assert_eq!(run.step(None).state.mode, Mode::Active);
        run
    }

    fn kick(&mut self, omega: Vec3) {
        self.motion.omega = omega;
        self.plant.adopt(&self.motion);
    }

    fn step(&mut self, command: Option<Command>) -> Outputs {
        let (angles, rates) =
            (self.plant.encoder_angles(&self.motion), self.plant.encoder_rates(&self.motion));
        let reading = encoders(&self.rig, &angles, &rates, self.tick - 1);
        let start = self.tick as f64 * DT;
        for part in 0..4 {
            let time = start + f64::from(part) * DT / 4.0;
            self.plant.step(&mut self.motion, time, DT / 4.0, &self.held, self.push, None);
        }
        let mut inputs = Inputs { feedback: Some(reading), ..Inputs::quiet(self.tick) };
        command.into_iter().for_each(|command| inputs.commands.push(command).unwrap());
        let outputs = self.controller.tick(&self.scene, &inputs);
        self.held = outputs.drive.torque;
        self.tick += 1;
        outputs
    }
}

fn with_friction(joint: JointFriction, cage: f64) -> Phenomena {
    Phenomena {
        joint_friction: Some(joint),
        cage_friction: (cage > 0.0).then_some(CageFriction { torque: cage }),
        ..Phenomena::default()
    }
}

/// No hand: whatever was measured, up to twice the true friction and loss of the gears, and however
/// much of it is asked for, the sphere comes to rest, and no joint torque exceeds its limit.
#[test]
fn a_sphere_without_a_hand_comes_to_rest_even_if_twice_its_friction_was_measured() {
    let mut rng = Rng(5);
    for case in 0..12 {
        let times = [2.0, 1.6, 1.0, 0.5][case % 4];
        let cage = if case % 3 == 0 { 1.0e-3 } else { 0.0 };
        let loss = if case % 4 < 2 { 0.05 } else { 0.0 };
        let known = Compensation {
            part: 0.9,
            sphere: Friction { coulomb: cage * times, viscous: 0.0 },
            ..joints(|joint| {
                joint.friction = Friction { coulomb: TRUE.coulomb * times, viscous: TRUE.viscous * times };
                joint.gear_loss = loss * times;
            })
        };
        let scene = match case % 2 {
            0 => CompiledScene::empty(),
            _ => {
                // Damping that makes up for the delay of the loop, so the spring itself is stable.
                let stiffness = rng.between(0.5, 2.5);
                let soft = spring(stiffness, 0.004 * stiffness, Quat::IDENTITY, Anchor::Absolute);
                CompiledScene::new(1, &[effect(0, 1, soft)]).unwrap()
            }
        };
        let rig = knowing(known);
        let gear = (loss > 0.0).then_some(Gear { backlash: 0.0, efficiency: 1.0 - loss, ..Gear::default() });
        let mut run = Loop::new(rig, scene, Phenomena { gear, ..with_friction(TRUE, cage) });
        run.kick(rng.vector(3.0));
        let mut still = 0;
        let mut ticks = 0;
        let mut fastest: f64 = 0.0;
        while still < 500 {
            let out = run.step(None);
            for j in 0..4 {
                assert!(out.drive.torque[j].abs() <= rig.joints[j].peak);
            }
            assert_eq!(out.state.mode, Mode::Active);
            still = if run.motion.omega.length() < 1e-4 { still + 1 } else { 0 };
            fastest = fastest.max(run.motion.omega.length());
            ticks += 1;
            assert!(ticks < 120_000, "case {case}: still turns at {} rad/s", run.motion.omega.length());
        }
        assert!(fastest < 8.0, "case {case}: {fastest} rad/s");
    }
}

/// Largest difference between what friction takes of a load on a spring of 4 N m/rad while the load
/// grows and while it falls, N m. The load goes up and down twice within 8 s. It is compared where
/// the sphere turns at 0.15 rad/s: at the ends it sticks and slips.
fn hysteresis(known: Option<Compensation>) -> f64 {
    let kind = spring(4.0, 0.02, Quat::IDENTITY, Anchor::Absolute);
    let scene = CompiledScene::new(1, &[effect(0, 1, kind)]).unwrap();
    let rig = altered(&knowing(Compensation::default()), |rig| rig.compensation = known);
    let mut run = Loop::new(rig, scene, with_friction(TRUE, 2.0e-3));
    let load = |t: f64| 0.4 * (core::f64::consts::TAU * t / 4.0).sin();
    let (mut worst, mut held): (f64, f64) = (0.0, 0.0);
    let mut rising = std::collections::BTreeMap::new();
    for tick in 0..8000 {
        let t = f64::from(tick) * DT;
        run.push = Vec3::X * load(t);
        // The torque of the scene holds the load, except for what friction and inertia take. The
        // latter is equal at equal loads.
        let taken = load(t) + held;
        held = run.step(None).state.torque.x;
        let key = (load(t) * 100.0).round() as i64;
        if tick < 1000 || key.abs() > 10 {
            continue;
        }
        if load(t + DT) > load(t) {
            rising.insert(key, taken);
        } else if let Some(up) = rising.get(&key) {
            worst = worst.max((up - taken).abs());
        }
    }
    assert!(rising.len() > 18);
    worst
}

#[test]
fn friction_that_is_fed_forward_leaves_a_third_of_the_hysteresis_at_most() {
    let known = Compensation {
        sphere: Friction { coulomb: 2.0e-3, viscous: 0.0 },
        ..rubbing(TRUE.coulomb, TRUE.viscous)
    };
    let (plain, fed) = (hysteresis(None), hysteresis(Some(known)));
    assert!(plain > 6.0e-3, "{plain}");
    assert!(fed < plain / 3.0, "{fed} of {plain} N m");
}

/// A sphere whose centre of mass is off by half a millimetre swings like a pendulum, unless its
/// imbalance is known.
#[test]
fn a_sphere_of_known_imbalance_stays_where_it_is() {
    let offset = [5.0e-4, 0.0, 0.0];
    let phenomena = Phenomena { eccentric: Some(Eccentric { offset }), ..Phenomena::default() };
    let mass = rig().device.sphere_mass();
    let known =
        Compensation { imbalance: Vec3::from_array(offset) * (mass * 9.806_65), ..Compensation::default() };
    let moved = |known: Option<Compensation>| {
        let rig = altered(&knowing(Compensation::default()), |rig| rig.compensation = known);
        let mut run = Loop::new(rig, CompiledScene::empty(), phenomena);
        // Begins anew after the soft start, in which the weight was not held yet.
        run.motion = PlantState { omega: Vec3::ZERO, ..run.motion };
        run.plant.adopt(&run.motion);
        let from = run.motion.q;
        (0..1000).for_each(|_| {
            run.step(None);
        });
        rotation::angle_between(run.motion.q, from)
    };
    assert!(moved(None) > 0.2);
    // The odometry takes the sphere for centred: the held torque errs by the ratio of the offset to
    // the radius, 0.5 %, and by the orientation of the start.
    assert!(moved(Some(known)) < 0.02, "{}", moved(Some(known)));
}
