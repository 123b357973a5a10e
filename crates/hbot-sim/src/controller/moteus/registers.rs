//! Subframes of the register protocol, and how values are converted to integers (vendor's
//! reference: docs/protocol/can.md and registers.md of the moteus repository).

/// The number type in which a register is read or written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Int8,
    Int16,
    Int32,
    Float,
}

impl Kind {
    fn of(code: u8) -> Self {
        match code & 3 {
            0 => Self::Int8,
            1 => Self::Int16,
            2 => Self::Int32,
            _ => Self::Float,
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::Int8 => 1,
            Self::Int16 => 2,
            Self::Int32 | Self::Float => 4,
        }
    }
}

/// How the value of a register is converted to an integer that is sent, and back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Mapping {
    /// The integer counts steps of a physical quantity. The array has the step sizes for int8,
    /// int16 and int32. The lowest integer of each type stands for NaN.
    Scaled([f32; 3]),
    /// The integer is the value itself, without scaling.
    Plain,
}

pub(super) const POSITION: Mapping = Mapping::Scaled([0.01, 0.0001, 0.00001]);
pub(super) const VELOCITY: Mapping = Mapping::Scaled([0.1, 0.00025, 0.00001]);
pub(super) const ACCELERATION: Mapping = Mapping::Scaled([0.05, 0.001, 0.00001]);
pub(super) const TORQUE: Mapping = Mapping::Scaled([0.5, 0.01, 0.001]);
pub(super) const CURRENT: Mapping = Mapping::Scaled([1.0, 0.1, 0.001]);
pub(super) const TEMPERATURE: Mapping = Mapping::Scaled([1.0, 0.1, 0.001]);
pub(super) const VOLTAGE: Mapping = Mapping::Scaled([0.5, 0.1, 0.001]);
pub(super) const TIME: Mapping = Mapping::Scaled([0.01, 0.001, 0.000001]);
pub(super) const PWM: Mapping = Mapping::Scaled([1.0 / 127.0, 1.0 / 32767.0, 1.0 / 2147483647.0]);
pub(super) const POWER: Mapping = Mapping::Scaled([10.0, 0.05, 0.0001]);

/// The value of a register.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Value {
    /// A physical quantity and its conversion to integers.
    Quantity(f32, Mapping),
    /// A whole number.
    Whole(i32),
    /// A whole number that can be read only as an int32.
    Word(i32),
}

/// The error code of a register that cannot be read or written.
pub(super) type Refusal = u8;
/// The register does not exist.
pub(super) const UNKNOWN: Refusal = 1;
/// The register cannot be written.
pub(super) const NOT_WRITABLE: Refusal = 2;
/// The value is outside the range of the register.
pub(super) const OUT_OF_RANGE: Refusal = 3;

/// A reader that takes numbers one after the other from the data of a frame.
pub(super) struct Reader<'a>(pub(super) &'a [u8]);

impl Reader<'_> {
    pub(super) fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    pub(super) fn bytes(&mut self, n: usize) -> Option<Vec<u8>> {
        let (taken, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(taken.to_vec())
    }

    pub(super) fn varuint(&mut self) -> Option<u32> {
        let mut value = 0u32;
        for shift in 0..5 {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7f) << (7 * shift);
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    /// Reads the value of a register. It was sent as number type `kind`, and `mapping` says how its
    /// integers are scaled. Returns `None` if the data ends too early.
    pub(super) fn value(&mut self, kind: Kind, mapping: Mapping) -> Option<f32> {
        let bytes = self.bytes(kind.bytes())?;
        let whole = match (kind, bytes.as_slice()) {
            (Kind::Int8, [a]) => i32::from(*a as i8),
            (Kind::Int16, [a, b]) => i32::from(i16::from_le_bytes([*a, *b])),
            (_, [a, b, c, d]) => i32::from_le_bytes([*a, *b, *c, *d]),
            _ => return None,
        };
        let (least, step) = match (kind, mapping) {
            (Kind::Float, _) => return Some(f32::from_bits(whole as u32)),
            (_, Mapping::Plain) => return Some(whole as f32),
            (Kind::Int8, Mapping::Scaled(steps)) => (i32::from(i8::MIN), steps[0]),
            (Kind::Int16, Mapping::Scaled(steps)) => (i32::from(i16::MIN), steps[1]),
            (Kind::Int32, Mapping::Scaled(steps)) => (i32::MIN, steps[2]),
        };
        Some(if whole == least { f32::NAN } else { whole as f32 * step })
    }

    /// Reads the rest of the header of a subframe that reads or writes registers. `code` is the
    /// first byte of the subframe. Returns the number type, the first register and the number of
    /// registers.
    pub(super) fn registers(&mut self, code: u8) -> Option<(Kind, u32, u32)> {
        let count = match code & 3 {
            0 => self.varuint()?,
            count => u32::from(count),
        };
        Some((Kind::of(code >> 2), self.varuint()?, count))
    }
}

pub(super) fn put_varuint(out: &mut Vec<u8>, mut value: u32) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Appends the value of a register to `out` as number type `kind`. Returns false if the register
/// cannot be read as this type.
pub(super) fn put(out: &mut Vec<u8>, value: Value, kind: Kind) -> bool {
    let (whole, plain) = match value {
        Value::Word(word) if kind == Kind::Int32 => (word, word as f32),
        Value::Word(_) => return false,
        Value::Whole(whole) => (whole, whole as f32),
        Value::Quantity(quantity, mapping) => (mapped(quantity, mapping, kind), quantity),
    };
    match kind {
        Kind::Int8 => out.push(whole as i8 as u8),
        Kind::Int16 => out.extend_from_slice(&(whole as i16).to_le_bytes()),
        Kind::Int32 => out.extend_from_slice(&whole.to_le_bytes()),
        Kind::Float => out.extend_from_slice(&plain.to_le_bytes()),
    }
    true
}

/// Converts a quantity to an integer of number type `kind`, scaled as `mapping` says. The result is
/// rounded towards zero and limited to the type's range. A quantity that is not finite becomes the
/// lowest integer, which stands for NaN.
fn mapped(quantity: f32, mapping: Mapping, kind: Kind) -> i32 {
    let (least, most, at) = match kind {
        Kind::Int8 => (i32::from(i8::MIN), i32::from(i8::MAX), 0),
        Kind::Int16 => (i32::from(i16::MIN), i32::from(i16::MAX), 1),
        Kind::Int32 | Kind::Float => (i32::MIN, i32::MAX, 2),
    };
    let Mapping::Scaled(steps) = mapping else { return quantity as i32 };
    if !quantity.is_finite() {
        return least;
    }
    let most_float = most as f32;
    ((quantity / steps[at]).clamp(-most_float, most_float) as i32).clamp(-most, most)
}
