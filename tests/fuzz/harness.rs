//! What must hold for every input of every decoder, whatever drives it: libFuzzer (`fuzz/`) or the seeded mutations beside this
//! file. Each function takes any bytes and panics where something does not hold.

use hbot_api::{Encoding, MAX_REQUEST_BYTES, Request, Splitter};
use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_link::{Decoder, FromController, Message, ToController, encode};

/// Bytes of a connection read at once, as the server does.
const PIECE: usize = 16 * 1024;
/// What a refusal may say at most, bytes: it quotes what it refuses, but not all of it.
const LONGEST_MESSAGE: usize = 4096;

/// Frames from motor controllers.
pub(crate) fn link_from_controller(bytes: &[u8]) {
    link::<FromController>(bytes);
}

/// Frames to motor controllers.
pub(crate) fn link_to_controller(bytes: &[u8]) {
    link::<ToController>(bytes);
}

/// The same results in whatever pieces the bytes come, as many as there are frames at most, and every message that was taken is
/// one that can be sent: it goes through its own frame unchanged.
fn link<M: Message>(bytes: &[u8]) {
    let (mut whole, mut pieces) = (Decoder::<M>::new(), Decoder::<M>::new());
    let mut again = Decoder::<M>::new();
    let (mut sent, mut resent) = ([0_u8; 512], [0_u8; 512]);
    let (mut results, mut kinds) = (0, Vec::new());
    whole.feed(bytes, |result| {
        results += 1;
        kinds.push(result.as_ref().err().copied());
        if let Ok(message) = result {
            let n = encode(&message, &mut sent).expect("a message that was taken fits its frame");
            assert!(n <= M::MAX_FRAME);
            let mut taken = 0;
            again.feed(&sent[..n], |result| {
                // Compared as bytes: a NaN is not equal to itself.
                let m = encode(&result.expect("it was a frame"), &mut resent).expect("it fits");
                taken += 1;
                assert_eq!(m, n);
            });
            assert_eq!((taken, &sent[..n]), (1, &resent[..n]));
        }
    });
    let zeros = bytes.iter().filter(|byte| **byte == 0).count();
    assert!(results <= zeros + 1, "{results} results of {zeros} frames");
    let mut at = 0;
    for byte in bytes {
        if let Some(result) = pieces.push(*byte) {
            assert_eq!(kinds[at], result.err());
            at += 1;
        }
    }
    assert_eq!(at, kinds.len());
}

/// Lines of JSON from clients.
pub(crate) fn api_json(bytes: &[u8]) {
    api(Encoding::Json, bytes);
}

/// MessagePack from clients.
pub(crate) fn api_msgpack(bytes: &[u8]) {
    api(Encoding::Msgpack, bytes);
}

/// No more is kept than a message and a piece; a refusal is short; what was taken goes through its own encoding unchanged.
fn api(encoding: Encoding, bytes: &[u8]) {
    let mut splitter = Splitter::new(encoding);
    let mut again = Vec::new();
    for piece in bytes.chunks(PIECE) {
        splitter.push(piece);
        while let Some(message) = splitter.next_message() {
            let Ok(message) = message else { continue };
            match Request::read(encoding, message) {
                Ok(request) => {
                    again.clear();
                    encoding.encode(&request, &mut again).expect("what was taken can be sent");
                    let mut splitter = Splitter::new(encoding);
                    splitter.push(&again);
                    // A number may be written longer than it came: 1e5 as 100000.0.
                    let Some(Ok(message)) = splitter.next_message() else { continue };
                    assert_eq!(Request::read(encoding, message).ok().as_ref(), Some(&request));
                }
                Err(refusal) => assert!(refusal.error.message.len() < LONGEST_MESSAGE, "{refusal:?}"),
            }
        }
        assert!(splitter.pending() <= MAX_REQUEST_BYTES + PIECE);
    }
}

/// Rig files.
pub(crate) fn rig_file(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    match RigConfig::from_toml(text, "x.toml") {
        Ok(config) => {
            let joints = config.rig.device.joints();
            assert!(config.controllers.len() == joints && config.ports.len() == joints);
            assert!(config.rig.timing.period_ns > 0);
        }
        Err(mistakes) => assert!(!mistakes.to_string().is_empty()),
    }
}

/// Scene files, and the same as JSON.
pub(crate) fn scene_file(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    match SceneFile::from_toml(text, "x.toml") {
        Ok(scene) => {
            assert_eq!(SceneFile::from_json(scene.to_json()).as_ref(), Ok(&scene));
            let _ = RunningScene::new().load(scene);
        }
        Err(mistakes) => assert!(!mistakes.to_string().is_empty()),
    }
}

/// A decoder under test.
#[derive(Clone, Copy)]
pub(crate) struct Target {
    /// What it is called: its file in `fuzz/fuzz_targets`, its folder in `fuzz/corpus`.
    pub(crate) name: &'static str,
    /// What must hold for every input.
    pub(crate) check: fn(&[u8]),
}

/// All of them.
pub(crate) const TARGETS: [Target; 6] = [
    Target { name: "link_from_controller", check: link_from_controller },
    Target { name: "link_to_controller", check: link_to_controller },
    Target { name: "api_json", check: api_json },
    Target { name: "api_msgpack", check: api_msgpack },
    Target { name: "rig_file", check: rig_file },
    Target { name: "scene_file", check: scene_file },
];
