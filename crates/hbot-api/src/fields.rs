//! Reads the fields of a request one by one. Errors name the field.

use crate::{ErrorBody, ErrorCode, MAX_MAGNITUDE, MIN_QUATERNION_NORM, MIN_SIGMA, is_plain};
use serde_json::{Map, Value};
use std::fmt;

/// The fields of a request that have not been read yet. Reading a field removes it.
pub(crate) struct Fields(pub(crate) Map<String, Value>);

impl Fields {
    pub(crate) fn get(&self, name: &str) -> Option<&Value> {
        self.0.get(name)
    }

    /// Removes a field and returns its value, which can be null. Returns `None` if the field is
    /// absent.
    pub(crate) fn remove(&mut self, name: &str) -> Option<Value> {
        self.0.shift_remove(name)
    }

    /// Removes an optional field and returns its value. Returns `None` if the field is absent or
    /// null.
    pub(crate) fn take(&mut self, name: &str) -> Option<Value> {
        self.remove(name).filter(|value| !value.is_null())
    }

    pub(crate) fn required(&mut self, name: &str, legal: impl fmt::Display) -> Result<Value, ErrorBody> {
        match self.remove(name) {
            Some(value) => Ok(value),
            None => Err(bad(format!("field {name:?} is missing; legal: {legal}"))),
        }
    }

    pub(crate) fn integer(&mut self, name: &str, from: u64, to: u64) -> Result<u64, ErrorBody> {
        let value = self.required(name, Integer(from, to))?;
        integer(name, &value, from, to)
    }

    pub(crate) fn optional_integer(
        &mut self,
        name: &str,
        from: u64,
        to: u64,
    ) -> Result<Option<u64>, ErrorBody> {
        self.take(name).map(|value| integer(name, &value, from, to)).transpose()
    }

    pub(crate) fn number(&mut self, name: &str, from: f64, to: f64) -> Result<f64, ErrorBody> {
        let value = self.required(name, Real(from, to))?;
        number(name, &value, from, to)
    }

    pub(crate) fn optional_number(
        &mut self,
        name: &str,
        from: f64,
        to: f64,
    ) -> Result<Option<f64>, ErrorBody> {
        self.take(name).map(|value| number(name, &value, from, to)).transpose()
    }

    pub(crate) fn vector(&mut self, name: &str) -> Result<[f64; 3], ErrorBody> {
        let value = self.required(name, LEGAL_VECTOR)?;
        array(name, &value, LEGAL_VECTOR, MAX_MAGNITUDE)
    }

    pub(crate) fn optional_vector(&mut self, name: &str) -> Result<Option<[f64; 3]>, ErrorBody> {
        self.take(name).map(|value| array(name, &value, LEGAL_VECTOR, MAX_MAGNITUDE)).transpose()
    }

    /// Removes a required field that is a direction, and returns it scaled to unit length.
    pub(crate) fn direction(&mut self, name: &str) -> Result<[f64; 3], ErrorBody> {
        let value = self.required(name, LEGAL_DIRECTION)?;
        let v: [f64; 3] = array(name, &value, LEGAL_DIRECTION, MAX_MAGNITUDE)?;
        let norm2: f64 = v.iter().map(|x| x * x).sum();
        let norm = norm2.sqrt();
        if norm < MIN_QUATERNION_NORM {
            return Err(bad(format!("field {name:?} has length {norm}; legal: {LEGAL_DIRECTION}")));
        }
        // As for quaternions: a message that is written and read again does not change.
        let is_unit = (norm2 - 1.0).abs() <= 8.0 * f64::EPSILON;
        Ok(if is_unit { v } else { v.map(|x| x / norm) })
    }

    /// Removes an optional field with three standard deviations of angles, rad.
    pub(crate) fn optional_sigmas(&mut self, name: &str) -> Result<Option<[f64; 3]>, ErrorBody> {
        let Some(value) = self.take(name) else { return Ok(None) };
        array_within(name, &value, LEGAL_SIGMA, (MIN_SIGMA, std::f64::consts::PI)).map(Some)
    }

    /// Removes a required field that is a quaternion, and returns the quaternion scaled to unit
    /// norm.
    pub(crate) fn quaternion(&mut self, name: &str) -> Result<[f64; 4], ErrorBody> {
        let value = self.required(name, LEGAL_QUATERNION)?;
        normalized(name, &value, LEGAL_QUATERNION)
    }

    pub(crate) fn optional_quaternion(&mut self, name: &str) -> Result<Option<[f64; 4]>, ErrorBody> {
        self.take(name).map(|value| normalized(name, &value, LEGAL_QUATERNION)).transpose()
    }

    pub(crate) fn flag(&mut self, name: &str) -> Result<bool, ErrorBody> {
        match self.take(name) {
            None => Ok(false),
            Some(Value::Bool(flag)) => Ok(flag),
            Some(other) => Err(illegal(name, &other, "true or false")),
        }
    }

