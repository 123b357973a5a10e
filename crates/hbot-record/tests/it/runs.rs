//! Recordings of servers replay bit for bit, whatever happens in the run.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::net::SocketAddr;
use std::path::Path;

use hbot_api::{Event, InfoOk, SceneEvent, StateEvent};
use hbot_config::SceneFile;
use hbot_core::inputs::Command;
use hbot_core::safety::mode::{Cause, Mode};
use hbot_record::reader::Item;
use hbot_record::replay::{Replay, ReplayError, renumbered};
use hbot_record::told::{Told, told};
use hbot_record::{ClientRecording, Exact, Reader, Topic};
use hbot_testing::lines::JsonLines;

use crate::made::{assert_exact, exact, record, replay};

#[test]
fn every_scene_of_the_shelf_replays_bit_for_bit() {
    let shelf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let mut scenes = 0;
    for file in std::fs::read_dir(shelf).unwrap() {
        let path = file.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        let (recording, _) = record(SceneFile::from_path(&path).unwrap(), 3, |_| ());
        assert_exact(&recording, 3000);
        // Without torque, a wrong scene would replay as well.
        let moved = |exact: &Exact| matches!(exact, Exact::Tick(tick) if tick.1.state.mode == Mode::Active);
        assert!(exact(&recording).iter().any(|(record, _)| moved(record)), "{}", path.display());
        scenes += 1;
    }
    assert!(scenes >= 17, "{scenes} scenes");
}

