//! Local models of clients: rendered, softened, refused.

use super::commands::state;
use super::*;
use hbot_api::{Client, ErrorCode, Impedance, ModelCommand, ModelOk, PlaneCommand};

fn model(stiffness: impl Into<Impedance>, damping: f64) -> ModelCommand {
    let (stiffness, damping) = (stiffness.into(), damping.into());
    ModelCommand { stiffness, damping, valid_ms: 1000, ..ModelCommand::default() }
}

fn refusal(client: &mut Client, command: ModelCommand) -> ErrorBody {
    refused(client.call(Op::Model(Box::new(command))))
}

#[test]
fn a_model_is_rendered_and_ends() {
    let bench = bench();
    let mut client = bench.active();
    client.call(scene(json!({"effect": []}))).unwrap();
    client.subscribe(1).unwrap();
    // It turns the sphere about n1 until the wall at 0.05 rad holds it.
    let plane = PlaneCommand { normal: [1.0, 0.0, 0.0], offset: 0.05, stiffness: 4.0, damping: 0.02 };
    let command = ModelCommand {
        torque: [0.02, 0.0, 0.0],
        pose: Some([1.0, 0.0, 0.0, 0.0]),
        planes: vec![plane],
        seq: Some(42),
        ..model(0.0, 0.01)
    };
    assert_eq!(client.try_model(command.clone()).unwrap(), ModelOk { stiffness_scale: 1.0 });
    let seen = state(&mut client, "torque", |state| state.torque[0] > 0.015);
    assert_eq!(seen.client.unwrap().seq, Some(42));
    // It rests 5 mrad within the wall, where its push equals the torque.
    let mut newest = seen;
    eventually("rest in the wall", || {
        client.model(command.clone()).unwrap();
        let until = newest.tick + 400;
        newest = state(&mut client, "later states", |state| state.tick >= until);
        let depth = 2.0 * newest.q[1].asin() - 0.05;
        (depth - 0.005).abs() < 1e-3 && newest.omega.iter().all(|rate| rate.abs() < 0.01)
    });
    state(&mut client, "end of the model", |state| {
        state.tick > newest.tick + 1100 && state.torque == [0.0; 3]
    });
}

#[test]
fn what_the_loop_does_not_keep_stable_is_refused_or_softened() {
    let bench = bench();
    let mut client = bench.holder();
    let stable = client.info().unwrap().render.unwrap().stiffness_stable;
    // 10 % of reserve, and the border is taken as straight between some dampings.
    assert!(client.try_model(model(0.85 * stable, 0.02)).is_ok());
    for command in [
        model(stable, 0.02),
        model([0.1, 0.1, stable], 0.02),
        model([[stable, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]], 0.02),
        ModelCommand {
            planes: vec![PlaneCommand {
                normal: [0.6, 0.0, 0.8],
                offset: 0.1,
                stiffness: 0.5 * stable,
                damping: 0.0,
            }],
            ..model(0.5 * stable, 0.02)
        },
    ] {
        let error = refusal(&mut client, command.clone());
        assert_eq!(error.code, ErrorCode::OutOfRange, "{error}");
        assert!(error.message.contains("soften") && error.message.contains("1000 Hz"), "{error}");
        let part = client.try_model(ModelCommand { soften: true, ..command }).unwrap().stiffness_scale;
        assert!((0.8..1.0).contains(&part), "{part}");
    }
    // Two walls that face each other are not entered at once.
    let wall = |sign: f64| PlaneCommand {
        normal: [0.0, 0.0, sign],
        offset: 0.1,
        stiffness: 0.8 * stable,
        damping: 0.02,
    };
    let walls = ModelCommand { planes: vec![wall(1.0), wall(-1.0)], ..model(0.0, 0.0) };
    assert_eq!(client.try_model(walls).unwrap().stiffness_scale, 1.0);
    // Without damping only the lead keeps a spring stable: 203 N m/rad less 10 %
    // (docs/internals/borders.md). Too much damping is not stable either.
    assert!(client.try_model(model(180.0, 0.0)).is_ok());
    assert!(refusal(&mut client, model(205.0, 0.0)).message.contains("at most 18"));
    let late = refusal(&mut client, ModelCommand { soften: true, ..model(0.0, 1e3) });
    assert!(late.message.contains("acts too late"), "{late}");
}

#[test]
fn what_is_no_model_is_refused_and_named() {
    let bench = bench();
    let mut client = bench.holder();
    let slanted = [[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let error = refusal(&mut client, model(slanted, 0.02));
    assert_eq!(error.code, ErrorCode::BadRequest);
    assert!(error.message.contains("\"stiffness\" has the eigenvalue -1.000"), "{error}");
    let tick = client.ping(Value::Null).unwrap().tick;
    let ahead = refusal(&mut client, ModelCommand { tick: Some(tick + 1_000_000), ..model(0.1, 0.02) });
    assert_eq!(ahead.code, ErrorCode::OutOfRange);
    assert!(ahead.message.contains("in the future"), "{ahead}");
    // Matrices of 32-bit numbers and less than full rank.
    for k in 0..50 {
        let phase = 0.7 * f64::from(k);
        let (a, b) = ([phase.sin(), phase.cos(), 0.3], [0.0, (2.0 * phase).sin(), (3.0 * phase).cos()]);
        let entry = |i: usize, j: usize| 2.0 * a[i] * a[j] + f64::from(k % 2) * b[i] * b[j];
        let rows = [0, 1, 2].map(|i| [0, 1, 2].map(|j| f64::from(entry(i, j) as f32)));
        assert!(client.try_model(model(rows, 0.02)).is_ok(), "{rows:?}");
    }
}

/// Models that come faster than the loop runs are all answered, and the newest is in force.
#[test]
fn of_eight_models_at_once_the_newest_counts_and_none_is_lost() {
    let bench = bench();
    let mut client = bench.active();
    client.call(scene(json!({"effect": []}))).unwrap();
    client.subscribe(1).unwrap();
    let mut raw = greeted(&bench);
    raw.ask(r#"{"id": 1, "op": "acquire", "steal": true}"#);
    let lines: Vec<String> = (1..=8)
        .map(|k| {
            format!(
                r#"{{"id": {k}, "op": "model", "torque": [{}, 0, 0], "valid_ms": 1000, "seq": {k}}}"#,
                0.001 * f64::from(k)
            )
        })
        .collect();
    for line in &lines {
        raw.send(line);
    }
    for k in 1..=8 {
        let mut answer = raw.line();
        while answer["event"].is_string() {
            answer = raw.line();
        }
        assert_eq!((&answer["id"], &answer["ok"]["stiffness_scale"]), (&json!(k), &json!(1.0)), "{answer}");
    }
    state(&mut client, "newest", |state| state.client.as_ref().is_some_and(|client| client.seq == Some(8)));
    state(&mut client, "its torque", |state| (state.torque[0] - 0.008).abs() < 1e-6);
}
