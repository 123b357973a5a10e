//! Measures the time of a whole tick, of each of its stages, and of each optional limit, with 2 and
//! 4 wheels, in f64 and f32.
//!
//! `cargo bench --bench tick`
//!
//! `cargo bench --bench tick -- --peer REPETITIONS TICKS [lead] [passivity]` measures only the
//! balanced tick in f64 with 2 wheels, in the same way as benches/peer/tick.c, and prints the same
//! line. The words switch on what a rig file has by default.

use std::hint::black_box;
use std::time::Instant;

use criterion::{BenchmarkId, Criterion, criterion_group};

/// Defines the benchmarks for one floating-point width of the core (f64 or f32).
macro_rules! width {
    ($name:ident, $core:ident, $real:ty) => {
        mod $name {
            use $core::allocation::{JointLimits, allocate};
            use $core::design::kinematics::Posture;
            use $core::design::rig::{
                EnergyLimit, Joint, LeadTime, Methods, OdometryMethod, PassivityLimit, PathFit, Rig,
                RigParts, Traction, Zero,
            };
            use $core::inputs::{Command, Inputs, JointReadings};
            use $core::motion::path::Trail;
            use $core::outputs::Outputs;
            use $core::render::effects::{Anchor, Damper, Effect, Kind, Spring, SpringLaw};
            use $core::render::impedance::{geodesic_law, quaternion_law};
            use $core::{
                CompiledScene, Controller, Device, MAX_JOINTS, Mat3, Quat, Vec3, WheelSpec, motion::odometry,
                rotation,
            };

            use super::*;

            pub(super) fn rig(wheels: usize, methods: Methods) -> Rig {
                let spec = |axis: [$real; 3], cone: $real| WheelSpec {
                    axis: Vec3::from_array(axis),
                    cone,
                    toe: 0.0,
                    radius: 0.0155,
                    steer_inertia: 2.7e-5,
                    drive_inertia: 3.5e-6,
                    axial_inertia: 0.0,
                };
                let all = [
                    spec([1.0, 0.0, -1.0], 0.1745),
                    spec([-1.0, 0.0, -1.0], 0.1745),
                    spec([0.0, 1.0, -1.0], 0.1745),
                    spec([0.0, -1.0, -1.0], 0.1745),
                ];
                let joint =
                    |peak| Joint { zero: Zero::Assume, continuous: 0.1 * peak, ..Joint::new(16384, peak) };
                let device = Device::new(0.102, 0.467, &all[..wheels]).expect("a legal device");
                let drive = Joint { gear: 17.0, ..joint(0.14) };
                let mut parts = RigParts::new(device).with_joints(joint(0.93), drive);
                parts.limits.traction = Some(Traction { mu: 0.8, normal_force: 10.0 });
                Rig::new(RigParts { methods, ..parts }).expect("a legal rig")
            }

            fn scene() -> CompiledScene {
                let effect = |slot, kind| Effect::new(slot, 1, kind);
                let spring = Spring::new(
                    SpringLaw::Geodesic,
                    Mat3::from_diagonal(Vec3::splat(4.0)),
                    Mat3::ZERO,
                    Quat::IDENTITY,
                    Anchor::Absolute,
                );
                let damper = Damper::new(Mat3::from_diagonal(Vec3::splat(0.05)));
                let kinds = [Kind::Spring(spring.expect("legal")), Kind::Damper(damper.expect("legal"))];
                CompiledScene::new(1, &[effect(0, kinds[0]), effect(1, kinds[1])]).expect("a legal scene")
            }

            /// Returns joint feedback that swings sinusoidally over the ticks, so that every tick
            /// differs.
            fn feedback(rig: &Rig, tick: u64) -> JointReadings {
                let n = rig.device.joints();
                let phase = tick as $real * 0.006;
                let mut feedback = JointReadings::new(tick as u32, [0; MAX_JOINTS], [0.0; MAX_JOINTS]);
                for i in 0..n {
                    let swing = 0.3 + 0.1 * i as $real;
                    feedback.counts[i] = (swing * (phase + i as $real).sin() * 2000.0) as i32;
                    // The joint rate that agrees with these encoder counts at 1 kHz.
                    feedback.rates[i] =
                        swing * (phase + i as $real).cos() * 2000.0 * 6.0 * rig.joints[i].radians_per_count();
                }
                feedback
            }

            /// Number of ticks after which the joint feedback repeats, as in benches/peer/tick.c.
            const CYCLE: u64 = 1024;

            /// Returns a function that runs one tick of a controller in the mode `active`, whose
            /// soft start is already over.
            pub(super) fn active(rig: Rig) -> impl FnMut() -> Outputs {
                // The joint feedback above is not that of a turning sphere, so the wheels seem to
                // slip. The slip limit is so wide that this is no fault.
                let rig = rig.with(|rig| rig.limits.slip = 100.0).expect("a legal rig");
                let mut controller = Controller::new(rig);
                let scene = scene();
                let readings: Vec<_> = (0..CYCLE).map(|tick| feedback(&rig, tick)).collect();
                let mut tick = 0_u64;
                let mut run = move || {
                    let mut inputs = Inputs::quiet(tick);
                    // Copied once, as in benches/peer/tick.c. The expression
                    // `JointReadings { sequence, ..*reading }` would be put together first and then
                    // copied, which makes the processor wait.
                    let reading = inputs.feedback.insert(readings[(tick % CYCLE) as usize]);
                    reading.sequence = tick as u32;
                    if tick == 1 {
                        let _ = inputs.commands.push(Command::Enable);
                    }
                    tick += 1;
                    controller.tick(&scene, &inputs)
                };
                for _ in 0..1000 {
                    run();
                }
                let last = run();
                assert_eq!(last.state.mode, $core::safety::mode::Mode::Active);
                assert!(last.state.torque != Vec3::ZERO);
                run
            }

            pub(super) fn whole(c: &mut Criterion, label: &str) {
                let mut group = c.benchmark_group(format!("tick/{label}"));
                for wheels in [2, 4] {
                    for (name, methods) in
                        [("fast", Methods::FAST), ("balanced", Methods::BALANCED), ("exact", Methods::EXACT)]
                    {
                        let mut run = active(rig(wheels, methods));
                        group.bench_function(BenchmarkId::new(name, wheels), |b| {
                            b.iter(|| black_box(&run()).state.torque);
                        });
                    }
                }
                group.finish();
            }

            /// Switches on the lead, as `lead = true` in a rig file does.
            pub(super) fn lead(rig: &mut RigParts) {
                rig.lead = Some(LeadTime::default());
            }

            /// Switches on the passivity stage, as `passivity = true` in a rig file does.
            pub(super) fn passivity(rig: &mut RigParts) {
                rig.methods.passivity = Some(PassivityLimit::of(&rig.device, rig.timing.period_s()));
            }

            /// Measures a tick of the rig with balanced methods for different limits and stages:
            /// without any, with each alone, and with all. The limits are checked in every tick,
            /// but their values are never reached.
            pub(super) fn limits(c: &mut Criterion, label: &str) {
                let mut group = c.benchmark_group(format!("limits/{label}"));
                for wheels in [2, 4] {
                    let none = rig(wheels, Methods::BALANCED).with(|rig| rig.limits.traction = None);
                    let none = none.expect("a legal rig");
                    let traction = |rig: &mut RigParts| {
                        rig.limits.traction = Some(Traction { mu: 0.8, normal_force: 10.0 });
                    };
                    let heat = |rig: &mut RigParts| rig.limits.thermal_time = Some(1.0e5);
                    let energy = |rig: &mut RigParts| {
                        rig.limits.energy = Some(EnergyLimit { burst: 1000.0, power: 1000.0 });
                    };
                    let each: [(&str, &[&dyn Fn(&mut RigParts)]); 7] = [
                        ("none", &[]),
                        ("traction", &[&traction]),
                        ("thermal_time", &[&heat]),
                        ("energy", &[&energy]),
                        ("passivity", &[&passivity]),
                        ("lead", &[&lead]),
                        ("all", &[&traction, &heat, &energy, &passivity, &lead]),
                    ];
                    for (name, on) in each {
                        let rig = none.with(|rig| on.iter().for_each(|on| on(rig)));
                        let mut run = active(rig.expect("a legal rig"));
                        group.bench_function(BenchmarkId::new(name, wheels), |b| {
                            b.iter(|| black_box(&run()).state.torque);
                        });
                        // In any other mode a tick would take less time.
                        assert_eq!(run().state.mode, $core::safety::mode::Mode::Active, "{name}");
                    }
                }
                group.finish();
            }

            pub(super) fn stages(c: &mut Criterion, label: &str) {
                let mut group = c.benchmark_group(format!("stage/{label}"));
                for wheels in [2, 4] {
                    let rig = rig(wheels, Methods::BALANCED);
                    let device = rig.device;
                    let th = [0.3, -0.5, 1.1, 2.0];
                    let delta = [0.01, 0.02, -0.01, 0.015, 0.01, 0.0, -0.02, 0.01];
                    let mut posture = Posture::new(&device, &th);
                    group.bench_function(BenchmarkId::new("posture", wheels), |b| {
                        b.iter(|| posture.update(&device, black_box(&th[..wheels])));
                    });
                    group.bench_function(BenchmarkId::new("forward", wheels), |b| {
                        b.iter(|| posture.forward(&device, black_box(&delta)));
                    });
                    for (name, method) in [
                        ("odometry_euler", OdometryMethod::Euler),
                        ("odometry_midpoint", OdometryMethod::Midpoint),
                        ("odometry_magnus4", OdometryMethod::Magnus4),
                    ] {
                        group.bench_function(BenchmarkId::new(name, wheels), |b| {
                            let mut q = Quat::IDENTITY;
                            b.iter(|| {
                                q = odometry::advance(
                                    q,
                                    odometry::turn(&device, method, black_box(&th), black_box(&delta)),
                                );
                                q
                            });
                        });
                    }
                    group.bench_function(BenchmarkId::new("odometry_magnus4_cubic", wheels), |b| {
                        let (mut q, mut trail) = (Quat::IDENTITY, Trail::START);
                        let mut turned = [0.0; MAX_JOINTS];
                        turned[..delta.len()].copy_from_slice(&delta);
                        b.iter(|| {
                            let path = trail.step(PathFit::Cubic, black_box(&turned), 1.0);
                            let method = OdometryMethod::Magnus4;
                            q = odometry::advance(
                                q,
                                odometry::turn_along(&device, method, black_box(&th), &path),
                            );
                            q
                        });
                    });
                    let mut limits = JointLimits { peak: [0.93; MAX_JOINTS], weight: [3000.0; MAX_JOINTS] };
                    for i in (1..MAX_JOINTS).step_by(2) {
                        limits.peak[i] = 0.14;
                        limits.weight[i] = 4200.0;
                    }
                    for (name, torque) in [("allocation_inside", 0.2), ("allocation_saturated", 20.0)] {
                        let wanted = Vec3::new(0.6, -0.48, 0.64) * torque;
                        group.bench_function(BenchmarkId::new(name, wheels), |b| {
                            b.iter(|| allocate(black_box(posture.rows()), &limits, black_box(wanted)));
                        });
                    }
                }
                let stiffness = Mat3::from_diagonal(Vec3::splat(4.0));
                let (desired, actual) = (Quat::IDENTITY, rotation::exp(Vec3::new(0.3, -0.2, 0.4)));
                group.bench_function("spring_geodesic", |b| {
                    b.iter(|| geodesic_law(black_box(desired), black_box(actual), &stiffness, Vec3::ZERO));
                });
                group.bench_function("spring_quaternion", |b| {
                    b.iter(|| quaternion_law(black_box(desired), black_box(actual), &stiffness));
                });
                group.finish();
            }
        }
    };
}

