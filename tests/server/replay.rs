//! A run of the whole server in virtual time: the inputs of the controller are recorded and
//! replayed bit for bit.

use std::time::Duration;

use hbot_config::{RigConfig, SceneFile};
use hbot_core::{CompiledScene, Controller, Inputs, Outputs};
use hbot_server::server::{ServerOptions, Time};
use hbot_testing::server::recorded;
use tokio::io::{AsyncBufReadExt as _, AsyncWriteExt as _, BufReader};
use tokio::net::TcpStream;

struct Tick {
    scene: CompiledScene,
    inputs: Inputs,
    outputs: Outputs,
}

/// A client that changes everything it can while the loop runs.
async fn meddle(address: std::net::SocketAddr) {
    let mut stream = TcpStream::connect(address).await.expect("the server listens");
    let lines = [
        r#"{"id": 1, "op": "hello", "version": 1, "name": "a test"}"#,
        r#"{"id": 2, "op": "acquire"}"#,
        r#"{"id": 3, "op": "set", "effect": "spring", "stiffness": 3}"#,
        r#"{"op": "torque", "torque": [0.1, 0, 0.05], "valid_ms": 500, "seq": 1}"#,
        r#"{"id": 4, "op": "load_scene", "scene": {"name": "two", "effect": [{"id": "a", "kind": "spring", "stiffness": [[2, 0, 0], [0, 3, 0], [0, 0, 1]], "law": "quaternion"}, {"id": "b", "kind": "damper", "damping": 0.03}]}}"#,
        r#"{"id": 5, "op": "reference", "effect": "a", "q": [0.98, 0.2, 0, 0], "omega": [0.1, 0, 0], "valid_ms": 300}"#,
        r#"{"id": 6, "op": "disable"}"#,
        r#"{"id": 7, "op": "enable"}"#,
    ];
    let (reader, mut writer) = stream.split();
    let mut answers = BufReader::new(reader).lines();
    for line in lines {
        writer.write_all(line.as_bytes()).await.expect("sent");
        writer.write_all(b"\n").await.expect("sent");
        if line.contains("\"id\"") {
            // The requests are sent one at a time, so that each reaches the loop in a different
            // tick.
            answers.next_line().await.expect("an answer").expect("an answer");
        }
    }
}

#[test]
fn a_recorded_run_replays_bit_for_bit() {
    let options = ServerOptions::new(RigConfig::prototype(), SceneFile::default_scene(), Time::Virtual);
    let rig = options.rig.rig;
    let note = |scene: &CompiledScene, inputs: &Inputs, outputs: &Outputs| Tick {
        scene: scene.clone(),
        inputs: *inputs,
        outputs: *outputs,
    };
    let duration = Some(Duration::from_secs(20));
    let recorded = recorded(ServerOptions { duration, ..options }, note, |address| async move {
        meddle(address).await;
        std::future::pending().await
    });

    let mut again = Controller::new(rig);
    let (mut ticks, mut commands, mut scenes) = (0_u64, 0, std::collections::BTreeSet::new());
    for Tick { scene, inputs, outputs } in recorded {
        let replayed = again.tick(&scene, &inputs);
        // The debug text distinguishes floats by their bits, including the sign of zero.
        assert_eq!(format!("{replayed:?}"), format!("{outputs:?}"), "tick {}", inputs.tick);
        ticks += 1;
        commands += inputs.commands.len();
        scenes.insert(scene.revision());
    }
    assert_eq!(ticks, 20_000);
    assert!(commands >= 4, "enable at start, torque, reference, disable, enable: {commands}");
    // Two changes between the same ticks count as one.
    assert!(scenes.len() >= 2, "the scenes have changed: {scenes:?}");
}
