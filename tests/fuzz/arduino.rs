//! Compares the decoder and the encoder of `clients/arduino/HbotLink` with those of hbot-link.
//! `.ci/arduino.sh` builds the C++ program `tests/arduino/decoder.cpp` and runs the test.

use std::io::{BufReader, BufWriter, Read, Write};
use std::process::{ChildStdin, Command as Program, Stdio};

use hbot_link::{
    Command, ControllerFlags, Decoder, Feedback, FrameError, FromController, JointFlags, JointReading,
    MAX_FEEDBACK_FRAME, MAX_JOINTS, ToController, encode,
};
use oorandom::Rand64;

use crate::{corpus, inputs, next_input, reframe, target};

/// The seed of the inputs. It differs from that of the other tests.
const SEED: u128 = 18;

/// Runs the decoder in C++ and that of hbot-link on the corpus of both directions and on mutations
/// of it. The results must be equal: the messages, and the reasons to refuse a frame.
#[test]
#[ignore = "needs HBOT_ARDUINO_DECODER, the program that .ci/arduino.sh builds"]
fn the_arduino_header_decodes_as_the_crate_does() {
    let program = std::env::var("HBOT_ARDUINO_DECODER").expect("HBOT_ARDUINO_DECODER is the program");
    let mut child = Program::new(program)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let to_child = child.stdin.take().expect("a pipe");
    let mut answers = BufReader::new(child.stdout.take().expect("a pipe"));
    let inputs = inputs();
    let writer = std::thread::spawn(move || each_input(inputs, Some(to_child), |_| ()));
    let mut kinds = [0_u64; KINDS];
    let (mut length, mut answer) = ([0; 4], Vec::new());
    let total = each_input(inputs, None, |input| {
        answers.read_exact(&mut length).expect("an answer to every input");
        answer.resize(u32::from_le_bytes(length) as usize, 0);
        answers.read_exact(&mut answer).expect("a whole answer");
        let expected = records(input, &mut kinds);
        assert!(answer == expected, "{input:02x?}\nthe header: {answer:02x?}\nhbot-link: {expected:02x?}");
    });
    assert_eq!(writer.join().expect("all inputs were sent"), total);
    assert!(child.wait().expect("the program ends").success(), "the program found an error");
    // Each kind of result must have come up, or the comparison says nothing about it.
    assert!(kinds[1..].iter().all(|count| *count > 0), "results by kind: {kinds:?}");
    println!("{total} inputs, no disagreement; results by kind: {:?}", &kinds[1..]);
}

/// Calls `each` with all inputs, which are equal in every run, and writes them to `child` if there
/// is one. Returns their number.
fn each_input(mutated: u64, child: Option<ChildStdin>, mut each: impl FnMut(&[u8])) -> u64 {
    let mut child = child.map(BufWriter::new);
    let mut give = |input: &[u8]| {
        if let Some(child) = &mut child {
            let length = u32::try_from(input.len()).expect("short");
            child.write_all(&length.to_le_bytes()).expect("the program reads");
            child.write_all(input).expect("the program reads");
        }
        each(input);
    };
    let mut seeds = corpus(target("link_to_controller"));
    seeds.extend(corpus(target("link_from_controller")));
    seeds.extend((0..=MAX_JOINTS).map(|joints| command(&vec![NO_ZERO; joints])));
    let mut torque = [NO_ZERO; MAX_JOINTS];
    torque[12] = ZERO_AFTER_A_RUN;
    seeds.extend((13..=MAX_JOINTS).map(|joints| command(&torque[..joints])));
    // A varint with more bytes than it needs, up to ten of a 64-bit number.
    seeds.extend((1..=10).map(|more| {
        let count = [vec![0x80; more], vec![0x00]].concat();
        framed(&[&[1, 7, 0, 20][..], &count].concat())
    }));
    seeds.iter().for_each(|seed| give(seed));
    let mut random = Rand64::new(SEED);
    let mut input = Vec::new();
    for _ in 0..mutated {
        next_input(&mut input, &seeds, &mut random);
        // Two of three, because few damaged frames reach the code behind the check.
        if random.rand_range(0..3) > 0 {
            reframe(&mut input);
        }
        give(&input);
    }
    seeds.len() as u64 + mutated
}

/// Bits of a torque that has no zero byte, so that its feedback is the longest possible.
const NO_ZERO: u32 = 0x8181_8181;
/// Bits of the torque of joint 12 with which byte 254 of the feedback is a zero, after 254 others:
/// the count of this joint takes 4 bytes instead of 5, and then its rate begins with a zero.
const ZERO_AFTER_A_RUN: u32 = 0x0081_8100;

/// Returns the frame of a command with the torques that have these bits.
fn command(torque: &[u32]) -> Vec<u8> {
    let torque = torque.iter().map(|bits| f32::from_bits(*bits)).collect();
    let command = Command { sequence: u32::MAX, enable: true, watchdog_ms: u16::MAX, torque };
    let mut frame = vec![0; MAX_FEEDBACK_FRAME];
    let length = encode(&ToController::Command(command), &mut frame).expect("it fits");
    frame.truncate(length);
    frame
}

/// Returns the frame of a body, which need not be a message.
fn framed(body: &[u8]) -> Vec<u8> {
    let unchecked = [body, &[0; 4]].concat();
    let mut frame = vec![0; cobs::max_encoding_length(unchecked.len()) + 1];
    let length = cobs::encode(&unchecked, &mut frame);
    frame.truncate(length + 1);
    reframe(&mut frame);
    frame
}

/// Number of kinds of results, as `hbot::Heard` numbers them: 0 is none.
const KINDS: usize = 8;

/// Returns what hbot-link makes of `input`, in the form of `tests/arduino/decoder.cpp`.
fn records(input: &[u8], kinds: &mut [u64; KINDS]) -> Vec<u8> {
    let mut records = Vec::new();
    Decoder::<ToController>::new().feed(input, |result| {
        let kind = match &result {
            Ok(ToController::Describe) => 1,
            Ok(ToController::Command(_)) => 2,
            Err(FrameError::TooLong) => 3,
            Err(FrameError::Cobs) => 4,
            Err(FrameError::TooShort) => 5,
            Err(FrameError::Crc) => 6,
            Err(FrameError::Body) => 7,
        };
        kinds[kind] += 1;
        records.push(kind as u8);
        if let Ok(ToController::Command(command)) = result {
            put_command(&mut records, &command);
        }
    });
    records
}

fn put_command(records: &mut Vec<u8>, command: &Command) {
    records.extend(command.sequence.to_le_bytes());
    records.push(command.enable.into());
    records.extend(command.watchdog_ms.to_le_bytes());
    records.push(command.torque.len() as u8);
    let reading = |torque: &f32| JointReading {
        count: torque.to_bits() as i32,
        rate: *torque,
        current: *torque,
        temperature: *torque,
        flags: JointFlags::from_bits(torque.to_bits() as u16),
    };
    command.torque.iter().for_each(|torque| records.extend(torque.to_le_bytes()));
    let feedback = Feedback {
        sequence: command.sequence,
        flags: ControllerFlags::from_bits(command.watchdog_ms),
        joints: command.torque.iter().map(reading).collect(),
    };
    let mut frame = [0; MAX_FEEDBACK_FRAME];
    let length = encode(&FromController::Feedback(feedback), &mut frame).expect("it fits");
    records.extend(&frame[..length]);
}
