//! A client's local model: it is rendered in every tick like an effect of a scene, blends into the
//! next model, ends if it is not renewed, and ends with its client.

use crate::prelude::*;
use crate::shaping::ROUNDING;
use hbot_core::inputs::ModelCommand;
use hbot_core::render::model::{HalfSpace, LocalModel, MAX_PLANES};

/// Largest change of the torque in a tick by the slew limit of [`rig`], N m.
const SLEW: f64 = 0.2;

fn isotropic(torque: Vec3, stiffness: f64, damping: f64, pose: Option<Quat>) -> LocalModel {
    let all = |x| Mat3::from_diagonal(Vec3::splat(x));
    LocalModel::new(torque, all(stiffness), all(damping), pose)
}

fn diagonal(x: f64, y: f64, z: f64) -> Mat3 {
    Mat3::from_diagonal(Vec3::new(x, y, z))
}

fn wall(normal: Vec3, offset: f64, stiffness: f64) -> HalfSpace {
    HalfSpace { normal, offset, stiffness, damping: 0.0 }
}

fn valid(valid_ticks: u32, blend_ticks: Option<u32>) -> ModelCommand {
    ModelCommand { valid_ticks, blend_ticks, stamp: Stamp::default() }
}

fn send(bench: &mut Bench, command: ModelCommand, model: &LocalModel) -> Outputs {
    bench.step_with(|inputs| inputs.commands.push_model(command, model).unwrap())
}

#[test]
fn the_torque_is_that_of_the_formula_at_every_orientation_and_rate() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let pose = rotation::exp(Vec3::new(0.02, -0.01, 0.03));
    let (t0, stiffness, damping) = (Vec3::new(0.05, -0.02, 0.03), 3.0, 0.01);
    send(&mut bench, valid(1000, Some(0)), &isotropic(t0, stiffness, damping, Some(pose)));
    for k in 0..200 {
        let omega = Vec3::new((0.05 * f64::from(k)).sin(), 0.4, -(0.03 * f64::from(k)).cos());
        let state = bench.turn(omega).state;
        let turn = rotation::difference(state.q, pose);
        let want = t0 - turn * stiffness - state.omega * damping;
        assert!((state.torque - want).length() < 1e-9, "tick {k}: {} not {want}", state.torque);
    }
}

/// A rig whose passivity controller counts what delay creates.
fn passive(lead: Option<LeadTime>) -> Rig {
    altered(&rig(), |parts| {
        parts.lead = lead;
        parts.methods.passivity =
            Some(PassivityLimit { allowance: 0.001, store: 0.01, damping: 0.05, strict: false });
    })
}

/// The model and the spring are the same law, so everything that the loop does with a spring (lead,
/// limits, the count of energy, added damping) it must do with the model.
#[test]
fn a_model_is_led_limited_and_observed_as_the_same_spring_of_a_scene() {
    let pose = rotation::exp(Vec3::new(0.1, 0.0, 0.05));
    let scene = CompiledScene::new(1, &[effect(0, 1, spring(9.0, 0.004, pose, Anchor::Absolute))]).unwrap();
    let model = isotropic(Vec3::ZERO, 9.0, 0.004, Some(pose));
    for lead in [None, Some(LeadTime::default())] {
        let mut sprung = Bench::active(passive(lead), scene.clone());
        let mut modelled = Bench::active(passive(lead), CompiledScene::empty());
        send(&mut modelled, valid(5000, Some(0)), &model);
        sprung.step();
        // Both have the same history of torque before they are compared.
        for bench in [&mut sprung, &mut modelled] {
            bench.run(100);
            bench.command(Command::Disable);
            bench.run(100);
            bench.command(Command::Enable);
            bench.run(600);
        }
        let (mut damped, mut led) = (0, 0);
        for k in 0..1500 {
            // A swing of 11 Hz that grows, as if by delay.
            let omega = Vec3::X * (1.0 + 1e-3 * f64::from(k)) * (0.07 * f64::from(k)).sin();
            let [a, b] = [&mut sprung, &mut modelled].map(|bench| bench.turn(omega).state);
            // The same sums in another order.
            assert!((a.torque - b.torque).length() < 1e-9, "tick {k}: {} {}", a.torque, b.torque);
            assert!((a.damping - b.damping).abs() < 1e-6, "tick {k}: {} {}", a.damping, b.damping);
            damped += i32::from(a.damping > 0.0);
            led += i32::from(a.lead_us > 0.0);
        }
        // The lead takes away what delay creates.
        let took_part = if lead.is_some() { led > 1000 } else { damped > 10 };
        assert!(took_part, "the stage took part in {damped} ticks, the lead in {led}");
    }
}

