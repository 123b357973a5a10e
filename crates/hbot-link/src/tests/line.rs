//! Tests of damaged lines: damaged frames are refused, and the next good frame is decoded.

use super::{AnyMessage, all_samples};
use crate::frame::CRC;
use crate::*;
use proptest::{collection::vec, prelude::*};
use std::{vec, vec::Vec};

/// Returns a frame with the given body and a matching CRC. The body need not be a valid message.
fn framed(body: &[u8]) -> Vec<u8> {
    let checked = [body, &CRC.checksum(body).to_le_bytes()].concat();
    let mut frame = vec![0; cobs::max_encoding_length(checked.len()) + 1];
    let length = cobs::encode(&checked, &mut frame);
    frame[length] = 0;
    frame.truncate(length + 1);
    frame
}

/// Asserts that the damaged frame gives only errors, and that the undamaged frame `next` after it
/// is decoded.
fn assert_refused_and_recovered(name: &str, sample: &AnyMessage, damaged: &[u8], next: &AnyMessage) {
    let results = sample.decode(&[damaged, &next.encoded()]);
    let (last, before) = results.split_last().expect("a result");
    assert_eq!(last, &Ok(next.clone()), "{name}: {damaged:02x?}");
    assert!(
        !before.is_empty() && before.iter().all(Result::is_err),
        "{name}: {damaged:02x?} gave {before:?}"
    );
}

#[test]
fn every_truncation_is_refused_and_the_next_frame_decodes() {
    for (name, sample) in all_samples() {
        let frame = sample.encoded();
        let content = frame.len() - 1;
        for kept in 1..content {
            assert_refused_and_recovered(name, &sample, &[&frame[..kept], &[0]].concat(), &sample);
        }
        // Without its delimiter the rest of a frame runs into the next one. Both are lost, but not
        // the one after.
        for kept in 1..=content {
            let merged = [&frame[..kept], &frame].concat();
            assert_refused_and_recovered(name, &sample, &merged, &sample);
        }
    }
}

#[test]
fn every_flipped_bit_is_refused_and_the_next_frame_decodes() {
    for (name, sample) in all_samples() {
        let frame = sample.encoded();
        for bit in 0..8 * frame.len() {
            let mut damaged = frame.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            // If the delimiter is damaged, the next frame is lost too.
            if bit / 8 == frame.len() - 1 {
                damaged.extend(&frame);
            }
            assert_refused_and_recovered(name, &sample, &damaged, &sample);
        }
    }
}

#[test]
fn a_split_at_every_position_changes_nothing() {
    for (name, sample) in all_samples() {
        let twice = [sample.encoded(), sample.encoded()].concat();
        let expected = [Ok(sample.clone()), Ok(sample.clone())];
        for first in 0..=twice.len() {
            let (left, right) = twice.split_at(first);
            assert_eq!(sample.decode(&[left, right]), expected, "{name}, split at {first}");
            // A third piece, so that a frame also arrives between two splits.
            let (middle, right) = right.split_at(right.len() / 2);
            assert_eq!(sample.decode(&[left, middle, right]), expected, "{name}, split at {first}");
        }
    }
}

#[test]
fn frames_keep_their_order_among_garbage() {
    let samples = all_samples().into_iter().map(|(_, sample)| sample);
    let from = samples.filter(|sample| matches!(sample, AnyMessage::From(_))).collect::<Vec<_>>();
    let mut line = b"noise".to_vec();
    line.push(0);
    for sample in &from {
        line.extend(sample.encoded());
        line.extend([0, 0]);
    }
    let mut expected = vec![Err(FrameError::Cobs)];
    expected.extend(from.iter().cloned().map(Ok));
    assert_eq!(from[0].decode(&[&line]), expected);
}

#[test]
fn empty_frames_are_skipped_silently() {
    assert_eq!(AnyMessage::To(ToController::Describe).decode(&[&[0; 9], &[0], &[]]), []);
}

#[test]
fn a_frame_too_long_is_told_once_and_skipped_to_its_end() {
    for (sample, longest) in [
        (AnyMessage::To(ToController::Describe), MAX_COMMAND_FRAME),
        (AnyMessage::From(FromController::Feedback(Feedback::default())), MAX_FEEDBACK_FRAME),
    ] {
        // Just short enough: the bytes are decoded as a frame and refused.
        let fitting = vec![0xAA; longest - 1];
        assert_refused_and_recovered("fitting", &sample, &[&fitting[..], &[0]].concat(), &sample);
        assert_eq!(sample.decode(&[&fitting]), []);

        for excess in [0, 1, 10_000] {
            let babble = vec![0xAA; longest + excess];
            assert_eq!(sample.decode(&[&babble]), [Err(FrameError::TooLong)]);
            let expected = [Err(FrameError::TooLong), Ok(sample.clone())];
            assert_eq!(sample.decode(&[&babble, &babble, &[0], &sample.encoded()]), expected);
            let merged = [&babble[..], &[0], &sample.encoded()].concat();
            assert_eq!(sample.decode(&[&merged]), expected);
        }
    }
}

