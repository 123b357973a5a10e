//! Tests of splitting bytes, in pieces of any size, into messages.

use super::{encoded, samples, unframed};
use crate::{Encoding, MAX_REQUEST_BYTES, SplitError, Splitter};

/// Splits `bytes` into messages, and returns all messages and errors. The bytes arrive in pieces
/// that end at `cuts`.
fn split(encoding: Encoding, bytes: &[u8], cuts: &[usize]) -> Vec<Result<Vec<u8>, SplitError>> {
    let mut splitter = Splitter::new(encoding);
    let mut messages = Vec::new();
    let mut from = 0;
    for to in cuts.iter().copied().chain([bytes.len()]) {
        splitter.push(&bytes[from..to]);
        while let Some(message) = splitter.next_message() {
            messages.push(message.map(<[u8]>::to_vec));
        }
        from = to;
    }
    assert_eq!(splitter.pending(), 0, "nothing is left over");
    messages
}

#[test]
fn any_cut_gives_the_same_messages() {
    for encoding in Encoding::ALL {
        let frames: Vec<Vec<u8>> =
            samples::requests()[8..13].iter().map(|request| encoded(encoding, request)).collect();
        let whole: Vec<_> = frames.iter().map(|frame| Ok(unframed(encoding, frame))).collect();
        let bytes = frames.concat();
        for cut in 0..=bytes.len() {
            assert_eq!(split(encoding, &bytes, &[cut]), whole, "{encoding} cut at {cut}");
        }
        let every_byte: Vec<usize> = (0..bytes.len()).collect();
        assert_eq!(split(encoding, &bytes, &every_byte), whole, "{encoding} byte by byte");
    }
}

#[test]
fn blank_lines_and_carriage_returns_are_passed_over() {
    let messages = split(Encoding::Json, b"\n\r\n  \r\n{}\r\n\n {\"a\":1}\t\n", &[]);
    assert_eq!(messages, [Ok(b"{}".to_vec()), Ok(b"{\"a\":1}".to_vec())]);
    assert_eq!(split(Encoding::Msgpack, b"\0\0\0\0\0\0\0\x01\x80\0\0\0\0", &[]), [Ok(vec![0x80])]);
}

#[test]
fn a_line_may_have_exactly_the_limit() {
    let line = |length: usize| [vec![b'x'; length - 1], b"\n".to_vec()].concat();
    let longest = line(MAX_REQUEST_BYTES);
    assert_eq!(split(Encoding::Json, &longest, &[]), [Ok(longest[..MAX_REQUEST_BYTES - 1].to_vec())]);
    let too_long = [line(MAX_REQUEST_BYTES + 1), line(3)].concat();
    let expected = [Err(SplitError::TooLarge { limit: MAX_REQUEST_BYTES, length: None }), Ok(b"xx".to_vec())];
    for cuts in
        [&[][..], &[MAX_REQUEST_BYTES - 1], &[MAX_REQUEST_BYTES], &[MAX_REQUEST_BYTES + 1], &[5, 40_000]]
    {
        assert_eq!(split(Encoding::Json, &too_long, cuts), expected, "cut at {cuts:?}");
    }
}

#[test]
fn a_map_may_have_exactly_the_limit() {
    let frame = |length: usize| [(length as u32).to_be_bytes().to_vec(), vec![7; length]].concat();
    let longest = frame(MAX_REQUEST_BYTES);
    assert_eq!(split(Encoding::Msgpack, &longest, &[]), [Ok(vec![7; MAX_REQUEST_BYTES])]);
    let length = MAX_REQUEST_BYTES + 1;
    let too_long = [frame(length), frame(2)].concat();
    let expected =
        [Err(SplitError::TooLarge { limit: MAX_REQUEST_BYTES, length: Some(length) }), Ok(vec![7, 7])];
    for cuts in [&[][..], &[3], &[4], &[5, 40_000], &[length + 3], &[length + 4]] {
        assert_eq!(split(Encoding::Msgpack, &too_long, cuts), expected, "cut at {cuts:?}");
    }
}

#[test]
fn an_announced_length_takes_no_memory() {
    let mut splitter = Splitter::new(Encoding::Msgpack);
    splitter.push(&[0xFF; 4]);
    let took = allocation_counter::measure(|| {
        assert!(matches!(splitter.next_message(), Some(Err(SplitError::TooLarge { .. }))));
        for _ in 0..1000 {
            splitter.push(&[0]);
            assert!(splitter.next_message().is_none());
        }
    });
    assert_eq!(took.count_total, 0);
}

#[test]
fn a_line_that_is_not_utf8_is_refused_alone() {
    let messages = split(Encoding::Json, b"{}\n{\"a\":\"\xff\"}\n{}\n", &[]);
    assert_eq!(messages, [Ok(b"{}".to_vec()), Err(SplitError::NotUtf8 { at: 6 }), Ok(b"{}".to_vec())]);
}

#[test]
fn json_after_a_change_to_msgpack_is_told_apart() {
    let mut splitter = Splitter::new(Encoding::Json);
    splitter.push(b"{\"hello\":1}\n{\"id\": 2}\n");
    assert!(matches!(splitter.next_message(), Some(Ok(_))));
    splitter.set_encoding(Encoding::Msgpack);
    assert_eq!(splitter.next_message(), Some(Err(SplitError::LooksLikeJson)));
}

#[test]
fn the_encoding_changes_between_two_bytes() {
    let mut splitter = Splitter::new(Encoding::Json);
    splitter.push(b"{}\n\0\0\0\x01\x80");
    assert_eq!(splitter.next_message(), Some(Ok(&b"{}"[..])));
    splitter.set_encoding(Encoding::Msgpack);
    assert_eq!(splitter.next_message(), Some(Ok(&[0x80][..])));
}