/// Clients that stream, change the scene, cause a fault and a stop, recover, and steal the lease.
fn meddle(address: SocketAddr) {
    let mut first = JsonLines::greeted(address);
    for line in [
        r#"{"id": 1, "op": "acquire"}"#,
        r#"{"id": 2, "op": "set", "effect": "spring", "stiffness": 3}"#,
        r#"{"id": 3, "op": "torque", "torque": [0.1, 0, 0.05], "valid_ms": 500, "seq": 1}"#,
        r#"{"id": 4, "op": "load_scene", "scene": {"name": "two", "effect": [{"id": "a", "kind": "spring", "stiffness": 2, "fade_out_s": 0.2}, {"id": "b", "kind": "damper", "damping": 0.03}, {"id": "c", "kind": "snaps"}]}}"#,
        r#"{"id": 5, "op": "reference", "effect": "a", "q": [0.98, 0.2, 0, 0], "omega": [0.1, 0, 0], "valid_ms": 300}"#,
        r#"{"id": 6, "op": "align", "q": [1, 0.01, 0, 0], "weight": 0.5}"#,
        r#"{"id": 13, "op": "model", "stiffness": 1, "damping": 0.02, "planes": [{"normal": [1, 0, 0], "offset": 0.02, "stiffness": 2, "damping": 0.02}], "valid_ms": 300}"#,
        r#"{"id": 14, "op": "model", "torque": [0, 0, 0.05], "stiffness": [[1, 0.2, 0], [0.2, 1, 0], [0, 0, 2]], "damping": [0.01, 0.01, 0.02], "valid_ms": 500}"#,
        r#"{"id": 7, "op": "load_scene", "scene": {"name": "noisy", "simulate": {"link": {"latency_s": 0.0005, "jitter_s": 0, "loss": 0, "corrupt": 0.9}}}}"#,
    ] {
        assert!(first.ask(line)["ok"].is_object(), "{line}");
    }
    first.ask(r#"{"id": 12, "op": "subscribe", "every": 10}"#);
    first.state(|state| state["mode"] == "fault");
    first.ask(r#"{"id": 8, "op": "load_scene", "scene": {"name": "ideal", "effect": [{"id": "d", "kind": "spring", "stiffness": 1}], "simulate": {"link": {"latency_s": 0.0005, "jitter_s": 0, "loss": 0, "corrupt": 0}}}}"#);
    // The fault condition can last for some ticks.
    while !first.ask(r#"{"id": 9, "op": "reset"}"#)["ok"].is_object() {}
    first.ask(r#"{"id": 10, "op": "enable"}"#);
    first.ask(r#"{"id": 11, "op": "torque", "torque": [0, 0.1, 0], "valid_ms": 2000}"#);
    let mut second = JsonLines::greeted(address);
    second.ask(r#"{"id": 1, "op": "acquire", "steal": true}"#);
    second.ask(r#"{"id": 2, "op": "estop"}"#);
    second.ask(r#"{"id": 3, "op": "reset"}"#);
    second.ask(r#"{"id": 4, "op": "enable"}"#);
}

#[test]
fn streams_changes_faults_stops_and_stolen_leases_replay_bit_for_bit() {
    let (recording, _) = record(SceneFile::default_scene(), 60, meddle);
    assert_exact(&recording, 60_000);
    let (mut modes, mut commands, mut scenes, mut controllers) = (BTreeMap::new(), Vec::new(), 0, 0);
    for (record, _) in exact(&recording) {
        match record {
            Exact::Tick(tick) => {
                let cause = tick.1.state.cause;
                *modes.entry(format!("{:?} {cause:?}", tick.1.state.mode)).or_insert(0) += 1;
                commands.extend(tick.0.commands.iter().copied());
            }
            Exact::Scene(_) => scenes += 1,
            Exact::Controller(_) => controllers += 1,
            Exact::Lost(_) => panic!("nothing is lost in virtual time"),
        }
    }
    // With so many damaged frames, either cause can come first.
    let faults =
        [Cause::LinkCorrupt, Cause::LinkLost].map(|cause| format!("{:?} {:?}", Mode::Fault, Some(cause)));
    assert!(faults.iter().any(|fault| modes.contains_key(fault)), "{modes:?}");
    assert!(modes.contains_key("Estop None"), "{modes:?}");
    let has = |wanted: fn(&Command) -> bool| commands.iter().any(wanted);
    assert!(has(|command| matches!(command, Command::Stream { .. })), "{commands:?}");
    assert!(has(|command| matches!(command, Command::Reference { .. })), "{commands:?}");
    assert!(has(|command| matches!(command, Command::ClientLost(_))), "{commands:?}");
    assert!(has(|command| matches!(command, Command::Model(_))), "{commands:?}");
    // The first scene and four changes, and one scene and state of the law every ten seconds.
    assert!(scenes >= 5 && controllers >= 5, "{scenes} scenes, {controllers} states");
}

#[test]
fn a_recording_has_every_public_topic_of_every_tick_at_its_time() {
    let (recording, finished) = record(SceneFile::default_scene(), 2, |address| {
        JsonLines::greeted(address).ask(r#"{"id": 1, "op": "acquire"}"#);
    });
    let mut reader = Reader::new(Cursor::new(&recording)).unwrap();
    let mut topics: BTreeMap<String, Vec<u64>> = BTreeMap::new();
    while let Some(item) = reader.next().unwrap() {
        if let Item::Message { topic, log_time, .. } = item {
            topics.entry(topic).or_default().push(log_time);
        }
    }
    assert_eq!(finished.summary.ticks, 2000);
    for topic in [Topic::State, Topic::Joints, Topic::Transforms, Topic::Torque] {
        let times = &topics[topic.name()];
        assert_eq!(times.len(), 2000, "{}", topic.name());
        assert!(times.windows(2).all(|pair| pair[1] == pair[0] + 1_000_000), "{}", topic.name());
    }
    // One scene, the states of the law and the scenes for them, and the ticks.
    assert_eq!(topics[Topic::Scene.name()].len(), 1);
    assert!(topics[Topic::Exact.name()].len() >= 2002);
    // The client has acquired the lease. Whether its loss still happens within the run depends on
    // the machine.
    assert!(!topics[Topic::Event.name()].is_empty());
}

#[test]
fn another_scene_gives_the_torque_that_this_hand_would_have_felt() {
    let (recording, _) = record(SceneFile::default_scene(), 3, |_| ());
    let run = |stiffness: f64| {
        let scene = serde_json::json!({"name": "s", "effect": [{"id": "s", "kind": "spring", "stiffness": stiffness}]});
        let compiled = hbot_config::RunningScene::new().load(SceneFile::from_json(scene).unwrap());
        let replay = Replay::new(Cursor::new(&recording), Some(Box::new(renumbered(&compiled)))).unwrap();
        let mut torques = Vec::new();
        let report = replay.run(2000, 2999, |tick| {
            assert_eq!(tick.recorded.state.q, tick.computed.state.q, "the motion is the recorded one");
            torques.push(tick.computed.state.torque.length());
            Ok::<_, ReplayError>(())
        });
        assert_eq!(report.unwrap().range, Some((2000, 2999)));
        torques
    };
    let (soft, stiff) = (run(0.2), run(0.4));
    let (soft, stiff): (f64, f64) = (soft.iter().sum(), stiff.iter().sum());
    // A spring of twice the stiffness, at the same orientations. The damping of both springs is
    // zero, so the torques have the ratio of the stiffnesses, up to limits of the rig.
    assert!(soft > 0.0 && (stiff / soft - 2.0).abs() < 0.05, "{soft} {stiff}");
}

#[test]
fn a_part_of_a_recording_is_compared_if_asked() {
    let (recording, _) = record(SceneFile::default_scene(), 2, |_| ());
    let report =
        Replay::new(Cursor::new(&recording), None).unwrap().run(500, 999, |_| Ok::<_, ReplayError>(()));
    let report = report.unwrap();
    assert_eq!((report.ticks, report.range, report.is_exact()), (500, Some((500, 999)), true));
    assert_eq!(replay(&recording).unwrap().ticks, 2000);
}

/// A scene that is loaded after the answer to `info`, before the first state.
#[test]
fn a_client_records_the_scene_that_its_first_state_was_rendered_with() {
    let info = InfoOk { scene: serde_json::json!({"name": "Old"}), ..InfoOk::default() };
    let mut into = Cursor::new(Vec::new());
    let mut recording = ClientRecording::new(&mut into, &info, "hbot").unwrap();
    let loaded = SceneEvent { tick: 4, name: "New".to_owned(), effects: Vec::new(), by: None };
    recording.take(&Event::Scene(loaded)).unwrap();
    recording.take(&Event::State(StateEvent { tick: 5, ..StateEvent::default() })).unwrap();
    recording.finish().unwrap();
    let mut reader = Reader::new(Cursor::new(into.into_inner())).unwrap();
    let mut scenes = Vec::new();
    while let Some(item) = reader.next().unwrap() {
        if let Item::Message { topic, data, .. } = item
            && let Some(Told::Scene(scene)) = told(&topic, &data)
        {
            scenes.push((scene.tick, scene.name));
        }
    }
    assert_eq!(scenes, [(4, "New".to_owned())]);
}
