//! From bytes to an untyped value, more strictly than `serde_json::Value` reads itself: that takes NaN for null, and the
//! last of two equal keys.

use crate::Encoding;
use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};
use std::fmt;

/// What a message holds.
pub(crate) struct Untyped {
    pub(crate) value: Value,
    /// What is wrong with it, where it could be read to its end all the same: then its id is known for the answer.
    pub(crate) problem: Option<Problem>,
}

/// A value that a message must not hold.
#[derive(Debug)]
pub(crate) struct Problem {
    what: &'static str,
    legal: &'static str,
    /// Where, as in `joints[2].angle`; made from the inside out.
    path: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, legal, path } = self;
        write!(f, "field {:?} {what}; legal: {legal}", crate::request::Excerpt(path))
    }
}

/// Reads one message of at most `depth` levels that takes up all of `bytes`. The error is for people.
pub(crate) fn read(encoding: Encoding, bytes: &[u8], depth: usize) -> Result<Untyped, String> {
    let mut problem = None;
    let builder = Builder { problem: &mut problem, depth };
    let value = match encoding {
        Encoding::Json => {
            let mut deserializer = serde_json::Deserializer::from_slice(bytes);
            builder
                .deserialize(&mut deserializer)
                .and_then(|value| deserializer.end().map(|()| value))
                .map_err(|error| format!("not a JSON object: {error}"))
        }
        Encoding::Msgpack => {
            let mut deserializer = rmp_serde::Deserializer::new(bytes);
            let value = builder.deserialize(&mut deserializer);
            let left = deserializer.get_ref().len();
            value.map_err(|error| format!("not a MessagePack map: {error}")).and_then(|value| match left {
                0 => Ok(value),
                left => Err(format!("{left} bytes are left over after the MessagePack map")),
            })
        }
    }?;
    Ok(Untyped { value, problem })
}

/// Builds a value and notes the first problem in it.
struct Builder<'a> {
    problem: &'a mut Option<Problem>,
    /// How many levels more may be opened.
    depth: usize,
}

impl Builder<'_> {
    fn inner(&mut self) -> Builder<'_> {
        Builder { problem: self.problem, depth: self.depth - 1 }
    }

    fn enter<E: Error>(&self) -> Result<(), E> {
        if self.depth == 0 { Err(E::custom("lists and maps are nested too deep")) } else { Ok(()) }
    }

    /// Puts one level before the path of a problem that came up below it.
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
                self.problem.get_or_insert(Problem { what, legal, path: String::new() });
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
        // No room is made for what a length merely announces.
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
                let (what, legal) = ("is given twice", "once");
                self.problem.get_or_insert(Problem { what, legal, path: String::new() });
            }
            self.place(known_before, || key.clone());
            values.insert(key, value);
        }
        Ok(Value::Object(values))
    }
}