#[test]
fn a_reset_forgets_what_was_begun() {
    let frame = AnyMessage::To(ToController::Describe).encoded();
    let mut decoder = Decoder::<ToController>::new();
    for begun in [&frame[..3], &[0xAA; 1000]] {
        decoder.feed(begun, |_| ());
        decoder.reset();
        let mut results = vec![];
        decoder.feed(&frame, |result| results.push(result));
        assert_eq!(results, [Ok(ToController::Describe)]);
    }
}

#[test]
fn intact_frames_with_a_wrong_body_are_refused() {
    let to = AnyMessage::To(ToController::Describe);
    let from = AnyMessage::From(FromController::Feedback(Feedback::default()));
    let seventeen = [&[1, 0, 1, 20, 17][..], &[0; 17 * 4]].concat();
    for (sample, body) in [
        (&to, &[0, 0][..]),                                // a byte left over after Describe
        (&to, &[2]),                                       // no such variant
        (&to, &[1, 0, 1, 20, 1, 0, 0, 0]),                 // a torque of three bytes
        (&to, &[1, 0, 2, 20, 0]),                          // a bool that is neither
        (&to, &[1, 0, 1, 0x80, 0x80, 0x04, 0]),            // a watchdog of 65536 ms
        (&to, &seventeen),                                 // more torques than there can be joints
        (&from, &[0, 1, 1, 0xFF, 0]),                      // firmware that is no UTF-8
        (&from, &[1, 0x80, 0x80, 0x80, 0x80, 0x10, 0, 0]), // a sequence of 33 bits
    ] {
        assert_eq!(sample.decode(&[&framed(body)]), [Err(FrameError::Body)], "{body:02x?}");
    }
    for length in 0..=4 {
        let mut frame = vec![0xAA; length + 1];
        frame[0] = length as u8 + 1;
        frame.push(0);
        assert_eq!(to.decode(&[&frame]), [Err(FrameError::TooShort)]);
    }
}

/// Checks that the decoder does not judge values: every bit pattern of a float is decoded
/// unchanged, even NaN.
#[test]
fn floats_that_are_no_numbers_pass_through() {
    let patterns =
        [0x7FC0_0000, 0x7F80_0001, 0xFFFF_FFFF, 0x7F80_0000, 0xFF80_0000, 0x8000_0000, 0x0000_0001];
    let torque = patterns.iter().map(|bits| f32::from_bits(*bits)).collect();
    let message = ToController::Command(Command { sequence: 1, enable: true, watchdog_ms: 1, torque });
    let results = AnyMessage::To(message.clone()).decode(&[&AnyMessage::To(message).encoded()]);
    let [Ok(AnyMessage::To(ToController::Command(command)))] = &results[..] else { panic!("{results:?}") };
    assert_eq!(command.torque.iter().map(|torque| torque.to_bits()).collect::<Vec<_>>(), patterns);
}

/// Generates bytes as they could arrive on a damaged line: random bytes, with zeros and whole
/// frames among them.
fn any_line() -> impl Strategy<Value = Vec<u8>> {
    let frames = all_samples().into_iter().map(|(_, sample)| sample.encoded()).collect::<Vec<_>>();
    let piece = prop_oneof![
        vec(any::<u8>(), 0..40),
        vec(1..=u8::MAX, 0..600),
        Just(vec![0]),
        proptest::sample::select(frames),
        vec(any::<u8>(), 0..40).prop_map(|body| framed(&body)),
    ];
    vec(piece, 0..12).prop_map(|pieces| pieces.concat())
}

fn any_feedback() -> impl Strategy<Value = Feedback> {
    let float =
        any::<u32>().prop_map(f32::from_bits).prop_filter("compared by value", |float| !float.is_nan());
    let reading = (any::<i32>(), float.clone(), float.clone(), float, any::<u16>());
    (any::<u32>(), any::<u16>(), vec(reading, 0..=MAX_JOINTS)).prop_map(|(sequence, flags, joints)| {
        Feedback {
            sequence,
            flags: ControllerFlags::from_bits(flags),
            joints: joints
                .into_iter()
                .map(|(count, rate, current, temperature, flags)| {
                    let flags = JointFlags::from_bits(flags);
                    JointReading { count, rate, current, temperature, flags }
                })
                .collect(),
        }
    })
}

proptest! {
    /// Checks that a frame after a delimiter is decoded, whatever bytes came before it.
    #[test]
    fn a_frame_after_any_bytes_decodes(before in any_line(), feedback in any_feedback()) {
        let sample = AnyMessage::From(FromController::Feedback(feedback));
        let results = sample.decode(&[&before, &[0], &sample.encoded()]);
        prop_assert_eq!(results.last(), Some(&Ok(sample)));
    }
}
