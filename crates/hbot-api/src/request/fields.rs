//! Reads the fields of a request one by one. Errors name the field.

use crate::untyped::Named;
use crate::{
    ErrorBody, ErrorCode, Impedance, MAX_ASYMMETRY, MAX_MAGNITUDE, MAX_OFFSET, MAX_PLANES,
    MIN_QUATERNION_NORM, MIN_SIGMA, PlaneCommand, is_plain,
};
use serde_json::Value;
use std::borrow::Cow;
use std::fmt;

/// The fields of a request that have not been read yet. Reading a field removes it.
pub(crate) struct Fields<'a>(pub(crate) Named<'a>);

impl Fields<'_> {
    pub(crate) fn get(&self, name: &str) -> Option<&Value> {
        self.0.iter().find(|(key, _)| key == name).map(|(_, value)| value)
    }

    /// Removes a field and returns its value, which can be null. Returns `None` if the field is
    /// absent.
    pub(crate) fn remove(&mut self, name: &str) -> Option<Value> {
        let at = self.0.iter().position(|(key, _)| key == name)?;
        Some(self.0.remove(at).1)
    }

    /// Removes an optional field and returns its value. Returns `None` if the field is absent or
    /// null.
    pub(crate) fn take(&mut self, name: &str) -> Option<Value> {
        self.remove(name).filter(|value| !value.is_null())
    }

    fn required(&mut self, name: &str, legal: impl fmt::Display) -> Result<Value, ErrorBody> {
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
        let sigma: [f64; 3] = array(name, &value, LEGAL_SIGMA, std::f64::consts::PI)?;
        if sigma.iter().any(|x| *x < MIN_SIGMA) {
            return Err(illegal(name, &value, LEGAL_SIGMA));
        }
        Ok(Some(sigma))
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

    /// Removes an optional stiffness or damping. It is 0 if the field is absent. Fails if it is
    /// negative about an axis of frame N, or not symmetric. Its other eigenvalues are not checked.
    pub(crate) fn impedance(&mut self, name: &str) -> Result<Impedance, ErrorBody> {
        let Some(value) = self.take(name) else { return Ok(Impedance::default()) };
        let Value::Array(items) = &value else {
            if !value.is_number() {
                return Err(illegal(name, &value, LEGAL_IMPEDANCE));
            }
            return number(name, &value, 0.0, MAX_MAGNITUDE).map(Impedance::All);
        };
        if items.len() != 3 {
            return Err(illegal(name, &value, LEGAL_IMPEDANCE));
        }
        let mut rows = [[0.0; 3]; 3];
        for (i, item) in items.iter().enumerate() {
            if items.iter().any(Value::is_array) {
                rows[i] = array(&format!("{name}[{i}]"), item, LEGAL_VECTOR, MAX_MAGNITUDE)?;
            }
            let own = if item.is_array() { &item[i] } else { item };
            rows[i][i] = number(format_args!("{name}[{i}]"), own, 0.0, MAX_MAGNITUDE)?;
        }
        if !items.iter().any(Value::is_array) {
            return Ok(Impedance::Axes([rows[0][0], rows[1][1], rows[2][2]]));
        }
        let largest = rows.as_flattened().iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let [above, below] = [rows[i][j], rows[j][i]];
            if (above - below).abs() > MAX_ASYMMETRY * largest {
                return Err(bad(format!(
                    "field \"{name}[{i}][{j}]\" is {above}, and \"{name}[{j}][{i}]\" is {below}; legal: a symmetric matrix"
                )));
            }
        }
        Ok(Impedance::Matrix(rows))
    }

    /// Removes an optional list of half-spaces.
    pub(crate) fn planes(&mut self, name: &str) -> Result<Vec<PlaneCommand>, ErrorBody> {
        let legal = format_args!("a list of at most {MAX_PLANES} maps");
        let items = match self.take(name) {
            None => return Ok(Vec::new()),
            Some(Value::Array(items)) if items.len() <= MAX_PLANES => items,
            Some(other) => return Err(illegal(name, &other, legal)),
        };
        let plane = |(i, item): (usize, Value)| {
            let Value::Object(map) = item else {
                return Err(illegal(format_args!("{name}[{i}]"), &item, "a map with \"normal\""));
            };
            let path = |key: &str| format!("{name}[{i}].{key}");
            if let Some(key) = map.keys().find(|key| !PLANE.contains(&key.as_str())) {
                let legal = PLANE.join(", ");
                return Err(bad(format!("unknown field {:?}; legal: {legal}", Excerpt(&path(key)))));
            }
            let mut fields = Fields(map.into_iter().map(|(key, x)| (Cow::Owned(path(&key)), x)).collect());
            let normal = fields.required(&path("normal"), LEGAL_NORMAL)?;
            Ok(PlaneCommand {
                normal: normalized(&path("normal"), &normal, LEGAL_NORMAL)?,
                offset: fields.optional_number(&path("offset"), -MAX_OFFSET, MAX_OFFSET)?.unwrap_or(0.0),
                stiffness: fields.number(&path("stiffness"), 0.0, MAX_MAGNITUDE)?,
                damping: fields.optional_number(&path("damping"), 0.0, MAX_MAGNITUDE)?.unwrap_or(0.0),
            })
        };
        items.into_iter().enumerate().map(plane).collect()
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

fn number(name: impl fmt::Display, value: &Value, from: f64, to: f64) -> Result<f64, ErrorBody> {
    match value.as_f64() {
        Some(number) if (from..=to).contains(&number) => Ok(number),
        _ => Err(illegal(name, value, Real(from, to))),
    }
}

const LEGAL_VECTOR: &str = "a list of 3 numbers, each from -1e6 to 1e6";
const LEGAL_DIRECTION: &str = "a list of 3 numbers, not all zero";
const LEGAL_SIGMA: &str = "a list of 3 numbers, each from 1e-5 to 3.141592653589793";
const LEGAL_QUATERNION: &str = "a list of 4 numbers [w, x, y, z] of norm 1";
const LEGAL_NORMAL: &str = "a list of 3 numbers of norm 1";
const LEGAL_IMPEDANCE: &str = "a number from 0, 3 of them, or the 3 rows of a symmetric matrix";

/// The fields of a half-space in a model.
const PLANE: [&str; 4] = ["normal", "offset", "stiffness", "damping"];

fn array<const N: usize>(
    name: &str,
    value: &Value,
    legal: &'static str,
    most: f64,
) -> Result<[f64; N], ErrorBody> {
    let items = match value {
        Value::Array(items) if items.len() == N => items,
        other => return Err(illegal(name, other, legal)),
    };
    let mut numbers = [0.0; N];
    for (i, (slot, item)) in numbers.iter_mut().zip(items).enumerate() {
        *slot = number(format_args!("{name}[{i}]"), item, -most, most)?;
    }
    Ok(numbers)
}

/// Returns a vector or quaternion scaled to unit norm.
fn normalized<const N: usize>(name: &str, value: &Value, legal: &'static str) -> Result<[f64; N], ErrorBody> {
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
