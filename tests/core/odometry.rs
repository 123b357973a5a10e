//! The methods of odometry have their stated orders (physics notes, section 4).

use crate::bench;
use crate::prelude::*;
use hbot_core::design::rig::OdometryMethod::{self, Euler, Magnus4, Midpoint};
use hbot_core::design::rig::PathFit::{self, Cubic, Quadratic, Straight};
use hbot_core::motion::odometry::{advance, turn, turn_along};
use hbot_core::motion::path::Trail;
use hbot_testing::prototype::wheels as prototype_wheels;

/// A device whose joints turn at constant rates that do not match each other, so that the sphere
/// slips as well.
struct Segment {
    device: Device,
    theta: Vec<f64>,
    rates: Vec<f64>,
}

/// Duration of a segment, s.
const TIME: f64 = 0.3;

impl Segment {
    fn new(rng: &mut Rng) -> Self {
        let [mut a, mut b] = prototype_wheels();
        for wheel in [&mut a, &mut b] {
            wheel.axis += rng.vector(0.2);
            wheel.toe = rng.between(-0.3, 0.3);
        }
        let third = WheelSpec { axis: Vec3::new(0.0, 0.5, -1.0), cone: rng.between(0.2, 0.5), ..a };
        let device = Device::new(0.102, 0.467, &[a, b, third]).unwrap();
        let theta: Vec<f64> = (0..3).map(|_| rng.between(-3.0, 3.0)).collect();
        let mut omega = rng.vector(2.0);
        omega.x += 2.0;
        let fit = Posture::new(&device, &theta).inverse(omega);
        let rates = fit[..6].iter().map(|rate| rate + rng.between(-2.0, 2.0)).collect();
        Self { device, theta, rates }
    }

    /// Returns the orientation at the end of the segment, computed in `n` steps.
    fn end(&self, method: OdometryMethod, n: u32) -> Quat {
        let h = TIME / f64::from(n);
        let delta: Vec<f64> = self.rates.iter().map(|rate| rate * h).collect();
        (0..n).fold(Quat::IDENTITY, |q, k| {
            let at = |i: usize| self.theta[i] + self.rates[2 * i] * h * f64::from(k);
            advance(q, turn(&self.device, method, &[at(0), at(1), at(2)], &delta))
        })
    }
}

#[test]
fn euler_midpoint_and_magnus_have_orders_1_2_and_4() {
    let mut rng = Rng(3);
    let segments: Vec<Segment> = (0..15).map(|_| Segment::new(&mut rng)).collect();
    // The steering turns by 5 to 20 mrad per step. The leading error of each method is then far
    // above rounding (Magnus: 1e-10), and far above its next order.
    for (method, order, n) in [(Euler, 1.0, 4000), (Midpoint, 2.0, 1000), (Magnus4, 4.0, 250)] {
        let orders: Vec<f64> = segments
            .iter()
            .map(|segment| {
                // With steps sixteen times finer, the error of the Magnus method is 65,536 times
                // smaller than with the coarser steps.
                let reference = segment.end(Magnus4, 4000);
                let [coarse, fine] =
                    [n, 2 * n].map(|n| rotation::angle_between(segment.end(method, n), reference));
                (coarse / fine).log2()
            })
            .collect();
        let median = median(orders.clone());
        assert!((median - order).abs() < 0.1, "{method:?}: order {median}, of {orders:?}");
    }
}

#[test]
fn midpoint_and_magnus_are_exact_where_the_steering_stands_still() {
    let mut rng = Rng(4);
    for _ in 0..20 {
        let mut segment = Segment::new(&mut rng);
        for steer in segment.rates.iter_mut().step_by(2) {
            *steer = 0.0;
        }
        let reference = segment.end(Magnus4, 1);
        for method in [Euler, Midpoint, Magnus4] {
            // The contact frames do not move, so one step is as accurate as a hundred, except for
            // rounding.
            let off = rotation::angle_between(segment.end(method, 100), reference);
            assert!(off < 100.0 * f64::EPSILON * 8.0, "{method:?}: {off:e}");
        }
    }
}

/// The true orientation of a prototype's sphere and its joint angles, while a person turns it.
#[derive(Clone, Copy)]
struct Truth {
    q: Quat,
    joints: [f64; 4],
}

/// Number of steps of the truth per millisecond.
const FINE: usize = 16;