#[test]
fn a_model_without_a_pose_acts_about_the_orientation_of_its_tick() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let state = bench.turn(Vec3::X * 0.5).state;
    let (seen, q) = (state.tick, state.q);
    for _ in 0..20 {
        bench.turn(Vec3::X * 0.5);
    }
    let model = isotropic(Vec3::ZERO, 4.0, 0.0, None);
    let stamp = Stamp { seq: Some(3), tick: Some(seen) };
    let outputs = send(&mut bench, ModelCommand { stamp, ..valid(100, Some(0)) }, &model);
    assert_eq!(outputs.reply(), Reply::Done);
    assert_eq!(outputs.state.client.unwrap().seq, Some(3));
    let turned = rotation::difference(outputs.state.q, q);
    assert!(turned.length() > 0.009 && (outputs.state.torque + turned * 4.0).length() < 1e-9);
    // Without a tick it is the orientation at arrival.
    let outputs = send(&mut bench, valid(100, Some(0)), &model);
    assert!(outputs.state.torque.length() < SLEW, "{}", outputs.state.torque);
    assert!(bench.step().state.torque.length() < 1e-9);
}

#[test]
fn a_model_blends_into_the_next_one_without_a_jump() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let t = |x: f64| isotropic(Vec3::X * x, 0.0, 0.0, None);
    // The first model fades in over 20 ms.
    let mut before = send(&mut bench, valid(1000, None), &t(0.1)).state.torque.x;
    assert!((before - 0.1 / 20.0).abs() < ROUNDING, "{before}");
    for k in 2..=26 {
        let torque = bench.step().state.torque.x;
        let want = 0.1 * (f64::from(k) / 20.0).min(1.0);
        assert!((torque - want).abs() < 1e-12, "{k}: {torque}");
    }
    // After 40 ticks the next one takes 40 ms, after a second 50 ms, and the time that is asked
    // for.
    bench.run(13);
    for (target, blend, ticks) in [(-0.1, None, 40.0), (0.1, Some(7), 7.0), (-0.05, Some(0), 0.0)] {
        let from = bench.step().state.torque.x;
        before = from;
        send(&mut bench, valid(1000, blend), &t(target));
        for k in 2..61 {
            let torque = bench.step().state.torque.x;
            let part = if ticks > 0.0 { (f64::from(k) / ticks).min(1.0) } else { 1.0 };
            assert!((torque - (from + (target - from) * part)).abs() < 1e-12, "{target} {k}: {torque}");
            assert!((torque - before).abs() <= SLEW);
            before = torque;
        }
    }
}

/// The first of them fades in, although the next one comes in the next tick.
#[test]
fn models_that_come_in_every_tick_are_in_force_at_once() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let model = isotropic(Vec3::X * 0.1, 3.0, 0.0, Some(Quat::IDENTITY));
    for blend in [None, Some(1), Some(2), Some(5)] {
        for _ in 0..60 {
            send(&mut bench, valid(10, blend), &model);
        }
        let torque = bench.step().state.torque;
        assert!((torque - Vec3::X * 0.1).length() < 1e-6, "{blend:?}: {torque}");
        bench.run(40);
    }
}

