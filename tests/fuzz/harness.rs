//! Properties that must hold for every input of every decoder. The functions are called by
//! libFuzzer (`fuzz/`) and by the seeded mutations in this folder. Each takes arbitrary bytes and
//! panics if a property does not hold.

use std::sync::LazyLock;

use hbot_api::{Encoding, MAX_REQUEST_BYTES, Request, ServerMessage, Splitter};
use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_host::bus::drivers::moteus::Moteus;
use hbot_host::bus::drivers::odrive::Odrive;
use hbot_host::bus::{BusCommand, Expected, Protocol, Reading};
use hbot_host::line::Line;
use hbot_host::rig::layout::Layout;
use hbot_link::{Decoder, FromController, Message, ToController, encode};

/// Number of bytes read from a connection at once, as in the server.
const PIECE: usize = 16 * 1024;
/// Longest allowed error message, bytes. A message quotes what it refuses, but not all of it.
const LONGEST_MESSAGE: usize = 4096;

/// Checks frames from motor controllers.
pub(crate) fn link_from_controller(bytes: &[u8]) {
    link::<FromController>(bytes);
}

/// Checks frames to motor controllers.
pub(crate) fn link_to_controller(bytes: &[u8]) {
    link::<ToController>(bytes);
}

/// Checks the decoder of the link protocol. The results do not depend on how the bytes are divided,
/// there are at most as many results as frames, and every decoded message can be encoded and
/// decoded again unchanged.
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
                // The messages are compared as bytes, because a NaN is not equal to itself.
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

/// A line to motor controllers that brings bytes in pieces.
struct Piecemeal {
    bytes: Vec<u8>,
    at: usize,
    piece: usize,
}

impl Line for Piecemeal {
    fn read(&mut self, _now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.piece.min(buffer.len()).min(self.bytes.len() - self.at);
        buffer[..n].copy_from_slice(&self.bytes[self.at..self.at + n]);
        self.at += n;
        Ok(n)
    }

    fn write(&mut self, _now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        Ok(bytes.len())
    }
}

/// Feeds bytes to a bus in pieces of `piece` bytes. Returns the numbers of damaged and foreign
/// frames, and the last reading.
fn heard(
    protocol: &dyn Protocol,
    rig: &RigConfig,
    bytes: &[u8],
    piece: usize,
) -> (u32, u32, Option<Reading>) {
    let expected = Expected::new("fuzz", &rig.rig, &Layout::of(rig), 0);
    let mut bus = protocol.bus(Box::new(Piecemeal { bytes: bytes.to_vec(), at: 0, piece }), expected);
    // Answers to this command are readings: the vectors of the corpus carry the lowest bits of its
    // tick.
    let tick = 0x1000;
    assert!(bus.command(0, &BusCommand { tick, enable: true, watchdog_ms: 20, torque: Default::default() }));
    let (mut damaged, mut foreign, mut reading) = (0, 0, None);
    for _ in 0..bytes.len().div_ceil(piece) + 1 {
        let heard = bus.receive(1_000_000, tick + 1);
        (damaged, foreign) = (damaged + u32::from(heard.damaged), foreign + heard.foreign);
        reading = heard.reading.or(reading);
    }
    (damaged, foreign, reading)
}

/// Decodes lines of text from moteus servos. The result does not depend on the pieces in which the
/// bytes arrive, and there are no more answers than ends of lines.
pub(crate) fn moteus_answers(bytes: &[u8]) {
    static RIG: LazyLock<RigConfig> = LazyLock::new(|| {
        let text = include_str!("../../rigs/prototype-moteus.toml");
        RigConfig::from_toml(text, "rigs/prototype-moteus.toml").expect("it is legal")
    });
    let (whole, pieces) = (heard(&Moteus, &RIG, bytes, 4096), heard(&Moteus, &RIG, bytes, 7));
    assert_eq!((whole.0, whole.1), (pieces.0, pieces.1));
    assert_eq!(whole.2.is_some(), pieces.2.is_some());
    let ends = bytes.iter().filter(|byte| matches!(byte, b'\n' | b'\r')).count();
    assert!((whole.0 + whole.1) as usize <= ends, "{whole:?} of {ends} lines");
    if let Some(reading) = whole.2 {
        assert!(reading.answers <= 0x1000 && reading.joints.iter().all(|joint| joint.rate.is_finite()));
    }
}

