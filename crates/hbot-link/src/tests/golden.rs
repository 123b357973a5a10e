//! Tests of the bytes in docs/link.md. Firmware authors rely on that page alone, so its bytes must
//! be right.

use super::{AnyMessage, all_samples};
use crate::frame::CRC;
use crate::*;
use std::{collections::BTreeMap, format, string::String, vec::Vec};

const PAGE: &str = include_str!("../../../../docs/link.md");

/// Returns the test vectors listed in docs/link.md. The keys are the heading of the vector and the
/// name of the line: `body`, `crc` or `frame`.
fn vectors() -> BTreeMap<&'static str, BTreeMap<&'static str, Vec<u8>>> {
    let mut all = BTreeMap::<_, BTreeMap<_, Vec<u8>>>::new();
    let mut heading = None;
    let mut field = None;
    for line in PAGE.lines() {
        if line.starts_with('#') {
            heading = line.strip_prefix("### `").and_then(|rest| rest.strip_suffix('`'));
        } else if line.starts_with("```") {
            field = None;
        }
        let Some(name) = heading else { continue };
        for word in line.split_whitespace() {
            if ["body", "crc", "frame"].contains(&word) && line.starts_with(word) {
                field = Some(word);
            } else if let Some(field) = field {
                let byte =
                    u8::from_str_radix(word, 16).unwrap_or_else(|_| panic!("{name}: `{word}` is no byte"));
                all.entry(name).or_default().entry(field).or_default().push(byte);
            }
        }
    }
    all
}

/// Returns a test vector as text, in the format in which docs/link.md lists it.
fn written(sample: &AnyMessage) -> String {
    let body = sample.body();
    let check = CRC.checksum(&body).to_le_bytes();
    let mut text = String::from("```text\n");
    for (field, bytes) in [("body", &body[..]), ("crc", &check[..]), ("frame", &sample.encoded()[..])] {
        for (row, bytes) in bytes.chunks(24).enumerate() {
            let field = if row == 0 { field } else { "" };
            let hex = bytes.iter().map(|byte| format!(" {byte:02x}")).collect::<String>();
            text += &format!("{field:<5}{hex}\n");
        }
    }
    text + "```"
}

#[test]
fn every_vector_on_the_page_is_encoded_and_decoded_so() {
    let samples = all_samples();
    let mut page = vectors();
    for (name, sample) in &samples {
        let vector = page.remove(name).unwrap_or_default();
        let check = CRC.checksum(&sample.body()).to_le_bytes();
        let expected =
            BTreeMap::from([("body", sample.body()), ("crc", check.to_vec()), ("frame", sample.encoded())]);
        assert!(
            vector == expected,
            "docs/link.md, {name}: the page should have\n### `{name}`\n\n{}",
            written(sample)
        );
        assert_eq!(sample.decode(&[&vector["frame"]]), [Ok(sample.clone())], "{name}");
    }
    assert!(page.is_empty(), "docs/link.md has vectors that no test knows: {:?}", page.keys());
}

/// Checks that each frame in the table "Frames to refuse" of docs/link.md is refused with the error
/// that the page gives. The rows of the table are `| bytes | direction | error | reason |`.
#[test]
fn every_frame_to_refuse_on_the_page_is_refused_so() {
    let mut seen = Vec::new();
    let section =
        PAGE.split("\n## ").find(|section| section.starts_with("Frames to refuse")).expect("the section");
    for row in section.lines().filter(|line| line.starts_with("| `")) {
        let cells = row.split('|').map(|cell| cell.trim().trim_matches('`')).collect::<Vec<_>>();
        let bytes = cells[1].split(' ').map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect::<Vec<_>>();
        let direction = match cells[2] {
            "to controller" => AnyMessage::To(ToController::Describe),
            "from controller" => AnyMessage::From(FromController::Feedback(Feedback::default())),
            other => panic!("{other}: a direction"),
        };
        let results = direction.decode(&[&bytes]);
        let [Err(error)] = results[..] else { panic!("{row}: {results:?}") };
        assert_eq!(format!("{error:?}"), cells[3], "{row}");
        seen.push(error);
    }
    for error in [FrameError::Cobs, FrameError::TooShort, FrameError::Crc, FrameError::Body] {
        assert!(seen.contains(&error), "docs/link.md shows no frame refused for {error:?}");
    }
}

/// Checks that docs/link.md gives the correct frame sizes for several numbers of joints, and the
/// correct share of a line's capacity that the frames take.
#[test]
fn sizes_on_the_page_are_those_of_the_functions() {
    for joints in [1, 2, 4, 8, MAX_JOINTS] {
        let (command, feedback) = (command_frame_bytes(joints), feedback_frame_bytes(joints));
        let row = format!("| {joints} | {command} | {feedback} | {} |", feedback * BITS_PER_BYTE * 1000);
        assert!(PAGE.contains(&row), "docs/link.md should have the row\n{row}");
    }
    let (command, feedback) = (command_frame_bytes(4), feedback_frame_bytes(4));
    for baud in [1_000_000, 2_000_000, 3_000_000, 6_000_000] {
        let percent = |bytes: usize| 100.0 * (bytes * BITS_PER_BYTE * 1000) as f64 / f64::from(baud);
        let microseconds = |bytes: usize| 1e6 * (bytes * BITS_PER_BYTE) as f64 / f64::from(baud);
        let row = format!(
            "| {baud} | {:.1} % | {:.1} % | {:.0} µs | {:.0} µs |",
            percent(command),
            percent(feedback),
            microseconds(command),
            microseconds(feedback),
        );
        assert!(PAGE.contains(&row), "docs/link.md should have the row\n{row}");
    }
    for limit in [
        format!("Joints of a port | {MAX_JOINTS} |"),
        format!("Bytes of the firmware's name | {MAX_FIRMWARE_BYTES} |"),
        format!("Longest frame to a controller | {MAX_COMMAND_FRAME} bytes |"),
        format!("Longest frame from a controller | {MAX_FEEDBACK_FRAME} bytes |"),
        format!("Protocol version | {PROTOCOL_VERSION} |"),
    ] {
        assert!(PAGE.contains(&limit), "docs/link.md should have\n{limit}");
    }
}

#[test]
fn flags_on_the_page_are_those_of_the_types() {
    let flags = [
        ("ENABLED", ControllerFlags::ENABLED.bits()),
        ("WATCHDOG_EXPIRED", ControllerFlags::WATCHDOG_EXPIRED.bits()),
        ("FAULT", ControllerFlags::FAULT.bits()),
        ("UNDESCRIBED", ControllerFlags::UNDESCRIBED.bits()),
        ("INDEX_SEEN", JointFlags::INDEX_SEEN.bits()),
        ("OVERCURRENT", JointFlags::OVERCURRENT.bits()),
        ("OVERTEMPERATURE", JointFlags::OVERTEMPERATURE.bits()),
    ];
    for (name, bits) in flags {
        let row = format!("| `{name}` | {bits:#06x} |");
        assert!(PAGE.contains(&row), "docs/link.md should have the row\n{row}");
    }
}