/// A model that describes the same law around another orientation changes nothing, however fast
/// the sphere turns.
#[test]
fn the_same_law_about_another_pose_is_not_felt() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let rest = Quat::IDENTITY;
    send(&mut bench, valid(1000, Some(0)), &isotropic(Vec3::ZERO, 5.0, 0.01, Some(rest)));
    for k in 0..300 {
        let state = bench.turn(Vec3::Z * 0.8).state;
        let want = rotation::difference(state.q, rest) * -5.0 - state.omega * 0.01;
        // The counts of the encoders leave some 10 microradians about other axes. These do not
        // commute with the turn of up to 0.24 rad: 5 N m/rad times half of their product.
        assert!((state.torque - want).length() < 5e-5, "{k}: {}", state.torque);
        if k % 17 == 0 {
            // Turns about one axis commute, so the law about the present pose has its torque there.
            let here = rotation::difference(state.q, rest) * -5.0;
            let outputs = send(&mut bench, valid(100, None), &isotropic(here, 5.0, 0.01, Some(state.q)));
            assert_eq!(outputs.reply(), Reply::Done);
        }
    }
}

#[test]
fn a_model_that_is_not_renewed_ends_in_20_ms_and_comes_back_without_a_jump() {
    let mut bench = Bench::active(rig(), spring_scene(1, 2.0, Vec3::X * 0.1));
    let scene = bench.step().state.torque;
    let model = isotropic(Vec3::Y * 0.1, 3.0, 0.0, Some(Quat::IDENTITY));
    send(&mut bench, valid(30, Some(0)), &model);
    for k in 1..30 {
        let torque = bench.step().state.torque;
        assert!((torque - scene - Vec3::Y * 0.1).length() < ROUNDING, "tick {k} of 30: {torque}");
    }
    for k in 1..=25 {
        let state = bench.step().state;
        let left = (1.0 - f64::from(k) / 20.0).max(0.0);
        assert!((state.torque - scene - Vec3::Y * (0.1 * left)).length() < 1e-12, "{k}: {}", state.torque);
        assert_eq!(state.mode, Mode::Active, "no fault");
    }
    let back = send(&mut bench, valid(30, None), &model).state.torque;
    assert!((back - scene).length() < 0.1 / 20.0 + 1e-12);
    assert!((bench.run(25).state.torque - scene - Vec3::Y * 0.1).length() < ROUNDING);
}

#[test]
fn a_client_that_is_gone_takes_its_model_with_it_unless_the_rig_keeps_it() {
    for (policy, after_10_ms) in
        [(OnClientLost::Ramp, 0.5), (OnClientLost::Keep, 1.0), (OnClientLost::Fault, 0.0)]
    {
        let mut bench = Bench::active(rig(), CompiledScene::empty());
        send(&mut bench, valid(500, Some(0)), &isotropic(Vec3::X * 0.1, 0.0, 0.0, None));
        bench.command(Command::ClientLost(policy));
        let state = bench.run(10).state;
        assert!((state.torque.x - 0.1 * after_10_ms).abs() < 1e-12, "{policy:?}: {}", state.torque);
        assert_eq!(state.mode == Mode::Fault, policy == OnClientLost::Fault);
    }
}

#[test]
fn a_wall_is_where_it_is_said_to_be_and_only_pushes() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let normal = Vec3::new(0.6, 0.0, 0.8);
    let mut model = isotropic(Vec3::ZERO, 0.0, 0.0, Some(Quat::IDENTITY));
    model.add_plane(HalfSpace { damping: 0.05, ..wall(normal, 0.03, 40.0) }).unwrap();
    send(&mut bench, valid(10_000, Some(0)), &model);
    let mut entered = None;
    for k in 0..200 {
        let omega = normal * if k < 120 { 0.4 } else { -0.4 };
        let state = bench.turn(omega).state;
        let depth = rotation::difference(state.q, Quat::IDENTITY).dot(normal) - 0.03;
        let push = state.torque.dot(normal);
        assert!(push < 1e-12, "it pulls: {push}");
        if depth <= 0.0 {
            assert_eq!(state.torque, Vec3::ZERO, "outside at {depth}");
        } else {
            entered = entered.or(Some(depth));
            // The slew limit needs 7 ticks for the step by the damping and the rate of the wall.
            let want = (-40.0 * depth - 0.05 * state.omega.dot(normal)).min(0.0);
            assert!((push - want).abs() < 1e-9, "{depth}: {push} not {want}");
        }
    }
    // One tick at 0.4 rad/s.
    assert!(entered.is_some_and(|depth| depth < 0.4 * DT + 1e-9), "{entered:?}");
}