/// Decodes lines of an ODrive adapter. The result does not depend on the pieces in which the bytes
/// arrive, and there are no more messages than bytes.
pub(crate) fn odrive_messages(bytes: &[u8]) {
    static RIG: LazyLock<RigConfig> = LazyLock::new(|| {
        let text = include_str!("../../rigs/prototype-odrive.toml");
        RigConfig::from_toml(text, "rigs/prototype-odrive.toml").expect("it is legal")
    });
    let (whole, pieces) = (heard(&Odrive, &RIG, bytes, 4096), heard(&Odrive, &RIG, bytes, 7));
    assert_eq!((whole.0, whole.1), (pieces.0, pieces.1));
    assert_eq!(whole.2.is_some(), pieces.2.is_some());
    assert!((whole.0 + whole.1) as usize <= bytes.len(), "{whole:?} of {} bytes", bytes.len());
    if let Some(reading) = whole.2 {
        assert!(reading.answers <= 0x1000 && reading.joints.iter().all(|joint| joint.rate.is_finite()));
    }
}

/// Checks lines of JSON from clients.
pub(crate) fn api_json(bytes: &[u8]) {
    api(Encoding::Json, bytes);
}

/// Checks MessagePack from clients.
pub(crate) fn api_msgpack(bytes: &[u8]) {
    api(Encoding::Msgpack, bytes);
}

/// Checks the decoders of the TCP API. The server's buffers at most one message and one piece, its
/// error messages are short, and every decoded request can be encoded and decoded again unchanged.
fn api(encoding: Encoding, bytes: &[u8]) {
    let mut splitter = Splitter::new(encoding);
    let mut again = Vec::new();
    for piece in bytes.chunks(PIECE) {
        splitter.push(piece);
        while let Some(message) = splitter.next_message() {
            let Ok(message) = message else { continue };
            let _ = ServerMessage::read(encoding, message);
            match Request::read(encoding, message) {
                Ok(request) => {
                    again.clear();
                    encoding.encode(&request, &mut again).expect("what was taken can be sent");
                    let mut splitter = Splitter::new(encoding);
                    splitter.push(&again);
                    // An encoded number can be longer than the original, such as 100000.0 for 1e5.
                    let Some(Ok(message)) = splitter.next_message() else { continue };
                    assert_eq!(Request::read(encoding, message).ok().as_ref(), Some(&request));
                }
                Err(refusal) => assert!(refusal.error.message.len() < LONGEST_MESSAGE, "{refusal:?}"),
            }
        }
        assert!(splitter.pending() <= MAX_REQUEST_BYTES + PIECE);
    }
}

/// Checks rig files.
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

/// Checks scene files, and their conversion to JSON and back.
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
    /// Name of the decoder: its file in `fuzz/fuzz_targets`, and its folder in `fuzz/corpus` if it
    /// has one.
    pub(crate) name: &'static str,
    /// Function that checks one input. It panics if a property does not hold.
    pub(crate) check: fn(&[u8]),
}

/// All decoders under test.
pub(crate) const TARGETS: [Target; 8] = [
    Target { name: "link_from_controller", check: link_from_controller },
    Target { name: "link_to_controller", check: link_to_controller },
    Target { name: "moteus_answers", check: moteus_answers },
    Target { name: "odrive_messages", check: odrive_messages },
    Target { name: "api_json", check: api_json },
    Target { name: "api_msgpack", check: api_msgpack },
    Target { name: "rig_file", check: rig_file },
    Target { name: "scene_file", check: scene_file },
];
