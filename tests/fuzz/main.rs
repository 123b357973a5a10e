//! Runs the decoders on seeded mutations of their corpus, which are equal in every run.
//! `HBOT_FUZZ_INPUTS` sets the number of inputs per decoder (default 20,000). Ten million take
//! minutes in release:
//!
//! ```text
//! HBOT_FUZZ_INPUTS=10000000 cargo test --release --test fuzz -- --nocapture
//! ```

mod arduino;
mod harness;

use std::path::Path;
use std::time::Instant;

use harness::{TARGETS, Target};
use hbot_api::{Encoding, Request};
use oorandom::Rand64;

/// Default number of inputs per decoder.
const INPUTS: u64 = 20_000;
/// Longest input, bytes: several frames, or a line with room to grow.
const LONGEST: usize = 4096;

/// Returns the inputs from which mutations begin: the files of a folder, or the requests in
/// hbot-api's golden file.
fn corpus(target: &Target) -> Vec<Vec<u8>> {
    match target.name {
        "api_json" => requests(Encoding::Json),
        "api_msgpack" => requests(Encoding::Msgpack),
        name => files(&Path::new("fuzz/corpus").join(name)),
    }
}

fn requests(encoding: Encoding) -> Vec<Vec<u8>> {
    let lines = include_str!("../../crates/hbot-api/src/tests/messages.golden").lines();
    let encoded = |request: Request| {
        let mut bytes = Vec::new();
        encoding.encode(&request, &mut bytes).expect("finite");
        bytes
    };
    lines.filter_map(|line| Request::read(Encoding::Json, line.as_bytes()).ok()).map(encoded).collect()
}

fn files(folder: &Path) -> Vec<Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("a file").path()).collect();
    // The file system returns the files in any order.
    paths.sort();
    assert!(!paths.is_empty(), "{} is empty", folder.display());
    paths.iter().map(|path| std::fs::read(path).expect("readable")).collect()
}

/// Bytes that have a meaning for decoders.
const TELLING: &[u8] = b"\0\x01\x7f\x80\xfe\xff\n\"{}[],:.-+eE0#='\\ ";

fn mutate(input: &mut Vec<u8>, others: &[Vec<u8>], random: &mut Rand64) {
    let below = |n: usize, random: &mut Rand64| random.rand_range(0..n.max(1) as u64) as usize;
    let at = below(input.len(), random);
    let span = 1 + below(16, random);
    match below(8, random) {
        0 if !input.is_empty() => input[at] ^= 1 << below(8, random),
        1 if !input.is_empty() => input[at] = random.rand_u64() as u8,
        2 if !input.is_empty() => input[at] = TELLING[below(TELLING.len(), random)],
        3 => drop(input.drain(at..(at + span).min(input.len()))),
        4 => input.insert(at, TELLING[below(TELLING.len(), random)]),
        5 => {
            let piece: Vec<u8> = input[at..(at + span).min(input.len())].to_vec();
            input.splice(at..at, piece);
        }
        6 => input.truncate(at),
        _ => {
            let other = &others[below(others.len(), random)];
            let from = below(other.len(), random);
            let to = (from + 4 * span).min(other.len());
            input.splice(at..at, other[from..to].iter().copied());
        }
    }
    input.truncate(LONGEST);
}

/// Corrects the checksum of a link frame, so that the code behind the check is reached too.
fn reframe(input: &mut Vec<u8>) {
    let end = input.iter().position(|byte| *byte == 0).unwrap_or(input.len());
    let mut body = input[..end].to_vec();
    let Ok(n) = cobs::decode_in_place(&mut body) else { return };
    let Some(length) = n.checked_sub(4) else { return };
    let check = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&body[..length]);
    body.truncate(length);
    body.extend(check.to_le_bytes());
    let mut frame = vec![0; cobs::max_encoding_length(body.len()) + 1];
    let n = cobs::encode(&body, &mut frame);
    frame.truncate(n + 1);
    input.splice(..(end + 1).min(input.len()), frame);
}

/// Replaces `input` by one of `seeds` with up to seven mutations.
fn next_input(input: &mut Vec<u8>, seeds: &[Vec<u8>], random: &mut Rand64) {
    input.clone_from(&seeds[random.rand_range(0..seeds.len() as u64) as usize]);
    for _ in 0..random.rand_range(0..8) {
        mutate(input, seeds, random);
    }
}

fn inputs() -> u64 {
    std::env::var("HBOT_FUZZ_INPUTS").map_or(INPUTS, |n| n.parse().expect("a number"))
}

fn target(name: &str) -> &'static Target {
    TARGETS.iter().find(|target| target.name == name).expect("a target")
}

fn run(name: &str) {
    let (target, inputs) = (target(name), inputs());
    let seeds = corpus(target);
    seeds.iter().for_each(|seed| (target.check)(seed));
    let mut random = Rand64::new(1);
    let (mut input, mut longest) = (Vec::new(), std::time::Duration::ZERO);
    let start = Instant::now();
    for _ in 0..inputs {
        next_input(&mut input, &seeds, &mut random);
        if name.starts_with("link") && random.rand_range(0..2) == 0 {
            reframe(&mut input);
        }
        let begun = Instant::now();
        (target.check)(&input);
        longest = longest.max(begun.elapsed());
    }
    let took = start.elapsed().as_secs_f64();
    let (rate, slowest) = (inputs as f64 / took, longest.as_secs_f64() * 1e3);
    println!("{name}: {inputs} inputs in {took:.1} s, {rate:.0} a second, the slowest {slowest:.3} ms");
}

#[test]
fn frames_from_controllers() {
    run("link_from_controller");
}

#[test]
fn frames_to_controllers() {
    run("link_to_controller");
}

#[test]
fn answers_of_moteus_servos() {
    run("moteus_answers");
}

#[test]
fn messages_of_odrives() {
    run("odrive_messages");
}

#[test]
fn lines_of_json() {
    run("api_json");
}

#[test]
fn maps_of_messagepack() {
    run("api_msgpack");
}

#[test]
fn rig_files() {
    run("rig_file");
}

#[test]
fn scene_files() {
    run("scene_file");
}

#[test]
fn every_target_has_its_file_and_its_entry() {
    let manifest = std::fs::read_to_string("fuzz/Cargo.toml").expect("readable");
    for target in TARGETS {
        assert!(Path::new(&format!("fuzz/fuzz_targets/{}.rs", target.name)).exists(), "{}", target.name);
        assert!(manifest.contains(&format!("name = \"{}\"", target.name)), "{}", target.name);
    }
}