width!(double, hbot_core, f64);
width!(single, hbot_core_f32, f32);

fn whole(c: &mut Criterion) {
    double::whole(c, "f64");
    single::whole(c, "f32");
}

fn limits(c: &mut Criterion) {
    double::limits(c, "f64");
    single::limits(c, "f32");
}

fn stages(c: &mut Criterion) {
    double::stages(c, "f64");
    single::stages(c, "f32");
}

criterion_group!(benches, whole, limits, stages);

/// Returns the mean time of a tick in each of `repetitions` series of `ticks` ticks, ns, sorted.
/// The rig has the stages that `stages` names.
fn means(repetitions: usize, ticks: u32, stages: &[String]) -> Vec<f64> {
    let has = |name: &str| stages.iter().any(|stage| stage == name);
    let rig = double::rig(2, hbot_core::design::rig::Methods::BALANCED).with(|rig| {
        if has("lead") {
            double::lead(rig);
        }
        if has("passivity") {
            double::passivity(rig);
        }
    });
    let mut run = double::active(rig.expect("a legal rig"));
    let mut means: Vec<f64> = (0..repetitions)
        .map(|_| {
            let start = Instant::now();
            for _ in 0..ticks {
                black_box(&run());
            }
            start.elapsed().as_nanos() as f64 / f64::from(ticks)
        })
        .collect();
    means.sort_by(f64::total_cmp);
    means
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    if let [peer, repetitions, ticks, stages @ ..] = &args[..]
        && peer == "--peer"
    {
        let repetitions = repetitions.parse().expect("a number of repetitions");
        let means = means(repetitions, ticks.parse().expect("a number of ticks"), stages);
        let (least, median, most) = (means[0], means[repetitions / 2], means[repetitions - 1]);
        println!("ns/tick min {least:.1} median {median:.1} max {most:.1}");
        return;
    }
    benches();
    Criterion::default().configure_from_args().final_summary();
}