/// Returns a smooth motion of 1 s with `FINE` samples per millisecond. The sphere turns about all
/// three axes at up to 3 rad/s, with three different frequencies, and the wheels roll. The
/// integration by the classic Runge-Kutta method has an error below 1e-13.
fn motion(seed: u64) -> Vec<Truth> {
    let device = hbot_testing::prototype::device();
    let mut rng = Rng(seed);
    let pace: Vec<f64> = (0..3).map(|_| rng.between(4.0, 9.0)).collect();
    let phase = rng.vector(3.0);
    let omega = |t: f64| {
        Vec3::new(
            1.7 * (pace[0] * t + phase.x).sin(),
            1.7 * (pace[1] * t + phase.y).sin(),
            1.7 * (pace[2] * t + phase.z).sin(),
        )
    };
    let flow = |t: f64, state: &Truth| {
        let w = omega(t);
        let rates = Posture::new(&device, &[state.joints[0], state.joints[2]]).inverse(w);
        let q = Quat::from_xyzw(0.5 * w.x, 0.5 * w.y, 0.5 * w.z, 0.0) * state.q;
        Truth { q, joints: [rates[0], rates[1], rates[2], rates[3]] }
    };
    let along = |state: &Truth, by: &Truth, h: f64| Truth {
        q: state.q + by.q * h,
        joints: core::array::from_fn(|j| state.joints[j] + h * by.joints[j]),
    };
    let h = 1e-3 / FINE as f64;
    let mut state = Truth { q: Quat::IDENTITY, joints: [0.3, 0.0, -0.5, 0.0] };
    (0..=1000 * FINE)
        .map(|k| {
            let (now, t) = (state, k as f64 * h);
            let k1 = flow(t, &now);
            let k2 = flow(t + 0.5 * h, &along(&now, &k1, 0.5 * h));
            let k3 = flow(t + 0.5 * h, &along(&now, &k2, 0.5 * h));
            let k4 = flow(t + h, &along(&now, &k3, h));
            state = [(k1, 1.0), (k2, 2.0), (k3, 2.0), (k4, 1.0)]
                .iter()
                .fold(now, |sum, (k, weight)| along(&sum, k, h / 6.0 * weight));
            state.q = rotation::renormalized(state.q);
            now
        })
        .collect()
}