/// The client sends nothing while the sphere is in the walls, and the next model no longer has
/// them.
#[test]
fn half_spaces_are_entered_and_left_between_two_models() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let mut model = isotropic(Vec3::ZERO, 0.0, 0.0, Some(Quat::IDENTITY));
    for k in 0..MAX_PLANES {
        let normal = rotation::exp(Vec3::Z * (0.1 * k as f64)) * Vec3::X;
        model.add_plane(wall(normal, 0.004 + 0.001 * k as f64, 5.0)).unwrap();
    }
    assert!(model.add_plane(wall(Vec3::X, 0.0, 1.0)).is_err(), "a ninth");
    send(&mut bench, valid(1000, Some(0)), &model);
    let mut before = Vec3::ZERO;
    let mut most = 0.0_f64;
    for k in 0..100 {
        let omega = Vec3::X * if k < 50 { 0.5 } else { -0.5 };
        let state = bench.turn(omega).state;
        let turn = rotation::difference(state.q, Quat::IDENTITY);
        let depths =
            model.planes().iter().map(|plane| (plane, (plane.normal.dot(turn) - plane.offset).max(0.0)));
        let want = depths.fold(Vec3::ZERO, |sum, (plane, depth)| sum - plane.normal * (5.0 * depth));
        // The torque of a gradient differs by half of turn times torque, which are nearly parallel.
        assert!(
            (state.torque - want).length() < 0.02 * want.length() + 1e-12,
            "{k}: {} {want}",
            state.torque
        );
        assert!((state.torque - before).length() < 0.05, "{k}");
        before = state.torque;
        most = most.max(before.length());
    }
    assert!(most > 0.5 && before.length() < 1e-9, "entered by {most} N m and left: {before}");
    // The next model comes while the sphere is inside, and has no walls any more.
    for _ in 0..30 {
        before = bench.turn(Vec3::X * 0.5).state.torque;
    }
    let inside = before.length();
    let next = isotropic(Vec3::ZERO, 0.0, 0.0, None);
    for k in 0..31 {
        let outputs = if k == 0 { send(&mut bench, valid(1000, Some(20)), &next) } else { bench.step() };
        let torque = outputs.state.torque;
        assert!((torque - before).length() < inside / 20.0 + 1e-9, "{torque} after {before}");
        before = torque;
    }
    assert!(inside > 0.1 && before.length() < 1e-9);
}

#[test]
fn a_change_of_scene_does_not_disturb_a_model() {
    let mut bench = Bench::active(rig(), spring_scene(1, 2.0, Vec3::X * 0.1));
    send(&mut bench, valid(2000, Some(0)), &isotropic(Vec3::Y * 0.3, 3.0, 0.0, Some(Quat::IDENTITY)));
    let before = bench.run(5).state.torque;
    bench.scene = spring_scene(2, 2.0, Vec3::X * 0.1);
    for k in 0..100 {
        let torque = bench.step().state.torque;
        assert!((torque - before).length() < 1e-9, "{k}: {torque} not {before}");
    }
    bench.scene = CompiledScene::new(3, &[]).unwrap();
    let mut last = before;
    for _ in 0..100 {
        let torque = bench.step().state.torque;
        assert!((torque - last).length() < 0.2 / 50.0 + 1e-9);
        last = torque;
    }
    assert!((last - Vec3::Y * 0.3).length() < 1e-9);
}