    /// Removes a required field that is text, and returns the text. Fails unless the text has 1 to
    /// `most` bytes without control or invisible characters.
    pub(crate) fn text(&mut self, name: &str, most: usize) -> Result<String, ErrorBody> {
        let legal = format_args!("text of 1 to {most} bytes without control or invisible characters");
        match self.required(name, legal)? {
            Value::String(text) if is_name(&text, most) => Ok(text),
            other => Err(illegal(name, &other, legal)),
        }
    }
}

fn is_name(text: &str, most: usize) -> bool {
    !text.is_empty() && text.len() <= most && text.chars().all(is_plain)
}

fn integer(name: &str, value: &Value, from: u64, to: u64) -> Result<u64, ErrorBody> {
    match value.as_u64() {
        Some(number) if (from..=to).contains(&number) => Ok(number),
        _ => Err(illegal(name, value, Integer(from, to))),
    }
}

pub(crate) fn number(name: impl fmt::Display, value: &Value, from: f64, to: f64) -> Result<f64, ErrorBody> {
    match value.as_f64() {
        Some(number) if (from..=to).contains(&number) => Ok(number),
        _ => Err(illegal(name, value, Real(from, to))),
    }
}

pub(crate) const LEGAL_VECTOR: &str = "a list of 3 numbers, each from -1e6 to 1e6";
const LEGAL_DIRECTION: &str = "a list of 3 numbers, not all zero";
const LEGAL_SIGMA: &str = "a list of 3 numbers, each from 1e-5 to 3.141592653589793";
const LEGAL_QUATERNION: &str = "a list of 4 numbers [w, x, y, z] whose norm is at least 0.001";

pub(crate) fn array<const N: usize>(
    name: &str,
    value: &Value,
    legal: &'static str,
    most: f64,
) -> Result<[f64; N], ErrorBody> {
    array_within(name, value, legal, (-most, most))
}

fn array_within<const N: usize>(
    name: &str,
    value: &Value,
    legal: &'static str,
    (from, to): (f64, f64),
) -> Result<[f64; N], ErrorBody> {
    let items = match value {
        Value::Array(items) if items.len() == N => items,
        other => return Err(illegal(name, other, legal)),
    };
    let mut numbers = [0.0; N];
    for (i, (slot, item)) in numbers.iter_mut().zip(items).enumerate() {
        *slot = number(format_args!("{name}[{i}]"), item, from, to)?;
    }
    Ok(numbers)
}

/// Returns a vector or quaternion scaled to unit norm.
pub(crate) fn normalized<const N: usize>(
    name: &str,
    value: &Value,
    legal: &'static str,
) -> Result<[f64; N], ErrorBody> {
    let q: [f64; N] = array(name, value, legal, MAX_MAGNITUDE)?;
    let norm2: f64 = q.iter().map(|x| x * x).sum();
    let norm = norm2.sqrt();
    if norm < MIN_QUATERNION_NORM {
        return Err(bad(format!("field {name:?} has norm {norm}; legal: {legal}")));
    }
    // What has unit norm within rounding stays bit-identical, so that a message that is written and
    // read again does not change.
    let is_unit = (norm2 - 1.0).abs() <= 8.0 * f64::EPSILON;
    Ok(if is_unit { q } else { q.map(|x| x / norm) })
}

/// Creates an error with the code [`ErrorCode::BadRequest`] and this message.
pub(crate) fn bad(message: impl Into<String>) -> ErrorBody {
    ErrorBody::new(ErrorCode::BadRequest, message)
}

pub(crate) fn illegal(name: impl fmt::Display, found: &Value, legal: impl fmt::Display) -> ErrorBody {
    bad(format!("field \"{name}\" is {}; legal: {legal}", Shown(found)))
}

/// The legal range of a whole number, given by its ends. Error messages show it as a description,
/// such as `a whole number from 1 to 5`.
struct Integer(u64, u64);

impl fmt::Display for Integer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(from, to) = self;
        match *to {
            to if to == *from => write!(f, "the number {from}"),
            u64::MAX => write!(f, "a whole number from {from}"),
            to => write!(f, "a whole number from {from} to {to}"),
        }
    }
}

/// The legal range of a number, given by its ends. Error messages show it as a description, such as
/// `a number from 0 to 1`.
struct Real(f64, f64);

impl fmt::Display for Real {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(from, to) = self;
        if *to == f64::MAX {
            write!(f, "a number from {from}")
        } else {
            write!(f, "a number from {from} to {to}")
        }
    }
}

/// Displays a value in an error message. Long values are shortened.
pub(crate) struct Shown<'a>(pub(crate) &'a Value);

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Value::Null => f.write_str("null"),
            Value::Bool(flag) => write!(f, "{flag}"),
            Value::Number(number) => write!(f, "{number}"),
            Value::String(text) => write!(f, "the text {:?}", Excerpt(text)),
            Value::Array(items) => write!(f, "a list of {}", items.len()),
            Value::Object(_) => f.write_str("a map"),
        }
    }
}

/// Displays a client's text in an error message, quoted and escaped. Long text is shortened.
pub(crate) struct Excerpt<'a>(pub(crate) &'a str);

impl fmt::Debug for Excerpt<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.char_indices().nth(40) {
            Some((end, _)) => write!(f, "{:?}...", &self.0[..end]),
            None => write!(f, "{:?}", self.0),
        }
    }
}
