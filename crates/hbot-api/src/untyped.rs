//! Decodes bytes to an untyped value. It is stricter than `serde_json::Value`, which reads NaN as
//! null and keeps only the last of two equal keys.

use crate::Encoding;
use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};
use std::fmt;

/// A message that has been decoded to an untyped value.
pub(crate) struct Untyped {
    pub(crate) value: Value,
    /// The first mistake in the message, if there is one. The message could still be read to its
    /// end, so the answer can contain the id of the request.
    pub(crate) problem: Option<IllegalValue>,
}

/// A mistake in a message: a value or key that is not legal.
#[derive(Debug)]
pub(crate) struct IllegalValue {
    what: &'static str,
    legal: &'static str,
    /// Path of the wrong value, such as `joints[2].angle`. It is built from its last part to its
    /// first.
    path: String,
}

impl fmt::Display for IllegalValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, legal, path } = self;
        write!(f, "field {:?} {what}; legal: {legal}", crate::fields::Excerpt(path))
    }
}

/// Decodes a message. `bytes` must contain nothing else, and lists and maps can be nested at most
/// `depth` levels deep. Fails with a description for people.
pub(crate) fn read(encoding: Encoding, bytes: &[u8], depth: usize) -> Result<Untyped, String> {
    let mut problem = None;
    let seed = Builder { problem: &mut problem, depth };
    let value = match encoding {
        Encoding::Json => {
            let mut deserializer = serde_json::Deserializer::from_slice(bytes);
            seed.deserialize(&mut deserializer).and_then(|value| deserializer.end().map(|()| value)).map_err(
                |error| {
                    format!(
                        "not a JSON object: {error}{}{}",
                        no_number(bytes, error.column()),
                        hint(bytes, &error)
                    )
                },
            )
        }
        Encoding::Msgpack => {
            let mut deserializer = rmp_serde::Deserializer::new(bytes);
            let value = seed.deserialize(&mut deserializer);
            let left = deserializer.get_ref().len();
            value.map_err(|error| format!("not a MessagePack map: {error}")).and_then(|value| match left {
                0 => Ok(value),
                left => Err(format!("{left} bytes are left over after the MessagePack map")),
            })
        }
    }?;
    Ok(Untyped { value, problem })
}

/// Returns the end of the error about a message that ends too early or is none of this API.
fn hint(bytes: &[u8], error: &serde_json::Error) -> &'static str {
    match bytes {
        _ if error.is_eof() => "; a message is one JSON object on one line",
        [b'G' | b'P' | b'H' | b'O', b'A'..=b'Z', b'A'..=b'Z', ..] => {
            "; this looks like HTTP, which only the port after `web` in the server's output speaks"
        }
        _ => "",
    }
}

/// Returns the end of the error about a NaN or an infinity, of which JSON has none: the field that
/// holds it. `column` is the place of the error. Empty for other mistakes.
fn no_number(bytes: &[u8], column: usize) -> String {
    let (before, rest) = bytes.split_at(column.saturating_sub(1).min(bytes.len()));
    let is_number = ["NaN", "nan", "Infinity", "inf"].iter().any(|word| {
        let after = rest.strip_prefix(word.as_bytes());
        after.is_some_and(|after| !after.first().is_some_and(u8::is_ascii_alphabetic))
    });
    let before = String::from_utf8_lossy(before);
    let field = before.rsplit_once("\":").and_then(|(before, _)| before.rsplit('"').next());
    match field.filter(|_| is_number) {
        Some(field) => format!(" in field {:?}; legal: a finite number", crate::fields::Excerpt(field)),
        None => String::new(),
    }
}

/// Builds an untyped value from a message, and records the first mistake in it.
struct Builder<'a> {
    problem: &'a mut Option<IllegalValue>,
    /// Number of levels of lists and maps that can still be entered.
    depth: usize,
}

impl Builder<'_> {
    fn inner(&mut self) -> Builder<'_> {
        Builder { problem: self.problem, depth: self.depth - 1 }
    }

    fn enter<E: Error>(&self) -> Result<(), E> {
        if self.depth == 0 { Err(E::custom("lists and maps are nested too deep")) } else { Ok(()) }
    }

    fn given_twice(&mut self) {
        let (what, legal) = ("is given twice", "once");
        self.problem.get_or_insert(IllegalValue { what, legal, path: String::new() });
    }

    /// Adds `level`, a key or an index, to the front of the path of the recorded mistake. Does
    /// nothing if there is no mistake, or if it was `known_before` the value at this level was
    /// read.
    fn place(&mut self, known_before: bool, level: impl FnOnce() -> String) {
        if let (false, Some(problem)) = (known_before, self.problem.as_mut()) {
            let dot = if problem.path.is_empty() || problem.path.starts_with('[') { "" } else { "." };
            problem.path = format!("{}{dot}{}", level(), problem.path);
        }
    }
}

impl<'de> DeserializeSeed<'de> for Builder<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Builder<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("what JSON has: a map with text for keys, a list, text, a number, true, false or null")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(Value::Number(value.into()))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(Value::Number(value.into()))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        Ok(Number::from_f64(value).map_or_else(
            || {
                let what = if value.is_nan() { "is NaN" } else { "is infinite" };
                let legal = "a finite number";
                self.problem.get_or_insert(IllegalValue { what, legal, path: String::new() });
                Value::Null
            },
            Value::Number,
        ))
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(Value::String(value.into()))
    }

    fn visit_string<E>(self, value: String) -> Result<Value, E> {
        Ok(Value::String(value))
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_none<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut list: A) -> Result<Value, A::Error> {
        self.enter()?;
        // The announced length is not trusted, so no memory is reserved for it.
        let mut values = Vec::new();
        loop {
            let known_before = self.problem.is_some();
            let Some(value) = list.next_element_seed(self.inner())? else { break };
            self.place(known_before, || format!("[{}]", values.len()));
            values.push(value);
        }
        Ok(Value::Array(values))
    }

    fn visit_map<A: MapAccess<'de>>(mut self, mut map: A) -> Result<Value, A::Error> {
        self.enter()?;
        let mut values = Map::new();
        while let Some(key) = map.next_key::<String>()? {
            let known_before = self.problem.is_some();
            let value = map.next_value_seed(self.inner())?;
            if values.contains_key(&key) {
                self.given_twice();
            }
            self.place(known_before, || key.clone());
            values.insert(key, value);
        }
        Ok(Value::Object(values))
    }
}