#[test]
fn of_several_models_in_a_tick_the_newest_counts_and_each_is_answered() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let outputs = bench.step_with(|inputs| {
        for k in 0..8 {
            let stamp = Stamp { seq: Some(k), tick: None };
            let model = isotropic(Vec3::X * 0.01 * (1.0 + k as f64), 0.0, 0.0, None);
            inputs.commands.push_model(ModelCommand { stamp, ..valid(100, Some(0)) }, &model).unwrap();
        }
        let ninth = inputs.commands.push_model(valid(1, None), &LocalModel::NONE);
        assert!(ninth.is_err(), "given back for the next tick");
        assert!(inputs.commands.model(6).is_none() && inputs.commands.model(7).is_some());
    });
    assert_eq!(outputs.replies, [Some(Reply::Done); 8]);
    assert_eq!(outputs.state.client.unwrap().seq, Some(7));
    assert!((outputs.state.torque.x - 0.08).abs() < ROUNDING, "{}", outputs.state.torque);
}

#[test]
fn what_is_no_model_is_refused_and_changes_nothing() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let good = isotropic(Vec3::X * 0.1, 1.0, 0.01, Some(Quat::IDENTITY));
    send(&mut bench, valid(10_000, Some(0)), &good);
    let torque = bench.step().state.torque;
    let with = |change: fn(&mut LocalModel)| {
        let mut model = good;
        change(&mut model);
        model
    };
    let with_plane = |plane| {
        let mut model = good;
        model.add_plane(plane).unwrap();
        model
    };
    for bad in [
        with(|model| model.torque = Vec3::X * f64::NAN),
        with(|model| model.stiffness = diagonal(1.0, -1.0, 1.0)),
        with(|model| model.stiffness.x_axis.y = 0.5),
        with(|model| model.stiffness = diagonal(f64::INFINITY, 1.0, 1.0)),
        with(|model| model.damping = diagonal(0.0, 0.0, f64::NAN)),
        with(|model| model.damping = diagonal(0.0, 0.0, -0.1)),
        with(|model| model.pose = Some(Quat::from_xyzw(0.0, 0.0, 0.0, 0.0))),
        with(|model| model.pose = Some(Quat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0))),
        with_plane(wall(Vec3::X * 2.0, 0.0, 1.0)),
        with_plane(wall(Vec3::X, f64::NAN, 1.0)),
        with_plane(wall(Vec3::X, 0.0, -1.0)),
        with_plane(HalfSpace { damping: f64::INFINITY, ..wall(Vec3::X, 0.0, 1.0) }),
    ] {
        let outputs = send(&mut bench, valid(5, None), &bad);
        assert_eq!(outputs.reply(), Reply::Refused(Refusal::NotFinite), "{bad:?}");
        assert_eq!(outputs.state.torque, torque);
    }
    let stamped = |tick| ModelCommand { stamp: Stamp { seq: Some(9), tick: Some(tick) }, ..valid(5, None) };
    let none = isotropic(Vec3::ZERO, 0.0, 0.0, None);
    let now = bench.tick;
    let ahead = send(&mut bench, stamped(now + 3), &none);
    assert_eq!(ahead.reply(), Reply::Refused(Refusal::Ahead { ticks: 3 }));
    let now = bench.tick;
    let old = send(&mut bench, stamped(now - 51), &none);
    assert_eq!(old.reply(), Reply::Refused(Refusal::TooOld { age_ticks: 51 }));
    assert_eq!((old.state.torque, old.state.client.unwrap().seq), (torque, None));
}

/// A torque of a thousand times the limit neither kicks nor holds on to the limit after its end.
#[test]
fn a_model_beyond_all_limits_stays_within_those_of_torque_and_slew() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let mut before = Vec3::ZERO;
    for k in 0..200 {
        let outputs = if k % 25 == 0 {
            let sign = if k % 50 == 0 { 1.0 } else { -1.0 };
            send(&mut bench, valid(10, None), &isotropic(Vec3::X * (2000.0 * sign), 1e5, 0.0, None))
        } else {
            bench.step()
        };
        let torque = outputs.state.torque;
        assert!(torque.length() < 2.0 + 1e-9 && (torque - before).length() < SLEW + 1e-9, "{k}: {torque}");
        before = torque;
    }
}