/// Returns the orientation error that odometry accumulates in 0.6 s, rad. Readings come every `ms`
/// milliseconds times the numbers of `pattern`, which repeats. The first readings, which the fit
/// needs to start, come before the 0.6 s.
fn drift(truth: &[Truth], method: OdometryMethod, fit: PathFit, ms: f64, pattern: &[usize]) -> f64 {
    let device = hbot_testing::prototype::device();
    let unit = (ms * FINE as f64) as usize;
    let mut trail = Trail::START;
    let (mut at, mut q) = (0, None);
    for ticks in pattern.iter().cycle() {
        let next = at + ticks * unit;
        if at >= 88 * FINE && q.is_none() {
            q = Some((truth[at].q, at));
        }
        if at >= 704 * FINE {
            break;
        }
        let mut delta = [0.0; hbot_core::MAX_JOINTS];
        for j in 0..4 {
            delta[j] = truth[next].joints[j] - truth[at].joints[j];
        }
        let th = [truth[at].joints[0], truth[at].joints[2]];
        let path = trail.step(fit, &delta, *ticks as f64);
        if let Some((q, _)) = &mut q {
            *q = advance(*q, turn_along(&device, method, &th, &path));
        }
        at = next;
    }
    rotation::angle_between(q.unwrap().0, truth[at].q)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The error of the path, in addition to that of the method (the table of the physics notes,
/// section 4).
#[test]
fn the_path_s_order_is_the_number_of_readings_that_it_goes_through() {
    let motions: Vec<Vec<Truth>> = (0..9).map(motion).collect();
    let even = [1];
    // As if one reading in four were lost.
    let uneven = [1, 1, 2, 1, 1, 1, 3, 1];
    for (method, fit, order) in [
        (Midpoint, Straight, 2.0),
        (Magnus4, Straight, 2.0),
        (Midpoint, Quadratic, 2.0),
        (Midpoint, Cubic, 2.0),
        (Magnus4, Quadratic, 3.0),
        (Magnus4, Cubic, 4.0),
    ] {
        for pattern in [&even[..], &uneven[..]] {
            let steps = if pattern.len() == 1 { [4.0, 2.0, 1.0] } else { [2.0, 1.0, 0.5] };
            let errors = steps.map(|ms| {
                median(motions.iter().map(|truth| drift(truth, method, fit, ms, pattern)).collect())
            });
            // The drifts go from 4e-5 down to 1e-10 rad, above the reference's 1e-13, so that only
            // the leading error counts.
            for pair in errors.windows(2) {
                let measured = (pair[0] / pair[1]).log2();
                assert!((measured - order).abs() < 0.1, "{method:?}, {fit:?}: {measured} of {errors:?}");
            }
        }
    }
    // The sizes in the notes' table belong to another motion, hence a factor of three.
    for (fit, noted) in [(Straight, 6.2e-6), (Quadratic, 3.0e-8), (Cubic, 6.4e-10)] {
        let got = median(motions.iter().map(|truth| drift(truth, Magnus4, fit, 1.0, &even)).collect());
        assert!((noted / 4.0..noted * 3.0).contains(&got), "{fit:?}: {got:e} where the notes have {noted:e}");
    }
}

/// In 32 bits a curved path still pays off. The remaining error is rounding, far below the error of
/// a straight path.
#[test]
fn in_single_precision_rounding_is_what_is_left() {
    use hbot_core::rotation::angle_between;
    use hbot_core_f32::{Device, Vec3, WheelSpec, design::rig, motion::odometry, motion::path, rotation};
    let wheels = prototype_wheels().map(|wheel| WheelSpec {
        axis: Vec3::new(wheel.axis.x as f32, wheel.axis.y as f32, wheel.axis.z as f32),
        cone: wheel.cone as f32,
        toe: wheel.toe as f32,
        radius: wheel.radius as f32,
        steer_inertia: wheel.steer_inertia as f32,
        drive_inertia: wheel.drive_inertia as f32,
        axial_inertia: 0.0,
    });
    let device = Device::new(0.102, 0.467, &wheels).unwrap();
    let truth = motion(2);
    let drift = |fit| {
        let (mut trail, mut q) = (path::Trail::START, hbot_core_f32::Quat::IDENTITY);
        let mut from = Quat::IDENTITY;
        for ms in (0..700).step_by(4) {
            let (now, next) = (&truth[ms * FINE], &truth[(ms + 4) * FINE]);
            let mut delta = [0.0; hbot_core_f32::MAX_JOINTS];
            for j in 0..4 {
                delta[j] = (next.joints[j] - now.joints[j]) as f32;
            }
            let th = [now.joints[0], now.joints[2]].map(|th| rotation::wrap_angle(th as f32));
            let path = trail.step(fit, &delta, 4.0);
            if ms == 88 {
                from = now.q;
                q = hbot_core_f32::Quat::from_xyzw(
                    from.x as f32,
                    from.y as f32,
                    from.z as f32,
                    from.w as f32,
                );
            }
            if ms >= 88 {
                q = odometry::advance(
                    q,
                    odometry::turn_along(&device, rig::OdometryMethod::Magnus4, &th, &path),
                );
            }
        }
        assert_ne!(from, Quat::IDENTITY);
        let q = Quat::from_xyzw(q.x.into(), q.y.into(), q.z.into(), q.w.into());
        angle_between(q, truth[700 * FINE].q)
    };
    // 153 steps, each of which rounds the quaternion and a turn of at most 12 mrad: 1e-7 times
    // sqrt(153).
    let rounding = 2e-6;
    assert!(drift(rig::PathFit::Cubic) < rounding, "{:e}", drift(rig::PathFit::Cubic));
    assert!(drift(rig::PathFit::Straight) > 5.0 * rounding, "{:e}", drift(rig::PathFit::Straight));
}

/// In 32 bits many small turns add up better than by a product of quaternions, whose roundings add
/// up too (docs/accuracy.md).
#[test]
fn in_single_precision_many_small_turns_add_up_to_a_few_roundings() {
    use hbot_core_f32::{Quat as Quat32, Vec3 as Vec32, motion::odometry, rotation as rotation32};
    let drift = |turned: fn(Quat32, Vec32) -> Quat32| {
        let (mut q, mut exact) = (Quat32::IDENTITY, Quat::IDENTITY);
        // 6 rad/s at 8 kHz for 5 s, about an axis that moves.
        for k in 0..40_000 {
            let t = f64::from(k) / 8000.0;
            let turn = Vec3::new(t.cos(), (0.7 * t).sin(), 0.5).normalize() * (6.0 / 8000.0);
            let rounded = Vec32::new(turn.x as f32, turn.y as f32, turn.z as f32);
            q = turned(q, rounded);
            exact = advance(exact, Vec3::new(rounded.x.into(), rounded.y.into(), rounded.z.into()));
        }
        let q = Quat::from_xyzw(q.x.into(), q.y.into(), q.z.into(), q.w.into());
        rotation::angle_between(rotation::renormalized(q), exact)
    };
    let [sum, product] = [drift(odometry::advance), drift(rotation32::turned_by_product)];
    assert!(sum < 3e-5 && 3.0 * sum < product, "{sum:e} rad, {product:e} rad by the product");
}

/// The controller integrates by the method and the path of its rig: from reading to reading it
/// turns as the functions for this method say.
#[test]
fn the_controller_turns_by_the_method_and_the_path_of_its_rig() {
    let mut ends = Vec::new();
    for method in [Euler, Midpoint, Magnus4] {
        for fit in [Straight, Quadratic, Cubic] {
            let rig = bench::altered(&bench::rig(), |rig| {
                (rig.methods.odometry, rig.methods.path) = (method, fit);
            });
            let mut bench = bench::Bench::new(rig);
            let mut last = bench.step().state;
            let (mut q, mut trail) = (last.q, Trail::START);
            for k in 0..200 {
                let t = 0.01 * f64::from(k);
                let state = bench.turn(Vec3::new(6.0 * t.cos(), -4.0, 5.0 * (2.0 * t).sin())).state;
                let mut delta = [0.0; hbot_core::MAX_JOINTS];
                for j in 0..4 {
                    delta[j] = rotation::wrap_angle(state.angle[j] - last.angle[j]);
                }
                let steer = [last.angle[0], last.angle[2]];
                q = advance(q, turn_along(&rig.device, method, &steer, &trail.step(fit, &delta, 1.0)));
                // 200 turns, each with the rounding of its angles.
                let off = rotation::angle_between(state.q, q);
                assert!(off < 1e-12, "{method:?}, {fit:?}, reading {k}: {off:e} rad");
                last = state;
            }
            ends.push((method, fit, q));
        }
    }
    // The choices lead to different ends, except for the paths of Euler.
    for (a, (method, fit, q)) in ends.iter().enumerate() {
        for (other, other_fit, end) in &ends[..a] {
            let off = rotation::angle_between(*q, *end);
            let same = *method == Euler && *other == Euler;
            assert!((off < 1e-12) == same, "{method:?}, {fit:?} and {other:?}, {other_fit:?}: {off:e} rad");
        }
    }
}

/// The controller assigns readings to the ticks that they answer, even if some are lost.
#[test]
fn the_controller_follows_a_curved_path_over_lost_readings() {
    // The counts are so fine that their rounding (3e-9 rad at the joint) does not matter.
    let fine = |rig: &mut hbot_core::RigParts| {
        rig.joints.iter_mut().for_each(|joint| (joint.counts_per_turn, joint.gear) = (1 << 30, 2.0));
    };
    let rig = bench::altered(&bench::rig(), fine);
    let unit = f64::from(1 << 30) * 2.0 / core::f64::consts::TAU;
    let truth = motion(5);
    let drift = |fit, lost: &dyn Fn(usize) -> bool| {
        let rig = bench::altered(&rig, |rig| rig.methods.path = fit);
        let mut controller = Controller::new(rig);
        let mut first = None;
        let mut last = None;
        for ms in 0..700_usize {
            let mut inputs = Inputs::quiet(ms as u64 + 1);
            if !lost(ms) {
                let now = &truth[ms * FINE];
                let mut counts = [0; hbot_core::MAX_JOINTS];
                for j in 0..4 {
                    counts[j] = (now.joints[j] * unit).round() as i64 as i32;
                }
                inputs.feedback = Some(JointReadings::new(ms as u32, counts, [0.0; hbot_core::MAX_JOINTS]));
                last = Some(now.q);
            }
            let state = controller.tick(&CompiledScene::empty(), &inputs).state;
            assert_eq!(state.mode, Mode::Idle, "{:?}", state.cause);
            if ms == 100 {
                first = Some((truth[100 * FINE].q, state.q));
            }
            if ms == 699 {
                let (then, q) = first.unwrap();
                // The turn since then, in N. An initial error stays in both orientations.
                let (made, want) = (state.q * q.conjugate(), last.unwrap() * then.conjugate());
                return rotation::angle_between(made, want);
            }
        }
        unreachable!()
    };
    let none = |_: usize| false;
    let some = |ms: usize| ms % 10 == 7 || ms % 23 == 5 || ms % 23 == 6;
    for lost in [&none as &dyn Fn(usize) -> bool, &some] {
        let [straight, quadratic, cubic] = [Straight, Quadratic, Cubic].map(|fit| drift(fit, lost));
        assert!(
            straight > 50.0 * quadratic && quadratic > 10.0 * cubic,
            "{straight:e} {quadratic:e} {cubic:e}"
        );
    }
}
