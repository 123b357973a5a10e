//! The telemetry of a simulated servo's console: named groups of values, each with a schema that
//! says how its bytes are to be read. Only the groups that `moteus_tool --info` reads exist.
//!
//! A schema is a type: a byte that names it, and what belongs to it. Numbers are little-endian; all
//! lengths here are below 128, so they take one byte as the format's variable integers.

use super::servo::{FIRMWARE, MODEL};

/// Types of the vendor's schemas.
const UNSIGNED: u8 = 4;
const OBJECT: u8 = 16;
const FIXED_ARRAY: u8 = 19;

/// A value of a group: its name, the number of bytes of an unsigned integer, its numbers, and
/// whether they are an array.
struct Field {
    name: &'static str,
    bytes: u8,
    values: Vec<u64>,
    array: bool,
}

impl Field {
    fn one(name: &'static str, bytes: u8, value: u64) -> Self {
        Self { name, bytes, values: vec![value], array: false }
    }

    fn array(name: &'static str, bytes: u8, values: Vec<u64>) -> Self {
        Self { name, bytes, values, array: true }
    }
}

/// Returns the fields of the group `name` of the servo `id`, if it exists. The serial number ends
/// with the id, and the commit of the firmware is unknown.
fn group(name: &str, id: u8) -> Option<Vec<Field>> {
    Some(match name {
        "firmware" => vec![
            Field::one("version", 4, FIRMWARE as u64),
            Field::array("serial_number", 4, vec![0, 0, u64::from(id)]),
            Field::one("model", 4, MODEL as u64),
        ],
        "git" => vec![
            Field::array("hash", 1, vec![0; 20]),
            Field::one("dirty", 1, 0),
            Field::one("timestamp", 8, 0),
        ],
        _ => return None,
    })
}

/// Returns the schema of a group, with its length in front.
pub(super) fn schema(name: &str, id: u8) -> Option<Vec<u8>> {
    let mut bytes = vec![OBJECT, 0];
    for Field { name, bytes: size, values, array } in group(name, id)? {
        bytes.extend([0, name.len() as u8]);
        bytes.extend(name.as_bytes());
        // No other names.
        bytes.push(0);
        if array {
            bytes.extend([FIXED_ARRAY, values.len() as u8]);
        }
        // The last byte: there is no default.
        bytes.extend([UNSIGNED, size, 0]);
    }
    // A field without a name and of the type 0 ends the object.
    bytes.extend([0; 5]);
    Some(with_length(&bytes))
}

/// Returns the values of a group, with their length in front.
pub(super) fn data(name: &str, id: u8) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    for field in group(name, id)? {
        for value in field.values {
            bytes.extend(&value.to_le_bytes()[..usize::from(field.bytes)]);
        }
    }
    Some(with_length(&bytes))
}

fn with_length(bytes: &[u8]) -> Vec<u8> {
    [&(bytes.len() as u32).to_le_bytes(), bytes].concat()
}
